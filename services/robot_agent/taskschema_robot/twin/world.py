"""The simulated world: both arms, the object, and whatever a fault puts in the way."""

import mujoco
import numpy as np

from taskschema.arrays import AnyArray, FloatArray
from taskschema.kinematics.sawyer import GRIPPER_STROKE, rethink_gripper, sawyer_pair
from taskschema.skills.pairs import ARMS
from taskschema_robot.sawyer_interface import JOINT_NAMES
from taskschema_robot.twin.sawyer.measurement import ArmMeasurement

TIMESTEP = 0.005
"""Physics step [s]: half of the joint states' period."""
PRESSING = -0.1
"""Finger set-point far inside whatever is held [m]: the finger then presses with its full force."""
OBSTACLE = "obstacle"
OBSTACLE_AWAY = (0.0, 0.0, -3.0)
"""Where the obstacle waits [m]."""


class WorldArm:
    """Where one arm stands in the simulator's vectors.

    Args:
        model: the compiled scene.
        arm: 0 left, 1 right.
        mount: opening between the pads when the fingers' travel is 0 [m]: as they are screwed on.

    """

    def __init__(self, model: mujoco.MjModel, arm: int, mount: float) -> None:
        name = ARMS[arm]
        self.kinematics = sawyer_pair()[arm]
        self.mount = mount
        self._closed = rethink_gripper().closed
        joints = [model.joint(f"{name}_{joint}") for joint in JOINT_NAMES]
        fingers = [model.joint(f"{name}_{side}_finger_joint") for side in "lr"]
        self.positions = np.array([joint.qposadr[0] for joint in joints])
        self.dofs = np.array([joint.dofadr[0] for joint in joints])
        self.controls = np.array([model.actuator(joint.name).id for joint in joints])
        self.fingers = np.array([joint.qposadr[0] for joint in fingers])
        self.finger_controls = np.array([model.actuator(joint.name).id for joint in fingers])
        self.finger_range = (float(fingers[0].range[0]), float(fingers[0].range[1]))
        self.grip = model.site(f"{name}_grip").id
        self.lag = -model.actuator_biasprm[self.controls, 2] / model.actuator_gainprm[self.controls, 0]
        """[7] by how many seconds set-points lead, against the delay of the servos' damping."""
        body = model.geom_bodyid
        bodies = {index for index in range(model.nbody) if model.body(index).name.startswith(f"{name}_")}
        hand = model.body(f"{name}_gripper_base").id
        self.links = np.array([int(index) in bodies for index in body])
        """[ngeom] whether a shape is part of the arm."""
        self.hand = np.array([_is_below(model, int(index), hand) for index in body])
        """[ngeom] whether it is part of the hand or its fingers."""

    def travel(self, positions: AnyArray) -> float:
        """Return the fingers' travel from fully closed [m]."""
        left, right = positions[self.fingers].tolist()
        opening = self._closed + (left - right) - 2.0 * self.finger_range[0]
        return float(min(max(opening - self.mount, 0.0), GRIPPER_STROKE))


def _is_below(model: mujoco.MjModel, body: int, ancestor: int) -> bool:
    while body not in (0, ancestor):
        body = int(model.body_parentid[body])
    return body == ancestor


