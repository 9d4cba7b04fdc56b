"""Whether a task of a user's own is fit for a run: its members are used once, before anything is made.

Nothing here needs the simulator: whether a scene compiles is tested where that is, see `scene_model`.
"""

import xml.etree.ElementTree as ET
from collections.abc import Sequence
from typing import Any, NoReturn

import numpy as np

from taskschema.errors import TaskFileError
from taskschema.observation import ObservationLayout
from taskschema.scene import scene_mjcf
from taskschema.skills.skill import Skill
from taskschema.tasks.registry import get_task, task_names
from taskschema.tasks.scene_observation import observe
from taskschema.tasks.scene_task import ObjectInstance, SceneTask
from taskschema.tasks.task import BatchEnvironment, StepResult, Task
from taskschema.tasks.user_code import user_code

EPISODES = 2
"""That are tried."""
MOMENTS = 3
"""Of the motions that the goal is tested on."""
OBJECT_SECTIONS = ("option", "default", "asset", "worldbody")
"""Of MJCF, that an object may have."""


@np.errstate(all="ignore")
def check_task(task: Task, file: str, *, runs_here: bool) -> None:
    """Refuse a task that could not be trained.

    Args:
        task: of a user's own.
        file: name that its file was compiled under.
        runs_here: whether an environment without simulator is tried, too: elsewhere episodes may need what
            is not installed here.

    Raises:
        TaskFileError: that says which member is wrong, and what it must be.
    """
    check = _Check(task, file)
    _check_skills(check)
    _check_words(check)
    if isinstance(task, SceneTask):
        _check_object(check, task)
    _check_observation(check)
    if isinstance(task, SceneTask):
        _check_goal(check, task)
    elif runs_here:
        _check_environment(check)


@np.errstate(all="ignore")
def check_expert(task: SceneTask, file: str) -> None:
    """Refuse a task whose scripted expert could not be run; `check_task` comes first.

    Raises:
        TaskFileError: that says what is wrong.
    """
    check = _Check(task, file)
    if type(task).expert_arguments is Task.expert_arguments:
        check.refuse("the task has no expert_arguments: they solve it where it is audited or shown")
    instances = _drawn_instances(check, task)
    count = len(instances)
    for step in range(len(task.paper_schema)):
        observations = observe(
            task.geometry,
            np.repeat(task.home_joints[None], count, axis=0),
            np.zeros((count, *task.home_joints.shape)),
            np.stack([instance.pose for instance in instances]),
            np.array([instance.scale for instance in instances])[:, None] * task.object_size,
            np.full(count, step),
        )
        arguments = check.result(task, "expert_arguments", observations, step)
        check.array("what expert_arguments returns", arguments, (count, task.pairs.argument_count))


class _Check:
    """Uses a task's members; what they raise, or return that does not fit, is a `TaskFileError`."""

    def __init__(self, task: Task, file: str) -> None:
        self.task = task
        self.file = file

    def value(self, member: str) -> Any:  # noqa: ANN401
        """Return what a member of the task is."""
        with user_code(self.file, member):
            return getattr(self.task, member)

    def result(self, owner: object, method: str, *arguments: object) -> Any:  # noqa: ANN401
        """Return what a method of the task, or of something of its, returns."""
        with user_code(self.file, method):
            return getattr(owner, method)(*arguments)

    def require(self, fits: bool, member: str, need: str, got: object) -> None:
        """Refuse what does not fit.

        Raises:
            TaskFileError: that names the member, what it must be, and what it is.
        """
        if not fits:
            self.refuse(f"{member} must be {need}, but is {_shown(got)}")

    def refuse(self, reason: str) -> NoReturn:
        """Refuse the task.

        Raises:
            TaskFileError: that says in which file, and why.
        """
        raise TaskFileError(f"{self.file}: {reason}.")

    def numbers(self, member: str, values: object, count: int | None, above: float = -np.inf) -> None:
        """Require `count` finite numbers or, if None, a single one, all of them above a bound."""
        need = "a finite number" if count is None else f"{count} finite numbers"
        if np.isfinite(above):
            need += f" above {above:g}"
        fits = _is_numeric(values, () if count is None else (count,), "fiu")
        self.require(fits and bool((np.asarray(values) > above).all()), member, need, values)

    def array(self, member: str, values: object, shape: tuple[int, ...], kinds: str = "fiu") -> None:
        """Require an array of finite numbers or, with the kinds "b", of booleans."""
        need = f"an array {list(shape)} of {'booleans' if kinds == 'b' else 'finite numbers'}"
        self.require(
            isinstance(values, np.ndarray) and _is_numeric(values, shape, kinds), member, need, values
        )


