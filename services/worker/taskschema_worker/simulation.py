"""Batched physics: many episodes of one scene, advanced in C by `mujoco.rollout`."""

import copy
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import mujoco
import mujoco.rollout
import numpy as np

from taskschema.arrays import BoolArray, FloatArray, IntArray
from taskschema.kinematics.sawyer import rethink_gripper
from taskschema.skills.pairs import ARMS
from taskschema.tasks.scene_task import ObjectInstance, SceneTask
from taskschema_worker.object_model import ObjectModel
from taskschema_worker.scenes import scene_model

ARM_JOINTS = 7
CLOSED_COMMAND = -0.1
"""Finger set-point far inside the object [m]: the finger then presses with its full force at any width."""


class SceneIndices:
    """Where both arms and the object stand in the simulator's vectors."""

    def __init__(self, model: mujoco.MjModel) -> None:
        arm_names = [[f"{arm}_right_j{joint}" for joint in range(ARM_JOINTS)] for arm in ARMS]
        finger_names = [[f"{arm}_{finger}_finger_joint" for finger in "lr"] for arm in ARMS]
        self.arm_positions = self._table(
            [[model.joint(name).qposadr[0] for name in row] for row in arm_names]
        )
        self.arm_velocities = self._table(
            [[model.joint(name).dofadr[0] for name in row] for row in arm_names]
        )
        self.arm_controls = self._table([[model.actuator(name).id for name in row] for row in arm_names])
        self.finger_positions = self._table(
            [[model.joint(name).qposadr[0] for name in row] for row in finger_names]
        )
        self.finger_controls = self._table(
            [[model.actuator(name).id for name in row] for row in finger_names]
        )
        self.object_pose = slice(int(model.joint("object").qposadr[0]), model.nq)
        """The free joint comes first, the object's own joints follow it, and nothing follows those."""

    @staticmethod
    def _table(rows: list[list[int]]) -> IntArray:
        return np.array(rows, dtype=np.int64)


@dataclass(frozen=True)
class Advance:
    """Where a stretch of physics led, for M episodes of S steps."""

    object_poses: FloatArray
    """[M, S, 7 + h]"""
    diverged: BoolArray
    """[M] whether the simulator gave up."""


