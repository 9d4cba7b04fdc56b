"""From an observation to the skills and arguments of both arms, in SI units and by name."""

import secrets
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from taskschema.arrays import Float32Array, FloatArray
from taskschema.bus.records import PublishedPolicy
from taskschema.config import RunConfig
from taskschema.errors import UnknownNameError
from taskschema.observation import ObservationLayout
from taskschema.policies import Policy, PolicySnapshot
from taskschema.randomness import EpisodeKey, Purpose, generator
from taskschema.skills.pairs import ARMS, PairSpace
from taskschema.tasks import Task
from taskschema.tasks.registry import task_of
from taskschema_learner.api.models import ActAnswer, ActRequest, ArgumentValue, SkillCall
from taskschema_learner.api.problems import ConflictError, RequestError

MAX_RUNS = 16
"""Runs whose decoded policies are kept."""
LARGEST_NUMBER = float(np.finfo(np.float32).max)
"""Observations travel as float32."""


@dataclass(frozen=True)
class Actor:
    """One run's policy version, decoded and ready."""

    task: Task
    sha256: str
    policy: Policy

    def act(self, run: str, request: ActRequest) -> ActAnswer:
        """Answer one observation.

        Raises:
            RequestError: if step or observation do not fit the task.
        """
        task = self.task
        if request.step >= task.horizon:
            raise RequestError(f"step must be 0 to {task.horizon - 1} for {task.name}, got {request.step}.")
        observation = observation_vector(task.observation, request.observation)[None]
        if request.mode == "mean":
            actions, seed = self.policy.act_mean(observation, request.step), None
        else:
            seed = secrets.randbits(53) if request.seed is None else request.seed
            stream = generator(EpisodeKey(seed, round=0, slot=0, episode=0), Purpose.ACTION, request.step)
            actions = self.policy.act(observation, request.step, [stream])
        pair = int(actions.pairs[0])
        left, right = (skill_call(task.pairs, actions.arguments[0], pair, arm) for arm in range(len(ARMS)))
        return ActAnswer(
            run=run,
            version=self.policy.snapshot.version,
            step=request.step,
            mode=request.mode,
            seed=seed,
            pair=task.pairs.pairs[pair],
            left=left,
            right=right,
        )


class Actors:
    """Decodes policies once per version; safe to use from several threads."""

    def __init__(self, config: Callable[[str], RunConfig]) -> None:
        self._config = config
        self._actors: OrderedDict[str, Actor] = OrderedDict()

    def get(self, run: str, published: PublishedPolicy) -> Actor:
        """Return the actor of a run's published policy.

        Raises:
            ConflictError: if the run's policy does not see states.
            TaskFileError: if the run's own task file does not load here.
        """
        held = self._actors.get(run)
        if held is not None and held.sha256 == published.sha256:
            return held
        config = self._config(run)
        if config.observation != "state":
            raise ConflictError(f"Run {run!r} sees images: /act answers state observations only.")
        task = held.task if held is not None else task_of(config)
        snapshot = PolicySnapshot.from_bytes(published.data)
        actor = Actor(task, published.sha256, Policy(snapshot, task.pairs, task.observation))
        self._actors[run] = actor
        while len(self._actors) > MAX_RUNS:
            self._actors.popitem(last=False)
        return actor


def observation_vector(
    layout: ObservationLayout, given: dict[str, float | list[float]] | list[float]
) -> Float32Array:
    """Return the observation [D] from a flat vector or from values by field name.

    Raises:
        RequestError: if a field is unknown or missing, or a length or number does not fit.
    """
    values = given if isinstance(given, list) else _by_name(layout, given)
    if len(values) != layout.size:
        raise RequestError(
            f"observation has {len(values)} numbers, this task's has {layout.size}: see GET /policy/meta."
        )
    vector = np.array(values, dtype=np.float64)
    if not (np.abs(vector) <= LARGEST_NUMBER).all():
        raise RequestError(f"observation must hold finite numbers of at most {LARGEST_NUMBER:.3g}.")
    return vector.astype(np.float32)


def _by_name(layout: ObservationLayout, given: dict[str, float | list[float]]) -> list[float]:
    names = [field.name for field in layout.fields]
    for name in given:
        if name not in names:
            raise RequestError(str(UnknownNameError("observation field", name[:100], names)))
    missing = [name for name in names if name not in given]
    if missing:
        raise RequestError(f"observation lacks: {', '.join(missing)}. See GET /policy/meta.")
    values: list[float] = []
    for field in layout.fields:
        value = given[field.name]
        numbers = value if isinstance(value, list) else [value]
        if len(numbers) != field.size:
            raise RequestError(
                f"observation.{field.name} has {len(numbers)} numbers, expected {field.size} [{field.unit}]."
            )
        values += numbers
    return values


def skill_call(pairs: PairSpace, arguments: FloatArray, pair: int, arm: int) -> SkillCall:
    """Return what arm 0 (left) or 1 (right) does in a pair, with its share of the arguments [A]."""
    index = int(pairs.skill_index(np.array(pair), arm))
    skill = pairs.skills[index]
    values = arguments[pairs.columns(arm, index)]
    return SkillCall(
        skill=skill.name,
        arguments={
            argument.name: ArgumentValue(value=float(value), unit=argument.unit)
            for argument, value in zip(skill.arguments, values, strict=True)
        },
    )