def _is_numeric(values: object, shape: tuple[int, ...], kinds: str) -> bool:
    """Return whether something is finite numbers of this shape, and of these of numpy's kinds."""
    try:
        array = np.asarray(values)
    except ValueError:  # rows of different lengths
        return False
    return array.shape == shape and array.dtype.kind in kinds and bool(np.isfinite(array).all())


def _shown(value: object) -> str:
    """Return what something is, in few words on one line."""
    if not isinstance(value, np.ndarray) or value.ndim == 0:
        return f"{' '.join(repr(value).split()):.100}"
    is_finite = value.dtype.kind not in "f" or bool(np.isfinite(value).all())
    return f"an array {list(value.shape)} of {value.dtype}{'' if is_finite else ', not all of them finite'}"


def _check_skills(check: _Check) -> None:
    """Check horizon, skills and the paper's schema."""
    task, horizon = check.task, check.value("horizon")
    check.require(type(horizon) is int and horizon >= 1, "horizon", "a whole number from 1", horizon)
    names = [skill.name for skill in task.pairs.skills]
    check.require(len(set(names)) == len(names), "pairs", "of skills with different names", names)
    for skill in task.pairs.skills:
        if isinstance(task, SceneTask) and type(skill).plan is Skill.plan:
            check.refuse(f"skill {skill.name!r} has no plan(), by which arms move in a task with physics")
    schema = check.value("paper_schema")
    pairs = schema if isinstance(schema, tuple) else ()
    is_schema = all(isinstance(pair, tuple) and len(pair) == 2 for pair in pairs)
    need = f"a tuple of 1 to {horizon} pairs (left, right) of skill names, one for each step"
    check.require(is_schema and 1 <= len(pairs) <= horizon, "paper_schema", need, schema)
    for pair in pairs:
        for name in pair:
            check.require(name in names, "paper_schema", f"of the skills {', '.join(names)}", name)


def _check_words(check: _Check) -> None:
    """Check what the task is called; a shipped task's name stands for its schemas, too."""
    task = check.task
    for member in ("name", "family", "summary"):
        words = check.value(member)
        check.require(isinstance(words, str) and bool(words.strip()), member, "words", words)
    check.require("/" not in task.name, "name", "without a slash: files are called by it", task.name)
    if task.name in task_names():
        shipped = get_task(task.name)
        is_alike = shipped.pairs.pairs == task.pairs.pairs and shipped.paper_schema == task.paper_schema
        need = "one of its own: a shipped task with other skills or another paper_schema has this one"
        check.require(is_alike, "name", need, task.name)


def _check_observation(check: _Check) -> None:
    """Check the fields, and that they can be scaled for a network."""
    layout = check.value("observation")
    fits = isinstance(layout, ObservationLayout) and len(layout.fields) > 0
    check.require(fits, "observation", "an ObservationLayout with fields", layout)
    for field in layout.fields:
        what = f"of the observation's field {field.name!r}"
        check.require(
            type(field.size) is int and field.size >= 1, f"size {what}", "a whole number from 1", field.size
        )
        for kind, values, above in (("center", field.center, -np.inf), ("scale", field.scale, 0.0)):
            count = None if np.ndim(values) == 0 else field.size
            check.numbers(f"{kind} {what}", values, count, above)


def _check_object(check: _Check, task: SceneTask) -> None:
    """Check the object's size and model, as far as that is text."""
    check.numbers("object_size", check.value("object_size"), 3, above=0.0)
    for member in ("top_grasp_height", "side_grasp_height", "pose_height"):
        check.numbers(member, check.value(member), None)
    check.numbers("lift_speed", check.value("lift_speed"), None, above=0.0)
    joints = check.value("object_joints")
    are_names = isinstance(joints, tuple) and all(isinstance(name, str) for name in joints)
    check.require(are_names, "object_joints", "a tuple of names", joints)
    text = check.value("object_mjcf")
    check.require(isinstance(text, str), "object_mjcf", "text", text)
    with user_code(check.file):
        scene_mjcf(task)
    for section in ET.fromstring(text.strip()):
        need = f"of {', '.join(OBJECT_SECTIONS)} alone: the scene has its own of all else, angles in radians"
        check.require(section.tag in OBJECT_SECTIONS, "object_mjcf", need, section.tag)


