"""Row 3: cost of a physics step, physics steps a skill, and the limits that motions keep."""

import time
from collections.abc import Iterator
from dataclasses import dataclass

import mujoco.rollout
import numpy as np

from bench.entry import Entry
from bench.service_process import TASK
from taskschema.arrays import FloatArray
from taskschema.kinematics.sawyer import rethink_gripper, sawyer
from taskschema.motion import ArmPath
from taskschema.skills.pairs import ARMS
from taskschema.tasks.registry import get_task, task_names
from taskschema.tasks.scene_task import SceneTask
from taskschema_worker.mixed_path import MixedPath
from taskschema_worker.scene_environment import SceneEnvironment

EPISODES = 64
STEPS = 400
"""Physics steps an episode and a repeat."""
LIFTED = 0.2
"""[m] how high the object is held: below the goal."""
SAMPLE_SECONDS = 1e-3
"""Spacing at which planned motions are compared with the limits [s]."""


@dataclass(frozen=True)
class Motions:
    """What both arms did, running one skill in many episodes with random arguments."""

    skill: str
    timestep: float
    """[s]"""
    steps: FloatArray
    """[N] physics steps."""
    speed: float
    """Largest share of the velocity limits that the set-points take."""
    acceleration: float
    """The same of the acceleration limits."""


def measure(repeats: int, episodes: int = EPISODES) -> list[Entry]:
    task = get_task(TASK)
    assert isinstance(task, SceneTask)
    environment = SceneEnvironment(task)
    rest, grasp = _at_rest(environment, episodes), _in_grasp(environment, task, episodes)
    costs: dict[str, list[float]] = {"at rest": [], "in a two-handed grasp, object in the air": []}
    for _ in range(repeats):
        for name, (state, controls) in zip(costs, (rest, grasp), strict=True):
            costs[name].append(_microseconds(environment, state, controls))
    targets = dict(zip(costs, (30.0, 55.0), strict=True))
    entries = [
        Entry.of(3, f"a whole physics step {name}", samples, "us", targets[name], "lower")
        for name, samples in costs.items()
    ]
    environment.close()
    scenes = [task for task in map(get_task, task_names()) if isinstance(task, SceneTask)]
    motions = {task.name: list(random_motions(task, episodes)) for task in scenes}
    entries += _steps_per_skill(motions)
    entries += _shares_of_limits([each for of_task in motions.values() for each in of_task])
    return entries


Still = tuple[FloatArray, FloatArray]
"""Full states [N, 1 + nq + nv] and the controls [N, nu] that hold them."""


def _at_rest(environment: SceneEnvironment, episodes: int) -> Still:
    _reset(environment, episodes)
    return _held(environment, rethink_gripper().open)


def _in_grasp(environment: SceneEnvironment, task: SceneTask, episodes: int) -> Still:
    """Let the expert grasp the object with both hands and lift it, not as high as the goal."""
    observations = _reset(environment, episodes)
    for step, (left, right) in enumerate(task.paper_schema):
        arguments = task.expert_arguments(observations, step)
        for column, name in enumerate(task.pairs.argument_names):
            if name.endswith("lift.distance"):
                arguments[:, column] = LIFTED
        pairs = np.full(episodes, task.pairs.index(left, right))
        observations = environment.step(np.arange(episodes), pairs, arguments).observations
    height = environment._simulation.positions[:, environment._simulation.indices.object_pose][:, 2]
    if np.median(height) < 0.75 * LIFTED:
        raise RuntimeError("The expert did not lift the object: this is no grasp.")
    return _held(environment, rethink_gripper().closed)


def _reset(environment: SceneEnvironment, episodes: int) -> FloatArray:
    return environment.reset([np.random.default_rng(index) for index in range(episodes)])


