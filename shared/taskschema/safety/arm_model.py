"""The collision model: both arms as capsules, a table, and a box in each hand for what it holds."""

from dataclasses import dataclass
from importlib import resources

import mujoco
import numpy as np

from taskschema.arrays import FloatArray, IntArray
from taskschema.kinematics.rotation import matrix_to_quaternion
from taskschema.kinematics.sawyer import sawyer_pair
from taskschema.safety.motion import HeldObject
from taskschema.skills.pairs import ARMS

JOINTS = 7
TABLE_SIZE = (2.0, 2.0, 0.2)
"""Half edge lengths of the box below z = 0 [m]: larger than any table, so that nothing reaches below one."""
LINKS = (
    "base_0",
    "right_l1_0",
    "right_l2_0",
    "right_l3_0",
    "right_l4_0",
    "right_l5_0",
    "right_l6_0",
    "gripper_base_0",
    "l_finger_pad",
    "r_finger_pad",
)
"""The shapes of one arm from its base to its fingers, as `sawyer.xml` names them."""
FINGERS = LINKS[8:]
HAND = LINKS[6:]
"""What may touch an object that the other hand holds: two-armed tasks are about that."""
NEIGHBOURS = 3
"""Shapes of one arm that are fewer places apart always touch, or move as one with their neighbours."""
NOTHING = 1e-3
"""Half edge length of the box in an empty hand [m]; no pair with it is tested."""


@dataclass(frozen=True)
class Shape:
    """One shape of the model."""

    arm: int | None
    """0 left, 1 right; None: the table."""
    link: str
    """Its name within its arm, `held` for what the hand holds, or `table`."""

    @property
    def name(self) -> str:
        """Its name for a person."""
        return self.link if self.arm is None else f"{ARMS[self.arm]} {self.link}"