def _check_goal(check: _Check, task: SceneTask) -> None:
    """Check that what is drawn are objects, and the goal on motions of theirs that lead nowhere."""
    start = np.stack([instance.pose for instance in _drawn_instances(check, task)])
    poses = np.repeat(start[:, None], MOMENTS, axis=1)
    for method, kinds in (("goal_reached", "b"), ("goal_distance", "fiu")):
        check.array(
            f"what {method} returns", check.result(task, method, start, poses), poses.shape[:2], kinds
        )


def _drawn_instances(check: _Check, task: SceneTask) -> list[ObjectInstance]:
    """Return some objects, and one of each corner of the randomisation."""
    draws = np.random.default_rng(0)
    names = check.value("corner_names")
    fits = isinstance(names, Sequence) and all(isinstance(name, str) for name in names)
    check.require(fits and not isinstance(names, str), "corner_names", "a list of names", names)
    instances = [check.result(task, "draw_instance", draws) for _ in range(EPISODES)]
    corners = [check.result(task, "draw_corner", corner, draws) for corner in range(len(names))]
    for instance in instances:
        _check_instance(check, "draw_instance", instance)
    for instance in corners:
        _check_instance(check, "draw_corner", instance)
    return instances + corners


def _check_instance(check: _Check, method: str, instance: object) -> None:
    if not isinstance(instance, ObjectInstance):
        check.refuse(f"what {method} returns must be an ObjectInstance, but is {_shown(instance)}")
    check.numbers(f"position from {method}", instance.position, 3)
    check.numbers(f"quaternion from {method}", instance.quaternion, 4)
    length = float(np.linalg.norm(instance.quaternion))
    check.require(
        abs(length - 1.0) < 0.01, f"quaternion from {method}", "of length 1 (w x y z)", instance.quaternion
    )
    check.numbers(f"density from {method}", instance.density, None, above=0.0)
    check.numbers(f"scale from {method}", instance.scale, None, above=0.0)
    if instance.friction is not None:
        check.numbers(f"friction from {method}", instance.friction, None)
    joints = check.value("object_joints")
    check.numbers(f"joints from {method}", instance.joints, len(joints))


def _check_environment(check: _Check) -> None:
    """Check the environment of a task without simulator: some episodes under the paper's schema."""
    task = check.task
    if type(task).make_environment is Task.make_environment:
        check.refuse("the task has no make_environment: define it, or derive the task from SceneTask")
    environment = check.result(task, "make_environment", 1)
    observations = check.result(environment, "reset", [np.random.default_rng(n) for n in range(EPISODES)])
    check.array("what reset returns", observations, (EPISODES, task.observation.size))
    _check_steps(check, environment)
    check.result(environment, "close")


def _check_steps(check: _Check, environment: BatchEnvironment) -> None:
    """Run the paper's schema, all arguments in the middle of their search spaces."""
    task, live = check.task, np.arange(EPISODES)
    middle = np.zeros(task.pairs.argument_count)
    for pair in task.paper_pairs:
        count = len(live)
        arguments = np.repeat(task.pairs.to_si(middle)[None], count, axis=0)
        result = check.result(environment, "step", live, np.full(count, pair), arguments)
        if not isinstance(result, StepResult):
            check.refuse(f"what step returns must be a StepResult, but is {_shown(result)}")
        check.array("success from step", result.success, (count,), "b")
        check.array("diverged from step", result.diverged, (count,), "b")
        check.array("physics_steps from step", result.physics_steps, (count,), "iu")
        over, shape = result.success | result.diverged, (count, task.observation.size)
        fits = np.shape(result.observations) == shape
        check.require(fits, "observations from step", f"an array {list(shape)}", result.observations)
        live = live[~over]
        if not len(live):
            break
        seen = result.observations[~over]  # what an episode that is over sees is arbitrary
        check.array("observations from step", seen, (len(live), shape[1]))
