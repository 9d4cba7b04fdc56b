"""The environment of tasks with a scene: skills planned once per step for a whole batch, physics in C."""

from collections.abc import Sequence

import mujoco
import numpy as np

from taskschema.arrays import BoolArray, FloatArray, IntArray
from taskschema.kinematics.sawyer import rethink_gripper, sawyers
from taskschema.motion import PlanningContext
from taskschema.tasks.scene_observation import observe
from taskschema.tasks.scene_task import ObjectInstance, SceneTask
from taskschema.tasks.task import StepResult
from taskschema_worker.mixed_path import MixedPath
from taskschema_worker.plan_gate import ROBOT_OPENING, PlanGate, StepStart
from taskschema_worker.simulation import Simulation

CHUNK_SECONDS = 0.064
"""Simulated time between two tests of the goal [s]: an episode that has reached it goes no further."""
STRETCH_CHUNKS = 8
"""Set-points are sampled for so many chunks at once: those of a whole step take 55 MB for 100 episodes."""


class SceneEnvironment:
    """N episodes of a scene task; see `BatchEnvironment`.

    Args:
        task: see `Simulation`.
        threads: the same.
        model: the same.
        gate: steps are made as the robot's agent makes them: what this refuses is not made, the arms stay
            and the step counts; hands open as far as the robot's; and the goal is tested where a step ends.
            None: all steps are made, and the goal is tested as the task says (`goal_in_passing`).

    """

    def __init__(
        self,
        task: SceneTask,
        threads: int = 1,
        model: mujoco.MjModel | None = None,
        gate: PlanGate | None = None,
    ) -> None:
        self._task = task
        self._gate = gate
        self._in_passing = task.goal_in_passing and gate is None
        self._simulation = Simulation(task, threads, model, None if gate is None else ROBOT_OPENING)
        self._chunk = round(CHUNK_SECONDS / self._simulation.timestep)
        self.measure_distance = False
        """Whether to keep each episode's smallest `goal_distance` in `closest`: for an audit's searches."""
        self.closest: FloatArray = np.empty(0)
        """[N] smallest distance from the goal so far, if `measure_distance`."""

    @property
    def timestep(self) -> float:
        """Physics step [s]."""
        return self._simulation.timestep

    def reset(self, generators: Sequence[np.random.Generator]) -> FloatArray:
        """Start one episode per generator; see `BatchEnvironment`."""
        return self.reset_to([self._task.draw_instance(generator) for generator in generators])

    def reset_to(self, instances: Sequence[ObjectInstance]) -> FloatArray:
        """Start one episode per given object instance and return observations [N, D]."""
        count = len(instances)
        self._simulation.reset(instances)
        self._sizes = np.array([instance.scale for instance in instances])[:, None] * self._task.object_size
        self._start = self._simulation.object_poses(np.arange(count))
        self._opening = np.full((count, 2), rethink_gripper().open)
        self._pressing = np.zeros((count, 2), dtype=bool)
        self._set_points = self._simulation.arm_joints(np.arange(count))
        self._time = np.zeros(count, dtype=np.int64)
        self.closest = np.full(count, np.inf)
        return self._observe(np.arange(count))

    def step(self, episodes: IntArray, pairs: IntArray, arguments: FloatArray) -> StepResult:
        """Run one step of the episodes [M]; see `BatchEnvironment`."""
        paths = self.plan(episodes, pairs, arguments)
        refused = self._refused(episodes, pairs, arguments, paths)
        success, diverged, steps = self._execute(episodes, paths, refused)
        made = episodes[~refused]
        self._opening[made] = paths.final_opening.reshape(2, -1).T[~refused]
        ends = np.swapaxes(paths.final_joints.reshape(2, len(episodes), -1), 0, 1)
        self._set_points[made] = ends[~refused]
        self._note_pressing(made, pairs[~refused])
        self._time[episodes] += 1
        return StepResult(self._observe(episodes), success, diverged, steps, refused)

    def _refused(
        self, episodes: IntArray, pairs: IntArray, arguments: FloatArray, paths: MixedPath
    ) -> BoolArray:
        """Return which of the planned steps the gate refuses [M]."""
        if self._gate is None:
            return np.zeros(len(episodes), dtype=bool)
        simulation = self._simulation
        start = StepStart(
            joints=simulation.arm_joints(episodes),
            set_points=self._set_points[episodes],
            opening=simulation.openings(episodes),
            told=self._opening[episodes],
            poses=simulation.object_poses(episodes),
            sizes=self._sizes[episodes],
        )
        return self._gate.refused(start, pairs, arguments, paths)

    def plan(self, episodes: IntArray, pairs: IntArray, arguments: FloatArray) -> MixedPath:
        """Plan the motions of M episodes: paths for the M left arms, then for the M right ones.

        What runs the same skill is planned together, whichever arm it is.
        """
        space, count = self._task.pairs, len(episodes)
        sides, rows_episodes = np.repeat((0, 1), count), np.tile(episodes, 2)
        arm_of = (rows_episodes, sides)
        measured = np.concatenate(list(np.swapaxes(self._simulation.arm_joints(episodes), 0, 1)))
        joints = np.where(self._pressing[arm_of][:, None], self._set_points[arm_of], measured)
        poses = np.tile(self._simulation.object_poses(episodes), (2, 1))
        sizes = self._sizes[rows_episodes]
        chosen = np.concatenate([space.skill_index(pairs, arm) for arm in (0, 1)])
        mixed = MixedPath(2 * count)
        for index, skill in enumerate(space.skills):
            rows = np.flatnonzero(chosen == index)
            if not len(rows):
                continue
            own = (rows_episodes[rows], sides[rows])
            context = PlanningContext(
                arm=sawyers(sides[rows]),
                gripper=rethink_gripper(),
                joints=joints[rows],
                opening=self._opening[own],
                object_position=poses[rows, :3],
                object_quaternion=poses[rows, 3:7],
                object_size=sizes[rows],
                top_grasp_offset=self._task.top_grasp_height * sizes[rows, 2],
                side_grasp_offset=self._task.side_grasp_height * sizes[rows, 2],
                lift_speed=self._task.lift_speed,
            )
            left = np.searchsorted(rows, count)
            own_arguments = [
                arguments[rows[:left], space.columns(0, index)],
                arguments[rows[left:] - count, space.columns(1, index)],
            ]
            mixed.add(rows, skill.plan(context, np.concatenate(own_arguments)))
        return mixed

    def _note_pressing(self, episodes: IntArray, pairs: IntArray) -> None:
        """Note which arms may end the step pressing on something."""
        space = self._task.pairs
        for arm in (0, 1):
            chosen = space.skill_index(pairs, arm)
            for index, skill in enumerate(space.skills):
                if skill.ends_pressing is not None:
                    self._pressing[episodes[chosen == index], arm] = skill.ends_pressing

    def _execute(
        self, episodes: IntArray, paths: MixedPath, refused: BoolArray
    ) -> tuple[BoolArray, BoolArray, IntArray]:
        """Run both arms' paths, in chunks; return success, divergence and physics steps [M].

        No time passes for episodes whose step is refused.
        """
        size, timestep = self._chunk, self._simulation.timestep
        duration = paths.duration.reshape(2, -1).max(axis=0)
        chunks = np.where(refused, 0, np.ceil(duration / (size * timestep) - 1e-9)).astype(np.int64)
        success = np.zeros(len(episodes), dtype=bool)
        diverged = np.zeros(len(episodes), dtype=bool)
        steps = np.zeros(len(episodes), dtype=np.int64)
        place = np.empty(len(episodes), dtype=np.int64)
        for chunk in range(chunks.max(initial=0)):
            rows = np.flatnonzero((chunks > chunk) & ~success & ~diverged)
            if not len(rows):
                break
            if chunk % STRETCH_CHUNKS == 0:
                stretch = min(STRETCH_CHUNKS, chunks.max() - chunk) * size
                controls = self._controls(paths, rows, chunk * size, stretch)
                place[rows] = np.arange(len(rows))
            first = chunk % STRETCH_CHUNKS * size
            part = controls[place[rows], first : first + size]
            advance = self._simulation.advance(episodes[rows], part)
            if self._in_passing:
                reached = self._task.goal_reached(self._start[episodes[rows]], advance.object_poses)
                success[rows] = reached.any(axis=1) & ~advance.diverged
                self._note_distance(episodes[rows], advance.object_poses)
            diverged[rows] = advance.diverged
            steps[rows] += size
        if not self._in_passing:
            ends = self._simulation.object_poses(episodes)[:, None]
            success = self._task.goal_reached(self._start[episodes], ends)[:, 0] & ~diverged
            self._note_distance(episodes, ends)
        return success, diverged, steps

    def _note_distance(self, episodes: IntArray, poses: FloatArray) -> None:
        """Note how near to the goal K episodes came, where it is tested: poses [K, S, 7 + h]."""
        if self.measure_distance:
            distance = self._task.goal_distance(self._start[episodes], poses).min(axis=1)
            self.closest[episodes] = np.minimum(self.closest[episodes], distance)

    def _controls(self, paths: MixedPath, rows: IntArray, first: int, steps: int) -> FloatArray:
        """Return the simulator's controls [K, S, nu] for S physics steps of K episodes' paths."""
        number: FloatArray = np.arange(first, first + steps, dtype=np.float64) + 1
        arms = np.concatenate([rows, rows + len(paths.duration) // 2])
        joints, velocities, opening = paths.sample(number * self._simulation.timestep, arms)
        count = len(rows)
        controls = np.empty((count, steps, self._simulation.control_count))
        for arm, half in enumerate((slice(None, count), slice(count, None))):
            self._simulation.controls(arm, joints[half], velocities[half], opening[half], out=controls)
        return controls

    def _observe(self, episodes: IntArray) -> FloatArray:
        simulation = self._simulation
        return observe(
            self._task.geometry,
            simulation.arm_joints(episodes),
            simulation.arm_velocities(episodes),
            simulation.object_poses(episodes),
            self._sizes[episodes],
            self._time[episodes],
        )

    def close(self) -> None:
        """Stop the simulation's threads."""
        self._simulation.close()