class ArmModel:
    """Positions and distances of all shapes, in any configuration of both arms; fingers are wide open."""

    def __init__(self) -> None:
        self._model = _compile()
        self._data = mujoco.MjData(self._model)
        model = self._model
        names = [[f"{arm}_right_j{joint}" for joint in range(JOINTS)] for arm in ARMS]
        self._joints: IntArray = np.array([[model.joint(name).qposadr[0] for name in row] for row in names])
        for arm in ARMS:
            for finger, side in (("l", 1), ("r", 0)):
                joint = model.joint(f"{arm}_{finger}_finger_joint")
                self._data.qpos[joint.qposadr[0]] = model.jnt_range[joint.id][side]
        self.shapes: tuple[Shape, ...] = tuple(_shape(model.geom(i).name) for i in range(model.ngeom))
        """In the order of the model."""
        self._index = {(shape.arm, shape.link): i for i, shape in enumerate(self.shapes)}
        self.radii: FloatArray = np.array(model.geom_rbound, dtype=np.float64)
        """[G] of the sphere around each shape's centre [m]."""
        self._capsule = np.array(model.geom_type == mujoco.mjtGeom.mjGEOM_CAPSULE)
        self._half: FloatArray = np.array(model.geom_size, dtype=np.float64)
        self._full = [False, False]

    def index(self, arm: int | None, link: str) -> int:
        """Return where a shape stands in `shapes`."""
        return self._index[arm, link]

    def hold(self, arm: int, held: HeldObject | None, inflation: float) -> None:
        """Put an inflated box into a hand, or take it out."""
        if held is None and not self._full[arm]:
            return
        self._full[arm] = held is not None
        geom = self.index(arm, "held")
        half = np.full(3, NOTHING) if held is None else 0.5 * held.size + inflation
        position, rotation = (np.zeros(3), np.eye(3)) if held is None else (held.position, held.rotation)
        site = self._model.site(f"{ARMS[arm]}_grip")
        frame = np.empty(9)
        mujoco.mju_quat2Mat(frame, site.quat)
        grip = frame.reshape(3, 3)
        self._model.geom_size[geom] = half
        self._model.geom_pos[geom] = site.pos + grip @ position
        self._model.geom_quat[geom] = matrix_to_quaternion(grip @ rotation)
        self._model.geom_sameframe[geom] = mujoco.mjtSameFrame.mjSAMEFRAME_NONE  # or its pose is not read
        self._model.geom_rbound[geom] = self.radii[geom] = np.sqrt((half * half).sum())
        self._half[geom] = half

    def place(self, joints: FloatArray) -> None:
        """Put both arms at joint angles [2, 7]."""
        self._data.qpos[self._joints] = joints
        mujoco.mj_kinematics(self._model, self._data)

    def poses(self, joints: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return, for configurations [2, S, 7], every shape's centre [S, G, 3] and frame [S, G, 3, 3]."""
        count = joints.shape[1]
        centres = np.empty((count, len(self.shapes), 3))
        frames = np.empty((count, len(self.shapes), 3, 3))
        for step in range(count):
            self.place(joints[:, step])
            centres[step] = self._data.geom_xpos
            frames[step] = self._data.geom_xmat.reshape(-1, 3, 3)
        return centres, frames

    def extents(self, frames: FloatArray) -> FloatArray:
        """Return half the size [S, G, 3] of each shape's bounding box along the world's axes [m]."""
        along = np.abs(frames[..., 2]) * self._half[None, :, 1, None] + self._half[None, :, 0, None]
        box = (np.abs(frames) * self._half[None, :, None, :]).sum(axis=3)
        return np.where(self._capsule[None, :, None], along, box)

    def travel(self, centres: FloatArray, frames: FloatArray) -> FloatArray:
        """Return the most that a point of any shape moves between neighbouring configurations [S - 1] [m]."""
        arms = np.where(self._capsule[:, None], self._half[:, [1]] * np.array([0.0, 0.0, 1.0]), self._half)
        shift = np.diff(centres, axis=0)
        turn = np.diff(frames, axis=0)
        turned = np.sqrt((turn * turn).sum(axis=2)) * arms[None]
        moved = np.sqrt((shift * shift).sum(axis=2)) + turned.sum(axis=2)
        return np.asarray(moved.max(axis=1, initial=0.0))

    def capsule(self, index: int) -> tuple[float, float]:
        """Return a shape's half length and radius [m]; a box counts as its largest and smallest half edge."""
        half = self._half[index]
        if self._capsule[index]:
            return float(half[1]), float(half[0])
        return float(half.max()), float(half.min())

    def distance(self, first: int, second: int, most: float) -> float:
        """Return the distance between two shapes as placed [m], negative inside; `most` if larger."""
        return float(mujoco.mj_geomDistance(self._model, self._data, first, second, most, None))


def _compile() -> mujoco.MjModel:
    spec = mujoco.MjSpec()
    path = resources.files("taskschema") / "data" / "sawyer.xml"
    for arm, kinematics in zip(ARMS, sawyer_pair(), strict=True):
        child = mujoco.MjSpec.from_string(path.read_text())
        hand = child.body("gripper_base")
        hand.add_geom(name="held", type=mujoco.mjtGeom.mjGEOM_BOX, size=[NOTHING] * 3, mass=0)
        frame = spec.worldbody.add_frame(
            pos=kinematics.base_position, quat=matrix_to_quaternion(kinematics.base_rotation)
        )
        spec.attach(child, prefix=f"{arm}_", frame=frame)
    depth = TABLE_SIZE[2]
    spec.worldbody.add_geom(
        name="table", type=mujoco.mjtGeom.mjGEOM_BOX, size=list(TABLE_SIZE), pos=[0, 0, -depth]
    )
    return spec.compile()


def _shape(name: str) -> Shape:
    if name == "table":
        return Shape(None, name)
    arm, _, link = name.partition("_")
    return Shape(ARMS.index(arm), link)