class World:
    """One MuJoCo world, advanced in steps of `TIMESTEP`.

    Args:
        model: of both arms and one object; see `physics_model`.
        home: [2, 7] joint angles at the start [rad].
        mount: of the fingers; see `WorldArm`.

    """

    def __init__(self, model: mujoco.MjModel, home: FloatArray, mount: float) -> None:
        self.model = model
        self.data = mujoco.MjData(model)
        self.arms = tuple(WorldArm(model, arm, mount) for arm in range(len(ARMS)))
        self._object = slice(int(model.joint("object").qposadr[0]), model.nq)
        object_body = model.body("object").id
        self._object_geoms = np.array(
            [_is_below(model, int(body), object_body) for body in model.geom_bodyid]
        )
        self._obstacle = int(model.body(OBSTACLE).mocapid[0])
        for index, (arm, joints) in enumerate(zip(self.arms, home, strict=True)):
            self.data.qpos[arm.positions] = joints
            self.set_joints(index, joints, np.zeros(len(joints)))
            self.set_fingers(index, GRIPPER_STROKE, pressing=False)
            self.data.qpos[arm.fingers] = self.data.ctrl[arm.finger_controls]
        self.place_obstacle(None)
        mujoco.mj_forward(model, self.data)

    def set_joints(self, arm: int, joints: FloatArray, velocities: FloatArray) -> None:
        """Give one arm's servos their set-point [7], [7]."""
        place = self.arms[arm]
        self.data.ctrl[place.controls] = joints + place.lag * velocities

    def set_fingers(self, arm: int, travel: float, *, pressing: bool) -> None:
        """Give one gripper its set-point: the fingers' travel from fully closed [m]."""
        place = self.arms[arm]
        lower, upper = place.finger_range
        opening = place.mount + travel
        finger = PRESSING if pressing else min(lower + 0.5 * (opening - rethink_gripper().closed), upper)
        self.data.ctrl[place.finger_controls] = finger, -finger

    def step(self) -> None:
        """Advance by one physics step."""
        mujoco.mj_step(self.model, self.data)

    @property
    def object_pose(self) -> FloatArray:
        """[7 + h] position, quaternion w x y z, and the positions of its h joints."""
        return np.array(self.data.qpos[self._object])

    def place_object(self, pose: AnyArray) -> None:
        """Put the object somewhere, at rest: [7 + h]."""
        self.data.qpos[self._object] = pose
        self.data.qvel[int(self.model.joint("object").dofadr[0]) :] = 0.0
        mujoco.mj_forward(self.model, self.data)

    def place_obstacle(self, position: AnyArray | None) -> None:
        """Put an upright bar, as thick as a person's arm, at a position [3]; None takes it away."""
        self.data.mocap_pos[self._obstacle] = OBSTACLE_AWAY if position is None else position

    def positions(self, arm: int) -> FloatArray:
        """Return measured joint angles [7] [rad]."""
        return np.array(self.data.qpos[self.arms[arm].positions])

    def measure(self, arm: int) -> ArmMeasurement:
        """Return what one robot's sensors say."""
        place, data = self.arms[arm], self.data
        tool = data.site_xpos[place.grip].copy()
        push, contact = self._contacts(place, tool)
        return ArmMeasurement(
            arm=place.kinematics,
            positions=data.qpos[place.positions],
            velocities=data.qvel[place.dofs],
            efforts=data.qfrc_actuator[place.dofs],
            tool=tool,
            tool_frame=data.site_xmat[place.grip].copy(),
            push=push,
            finger_travel=place.travel(data.qpos),
            finger_force=float(abs(data.actuator_force[place.finger_controls[0]])),
            contact_force=contact,
        )

    def _contacts(self, place: WorldArm, tool: FloatArray) -> tuple[FloatArray, float]:
        """Return the wrench [6] on the hand about the tool, in the world, and the largest collision force."""
        wrench, largest = np.zeros(6), 0.0
        if not self.data.ncon:
            return wrench, largest
        pairs = self.data.contact.geom
        of_arm = place.links[pairs]
        touching = of_arm[:, 0] != of_arm[:, 1]
        if not touching.any():
            return wrench, largest
        force = np.zeros(6)
        for index in np.flatnonzero(touching):
            mujoco.mj_contactForce(self.model, self.data, int(index), force)
            mine, other = pairs[index] if of_arm[index, 0] else pairs[index, ::-1]
            if not self._object_geoms[other]:
                largest = max(largest, float(np.linalg.norm(force[:3])))
            if place.hand[mine]:
                contact = self.data.contact[int(index)]
                # MuJoCo's contact frame points from the first shape to the second, which receives the force.
                sign = -1.0 if of_arm[index, 0] else 1.0
                push = sign * (contact.frame.reshape(3, 3).T @ force[:3])
                wrench[:3] += push
                wrench[3:] += np.cross(contact.pos - tool, push)
        return wrench, largest