class Simulation:
    """States of N episodes of one scene.

    An episode's states follow from its own object and controls alone: not from the other episodes, not from
    the number of threads.

    Args:
        task: whose arms and object are simulated.
        threads: that share the episodes.
        model: a scene compiled otherwise, such as a finer reference; None: the task's `scene_model`.
        widest: opening that the fingers are never told to exceed [m]; None: as far as the model's go.

    """

    def __init__(
        self,
        task: SceneTask,
        threads: int,
        model: mujoco.MjModel | None = None,
        widest: float | None = None,
    ) -> None:
        self._template = scene_model(task) if model is None else model
        self.timestep = float(self._template.opt.timestep)
        """[s]"""
        self.indices = SceneIndices(self._template)
        self._gripper = rethink_gripper()
        self._finger_range = self._fingers(widest)
        self._home = self._home_state(task)
        self._lag = self._servo_lag()
        self._arm_controls = [_consecutive(row) for row in self.indices.arm_controls]
        self._models: list[mujoco.MjModel] = []
        self._object = ObjectModel(self._template)
        self._data = [mujoco.MjData(self._template) for _ in range(max(threads, 1))]
        # A pool of one thread would only add switches: the calling thread does the work.
        self._rollout = mujoco.rollout.Rollout(nthread=threads if threads > 1 else 0)
        self.control_count: int = self._template.nu
        """nu"""
        self._spec = int(mujoco.mjtState.mjSTATE_CTRL.value)
        self._start(0)
        self.watcher: Callable[[IntArray, FloatArray], None] | None = None
        """Told of every stretch of motion: episodes [M] and their positions [M, S, nq]."""

    def _start(self, count: int) -> None:
        """Make room for the states of N episodes: a clock that stands at 0, positions and velocities."""
        nq, nv = self._template.nq, self._template.nv
        self._states: FloatArray = np.zeros((count, 1 + nq + nv))
        self.positions: FloatArray = self._states[:, 1 : 1 + nq]
        """[N, nq]"""
        self.velocities: FloatArray = self._states[:, 1 + nq :]
        """[N, nv]"""
        self._warmstart: FloatArray = np.zeros((count, nv))

    def _home_state(self, task: SceneTask) -> FloatArray:
        positions: FloatArray = np.array(self._template.qpos0, dtype=np.float64)
        positions[self.indices.arm_positions] = task.home_joints
        upper = self._finger_range[1]
        positions[self.indices.finger_positions] = [[upper, -upper]] * 2
        return positions

    def _fingers(self, widest: float | None) -> tuple[float, float]:
        """Return the positions of a closed finger and of one that is open as far as it is ever told [m]."""
        lower, upper = self._template.jnt_range[self._template.joint("left_l_finger_joint").id]
        if widest is not None:
            upper = min(upper, lower + 0.5 * (widest - self._gripper.closed))
        return float(lower), float(upper)

    def _servo_lag(self) -> FloatArray:
        """Return by how many seconds [7] set-points lead, against the delay of the servos' damping."""
        controls = self.indices.arm_controls[0]
        return np.array(
            -self._template.actuator_biasprm[controls, 2] / self._template.actuator_gainprm[controls, 0]
        )

    def reset(self, instances: Sequence[ObjectInstance]) -> None:
        """Start one episode per instance: arms at home with open grippers, everything at rest."""
        count = len(instances)
        while len(self._models) < count:
            self._models.append(copy.copy(self._template))
        for model, instance in zip(self._models, instances, strict=False):
            self._object.write(model, instance)
        self._start(count)
        self.positions[:] = self._home
        self.positions[:, self.indices.object_pose] = [instance.pose for instance in instances]

    def controls(
        self, arm: int, joints: FloatArray, velocities: FloatArray, opening: FloatArray, out: FloatArray
    ) -> None:
        """Write one arm's set-points [M, S, ...] into simulator controls `out` [M, S, nu]."""
        out[:, :, self._arm_controls[arm]] = joints + self._lag * velocities
        lower, upper = self._finger_range
        travel = lower + 0.5 * (opening - self._gripper.closed)
        finger = np.where(opening > self._gripper.closed, np.minimum(travel, upper), CLOSED_COMMAND)
        for control, value in zip(self.indices.finger_controls[arm], (finger, -finger), strict=True):
            out[:, :, control] = value

    def advance(self, episodes: IntArray, controls: FloatArray) -> Advance:
        """Advance the episodes [M] by the controls [M, S, nu], each from where it stands."""
        count, steps, _ = controls.shape
        nq = self._template.nq
        initial = self._states[episodes]
        states = np.empty((count, steps, initial.shape[1]))
        self._rollout.rollout(
            [self._models[episode] for episode in episodes.tolist()],
            self._data,
            initial,
            controls,
            control_spec=self._spec,
            skip_checks=True,
            nstep=steps,
            initial_warmstart=self._warmstart[episodes],
            state=states,
        )
        final, before = states[:, -1].copy(), states[:, -2] if steps > 1 else initial
        acceleration = (final[:, 1 + nq :] - before[:, 1 + nq :]) / self.timestep
        # The simulator freezes a state it cannot continue: its clock stands still.
        clock = np.abs(final[:, 0] - steps * self.timestep)
        diverged = ~((clock < 0.5 * self.timestep) & np.isfinite(final).all(axis=1))
        final[:, 0] = 0.0
        good = slice(None) if not diverged.any() else ~diverged
        self._states[episodes[good]] = final[good]
        self._warmstart[episodes[good]] = acceleration[good]
        if self.watcher is not None:
            self.watcher(episodes, states[:, :, 1 : 1 + nq])
        poses = self.indices.object_pose
        return Advance(states[:, :, 1 + poses.start : 1 + poses.stop], diverged)

    def arm_joints(self, episodes: IntArray) -> FloatArray:
        """Return measured joint angles [M, 2, 7] of both arms [rad]."""
        return self.positions[episodes][:, self.indices.arm_positions]

    def arm_velocities(self, episodes: IntArray) -> FloatArray:
        """Return measured joint velocities [M, 2, 7] of both arms [rad/s]."""
        return self.velocities[episodes][:, self.indices.arm_velocities]

    def openings(self, episodes: IntArray) -> FloatArray:
        """Return measured openings [M, 2] between the pads of both grippers [m]."""
        fingers = self.positions[episodes][:, self.indices.finger_positions]
        travel = fingers[:, :, 0] - fingers[:, :, 1] - 2.0 * self._finger_range[0]
        return np.asarray(self._gripper.closed + travel)

    def object_poses(self, episodes: IntArray) -> FloatArray:
        """Return the object's pose [M, 7 + h]."""
        return self.positions[episodes][:, self.indices.object_pose]

    def close(self) -> None:
        """Stop the threads."""
        self._rollout.close()


def _consecutive(numbers: IntArray) -> slice:
    """Return numbers that follow one another as a slice: arrays take it several times as fast."""
    first, last = int(numbers[0]), int(numbers[-1])
    assert numbers.tolist() == list(range(first, last + 1)), numbers
    return slice(first, last + 1)
