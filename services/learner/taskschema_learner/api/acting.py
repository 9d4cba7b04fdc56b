"""From an observation to the skills and arguments of both arms, in SI units and by name."""

import base64
import math
import secrets
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from taskschema.arrays import AnyArray, Float32Array, FloatArray
from taskschema.bus.records import PublishedPolicy
from taskschema.config import RunConfig
from taskschema.errors import FrameError, UnknownNameError
from taskschema.frames import FRAME_SHAPE, check_colour_order, check_frames
from taskschema.observation import ObservationLayout
from taskschema.policies import ActingPolicy, ImagePolicy, PolicySnapshot, policy_of
from taskschema.randomness import EpisodeKey, Purpose, generator
from taskschema.skills.pairs import ARMS, PairSpace
from taskschema.tasks import Task
from taskschema.tasks.registry import task_of
from taskschema_learner.api.models import ActAnswer, ActRequest, ArgumentValue, ResponseMaps, SkillCall
from taskschema_learner.api.problems import RequestError

MAX_RUNS = 16
"""Runs whose decoded policies are kept."""
LARGEST_NUMBER = float(np.finfo(np.float32).max)
"""Observations travel as float32."""


@dataclass(frozen=True)
class Actor:
    """One run's policy version, decoded and ready."""

    task: Task
    sha256: str
    policy: ActingPolicy

    @property
    def pairs(self) -> PairSpace:
        """The skill pairs with the search spaces that the policy acts in."""
        return self.task.seen_pairs("image" if isinstance(self.policy, ImagePolicy) else "state")

    def act(self, run: str, request: ActRequest) -> ActAnswer:
        """Answer one observation.

        Raises:
            RequestError: if step or observation do not fit the task.
        """
        task = self.task
        if request.step >= task.horizon:
            raise RequestError(f"step must be 0 to {task.horizon - 1} for {task.name}, got {request.step}.")
        observation = self._observation(request)
        if request.mode == "mean":
            actions, seed = self.policy.act_mean(observation, request.step), None
        else:
            seed = secrets.randbits(53) if request.seed is None else request.seed
            stream = generator(EpisodeKey(seed, round=0, slot=0, episode=0), Purpose.ACTION, request.step)
            actions = self.policy.act(observation, request.step, [stream])
        pair = int(actions.pairs[0])
        left, right = (skill_call(self.pairs, actions.arguments[0], pair, arm) for arm in range(len(ARMS)))
        return ActAnswer(
            run=run,
            version=self.policy.snapshot.version,
            step=request.step,
            mode=request.mode,
            seed=seed,
            pair=task.pairs.pairs[pair],
            left=left,
            right=right,
            response_maps=self._response_maps(observation) if request.response_maps else None,
        )

    def _observation(self, request: ActRequest) -> AnyArray:
        """Return the observation [1, D], or the frame [1, 256, 256, 3]."""
        given = request.observation
        if isinstance(self.policy, ImagePolicy):
            if not isinstance(given, str):
                raise RequestError("This run sees images: observation must be a frame in base64.")
            return frame_of(given)
        if isinstance(given, str):
            raise RequestError("This run sees states: observation must be fields or a list of numbers.")
        if request.response_maps:
            raise RequestError("This run sees states: only a policy on images has response maps.")
        return observation_vector(self.task.observation, given)[None]

    def _response_maps(self, frames: AnyArray) -> ResponseMaps:
        assert isinstance(self.policy, ImagePolicy)
        left, right = self.policy.response_maps(frames)[0].tolist()
        return ResponseMaps(x=self.task.table.x, y=self.task.table.y, left=left, right=right)


class Actors:
    """Decodes policies once per version; safe to use from several threads."""

    def __init__(self, config: Callable[[str], RunConfig]) -> None:
        self._config = config
        self._actors: OrderedDict[str, Actor] = OrderedDict()

    def get(self, run: str, published: PublishedPolicy) -> Actor:
        """Return the actor of a run's published policy.

        Raises:
            TaskFileError: if the run's own task file does not load here.
        """
        held = self._actors.get(run)
        if held is not None and held.sha256 == published.sha256:
            return held
        config = self._config(run)
        task = held.task if held is not None else task_of(config)
        snapshot = PolicySnapshot.from_bytes(published.data)
        actor = Actor(task, published.sha256, policy_of(config, task, snapshot))
        self._actors[run] = actor
        while len(self._actors) > MAX_RUNS:
            self._actors.popitem(last=False)
        return actor


def frame_of(text: str) -> AnyArray:
    """Return the frame [1, 256, 256, 3] in base64.

    Raises:
        RequestError: if it is no base64, of another size, black, or has red and blue exchanged.
    """
    try:
        data = base64.b64decode(text, validate=True)
    except ValueError:
        raise RequestError("observation is not base64: encode the frame's raw bytes.") from None
    size = math.prod(FRAME_SHAPE)
    if len(data) != size:
        raise RequestError(
            f"observation has {len(data)} bytes, expected {size}: 256 rows of 256 pixels of red, green, blue."
        )
    frames = np.frombuffer(data, dtype=np.uint8).reshape(1, *FRAME_SHAPE)
    try:
        check_frames(frames)
        check_colour_order(frames)
    except FrameError as error:
        raise RequestError(f"observation: {error}.") from None
    return frames


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
    values = arguments[pairs.columns(arm, index)]
    return SkillCall(
        skill=pairs.skills[index].name,
        arguments={
            argument.name: ArgumentValue(value=float(value), unit=argument.unit)
            for argument, value in zip(pairs.skill_arguments[index], values, strict=True)
        },
    )
