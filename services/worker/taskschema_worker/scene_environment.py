"""The environment of tasks with a scene: skills planned once per step for a whole batch, physics in C."""

from collections.abc import Sequence

import mujoco
import numpy as np

from taskschema.arrays import BoolArray, FloatArray, IntArray
from taskschema.kinematics.sawyer import rethink_gripper, sawyer_pair
from taskschema.motion import PlanningContext
from taskschema.tasks.scene_observation import observe
from taskschema.tasks.scene_task import ObjectInstance, SceneTask
from taskschema.tasks.task import StepResult
from taskschema_worker.mixed_path import MixedPath
from taskschema_worker.simulation import Simulation

CHUNK_SECONDS = 0.064
"""Simulated time between two tests of the goal [s]: an episode that has reached it goes no further."""


class SceneEnvironment:
    """N episodes of a scene task; see `BatchEnvironment`. For the arguments, see `Simulation`."""

    def __init__(self, task: SceneTask, threads: int = 1, model: mujoco.MjModel | None = None) -> None:
        self._task = task
        self._simulation = Simulation(task, threads, model)
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
        paths = [self.plan(arm, episodes, pairs, arguments) for arm in (0, 1)]
        success, diverged, steps = self._execute(episodes, paths)
        for arm, path in enumerate(paths):
            self._opening[episodes, arm] = path.final_opening
        self._time[episodes] += 1
        return StepResult(self._observe(episodes), success, diverged, steps)

    def plan(self, arm: int, episodes: IntArray, pairs: IntArray, arguments: FloatArray) -> MixedPath:
        """Plan one arm's motion for all episodes, skill by skill."""
        space = self._task.pairs
        measured = self._simulation.arm_joints(episodes)[:, arm]
        joints = np.where(self._pressing[episodes, arm, None], self._set_points[episodes, arm], measured)
        poses = self._simulation.object_poses(episodes)
        sizes = self._sizes[episodes]
        chosen = space.skill_index(pairs, arm)
        mixed = MixedPath(len(episodes))
        for index, skill in enumerate(space.skills):
            rows = np.flatnonzero(chosen == index)
            if not len(rows):
                continue
            context = PlanningContext(
                arm=sawyer_pair()[arm],
                gripper=rethink_gripper(),
                joints=joints[rows],
                opening=self._opening[episodes[rows], arm],
                object_position=poses[rows, :3],
                object_quaternion=poses[rows, 3:7],
                object_size=sizes[rows],
                top_grasp_offset=self._task.top_grasp_height * sizes[rows, 2],
                side_grasp_offset=self._task.side_grasp_height * sizes[rows, 2],
                lift_speed=self._task.lift_speed,
            )
            path = skill.plan(context, arguments[rows, space.columns(arm, index)])
            self._set_points[episodes[rows], arm] = path.joints[:, -1]
            if skill.ends_pressing is not None:
                self._pressing[episodes[rows], arm] = skill.ends_pressing
            mixed.add(rows, path)
        return mixed

    def _execute(
        self, episodes: IntArray, paths: Sequence[MixedPath]
    ) -> tuple[BoolArray, BoolArray, IntArray]:
        """Run both arms' paths, in chunks; return success, divergence and physics steps [M]."""
        size, timestep = self._chunk, self._simulation.timestep
        duration = np.maximum(paths[0].duration, paths[1].duration)
        chunks = np.ceil(duration / (size * timestep) - 1e-9).astype(np.int64)
        success = np.zeros(len(episodes), dtype=bool)
        diverged = np.zeros(len(episodes), dtype=bool)
        steps = np.zeros(len(episodes), dtype=np.int64)
        times: FloatArray = (np.arange(chunks.max(initial=0) * size, dtype=np.float64) + 1) * timestep
        controls = np.empty((len(episodes), len(times), self._simulation.control_count))
        for arm, path in enumerate(paths):
            self._simulation.controls(arm, *path.sample(times), out=controls)
        for chunk in range(chunks.max(initial=0)):
            rows = np.flatnonzero((chunks > chunk) & ~success & ~diverged)
            if not len(rows):
                break
            part = controls[rows, chunk * size : (chunk + 1) * size]
            advance = self._simulation.advance(episodes[rows], part)
            reached = self._task.goal_reached(self._start[episodes[rows]], advance.object_poses)
            if self.measure_distance:
                distance = self._task.goal_distance(self._start[episodes[rows]], advance.object_poses)
                self.closest[episodes[rows]] = np.minimum(self.closest[episodes[rows]], distance.min(axis=1))
            success[rows] = reached.any(axis=1) & ~advance.diverged
            diverged[rows] = advance.diverged
            steps[rows] += size
        return success, diverged, steps

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