def _held(environment: SceneEnvironment, opening: float) -> Still:
    simulation = environment._simulation
    count = len(simulation.positions)
    state = np.concatenate([np.zeros((count, 1)), simulation.positions, simulation.velocities], axis=1)
    controls = np.zeros((count, 1, simulation.control_count))
    joints = simulation.arm_joints(np.arange(count))
    for arm in range(len(ARMS)):
        set_points = joints[:, None, arm]
        simulation.controls(
            arm, set_points, np.zeros_like(set_points), np.full((count, 1), opening), out=controls
        )
    return state, controls[:, 0]


def _microseconds(environment: SceneEnvironment, state: FloatArray, controls: FloatArray) -> float:
    """Return the processor time of one step [us]; it all runs in this thread."""
    simulation = environment._simulation
    held = np.repeat(controls[:, None], STEPS, axis=1)
    states = np.empty((len(state), STEPS, state.shape[1]))
    rollout = mujoco.rollout.Rollout(nthread=0)
    started = time.thread_time()
    rollout.rollout(
        simulation._models[: len(state)],
        simulation._data,
        state,
        held,
        control_spec=simulation._spec,
        skip_checks=True,
        nstep=STEPS,
        state=states,
    )
    return 1e6 * (time.thread_time() - started) / (len(state) * STEPS)


def random_motions(task: SceneTask, episodes: int) -> Iterator[Motions]:
    """Run each skill that moves with random arguments in both arms, where the paper's schema has it first."""
    environment, space, rng = SceneEnvironment(task), task.pairs, np.random.default_rng(0)
    rows = np.arange(episodes)
    for skill in space.skills:
        if skill.name == "no_op":
            continue
        observations = _reset(environment, episodes)
        first = next(step for step, pair in enumerate(task.paper_schema) if skill.name in pair)
        for step, pair in enumerate(task.paper_pairs[:first]):
            arguments = task.expert_arguments(observations, step)
            observations = environment.step(rows, np.full(episodes, pair), arguments).observations
        arguments = space.to_si(rng.uniform(-1.0, 1.0, (episodes, space.argument_count)))
        pairs = np.full(episodes, space.index(skill.name, skill.name))
        speed, acceleration = shares_of_limits(environment.plan(rows, pairs, arguments))
        steps = environment.step(rows, pairs, arguments).physics_steps
        yield Motions(skill.name, environment.timestep, steps.astype(float), speed, acceleration)
    environment.close()


def _steps_per_skill(motions: dict[str, list[Motions]]) -> list[Entry]:
    """Return the physics steps of each skill, in the first task that has it."""
    entries: dict[str, Entry] = {}
    for task, of_task in motions.items():
        for each in of_task:
            name = f"{task}: steps of {1e3 * each.timestep:g} ms of {each.skill}, mean over random arguments"
            spread = float(np.subtract(*np.percentile(each.steps, [75, 25])))
            entry = Entry(3, name, float(each.steps.mean()), "", None, "lower", spread)
            entries.setdefault(each.skill, entry)
    return list(entries.values())


def _shares_of_limits(motions: list[Motions]) -> list[Entry]:
    """Return the largest shares that any skill takes in any task; the spread is that of the skills."""
    speeds, accelerations = [each.speed for each in motions], [each.acceleration for each in motions]
    return [
        Entry(3, f"largest share of the {what} limits", max(found), "x", 1, "lower", max(found) - min(found))
        for what, found in (("velocity", speeds), ("acceleration", accelerations))
    ]


def shares_of_limits(path: ArmPath | MixedPath) -> tuple[float, float]:
    """Return the largest shares of the velocity and acceleration limits that set-points take."""
    times = np.arange(0.0, path.duration.max() + 2 * SAMPLE_SECONDS, SAMPLE_SECONDS)
    joints, velocities, _ = path.sample(times)
    # From the set-points themselves: what the path says of its own velocities is not taken on trust.
    speed = np.abs(np.diff(joints, axis=1)) / SAMPLE_SECONDS / sawyer().velocity
    acceleration = np.abs(np.diff(velocities, axis=1)) / SAMPLE_SECONDS / sawyer().acceleration
    return float(speed.max()), float(acceleration.max())
