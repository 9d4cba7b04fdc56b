"""A second opinion on what the gate let through, with a model, limits and distances of its own.

What it has in common with the gate: the shapes of an arm (`sawyer.xml`), the vendor's limits and MuJoCo. The
bases, the numbers to be kept, the pairs of shapes and how they are compared are written down here again. The
gate measures distances of chosen configurations one pair after the other; here MuJoCo's own collision
detection finds everything that is near, at every set-point.
"""

from importlib import resources

import mujoco
import numpy as np

BASES = (((0.0, -0.56, 0.112), 0.5 * np.pi), ((0.0, 0.56, 0.112), -0.5 * np.pi))
"""Position [m] and turn about the vertical [rad] of the left base and of the right one."""
LOWER = -np.array([3.0503, 3.8095, 3.0426, 3.0439, 2.9761, 2.9761, 4.7124])
UPPER = np.array([3.0503, 2.2736, 3.0426, 3.0439, 2.9761, 2.9761, 4.7124])
VELOCITY = np.array([1.74, 1.328, 1.957, 1.957, 3.485, 3.485, 4.545])
ACCELERATION = np.array([10.0, 8.0, 10.0, 10.0, 12.0, 12.0, 12.0])
"""The vendor's, of the joints [rad], [rad/s], [rad/s^2]."""
MARGIN = 0.01
"""To the joints' limits [rad]."""
OPENINGS = (0.0141, 0.078766)
"""Of a gripper [m]."""
CLOSED_TRAVEL = -0.0115
"""Of a finger's joint when the gripper is closed [m]."""
WORKSPACE = np.array([[-0.9, -0.95, -0.05], [0.9, 0.95, 1.3]])
"""Every link but the base stays inside [m]."""
ARMS, TABLE, FINGERS_TABLE, SELF, HELD = 0.015, 0.01, 0.003, 0.01, 0.01
"""Kept between arms, links and table, fingers and table, links of one arm, links and what is held [m]."""
SAG = 0.03
"""How far below its lowest point at the start, or the table, what is held may get [m]."""
CHAIN = [f"right_l{number}_0" for number in range(1, 7)]
HAND = ["gripper_base_0", "l_finger_pad", "r_finger_pad"]
LINKS = ["base_0", *CHAIN, *HAND]
NEAR = 0.02
"""Whatever is nearer than this is looked at [m]."""
ROUNDING = 1e-5


class BrokenLimitError(AssertionError):
    """What reached the drivers breaks a limit."""


class SecondOpinion:
    """Judges what drivers received."""

    def __init__(self) -> None:
        self._model, self._needs = _compile()
        self._data = mujoco.MjData(self._model)
        model = self._model
        self._joints = np.array(
            [[model.joint(f"{arm}_right_j{number}").qposadr[0] for number in range(7)] for arm in "lr"]
        )
        self._fingers = np.array(
            [[model.joint(f"{arm}_{side}_finger_joint").qposadr[0] for side in "lr"] for arm in "lr"]
        )
        names = [model.geom(index).name for index in range(model.ngeom)]
        self._links = np.array([name[2:] in LINKS[1:] for name in names])
        self.least = np.inf
        """Smallest share of a distance to be kept that was left, of all that was judged."""
        self.set_points = 0

    def judge(self, joints: np.ndarray, opening: np.ndarray, held=(None, None), period: float = 0.01) -> None:
        """Set-points [2, S, 7] and openings [2, S] that both drivers received.

        Raises:
            BrokenLimitError: if one breaks a limit.

        """
        _require(np.isfinite(joints).all() and np.isfinite(opening).all(), "a number that is not finite")
        _require((joints >= LOWER + MARGIN).all() and (joints <= UPPER - MARGIN).all(), "a joint's margin")
        velocity = np.diff(joints, axis=1) / period
        _require((np.abs(velocity) <= VELOCITY * 1.001).all(), "a joint's velocity")
        rest = np.zeros((2, 1, 7))
        change = np.diff(np.concatenate([rest, velocity, rest], axis=1), axis=1) / period
        _require((np.abs(change) <= ACCELERATION * 1.01 + 1e-6).all(), "a joint's acceleration")
        low, high = OPENINGS
        _require((opening >= low - ROUNDING).all() and (opening <= high + ROUNDING).all(), "an opening")
        self._size(held)
        floor = np.full(2, -np.inf)
        for step in range(joints.shape[1]):
            # Wide open is what the gate looks at; as they are, nothing may touch either.
            for wide in (high, opening[:, step]):
                self._place(joints[:, step], np.broadcast_to(wide, 2), held)
                self._judge_distances(1.0 if wide is high else 0.0)
            self._judge_workspace()
            lowest = self._lowest(held)
            if step == 0:
                floor = np.minimum(lowest, 0.0) - SAG
            _require((lowest >= floor).all(), "what is held is pressed down")
        self.set_points += joints.shape[1]

    def _size(self, held) -> None:
        for arm, thing in zip("lr", held, strict=True):
            geom = self._model.geom(f"{arm}_held").id
            half = np.full(3, 1e-3) if thing is None else 0.5 * np.asarray(thing.size)
            self._model.geom_size[geom] = half
            self._model.geom_rbound[geom] = np.sqrt((half * half).sum())
            self._model.geom_aabb[geom] = [0.0, 0.0, 0.0, *half]

    def _place(self, joints: np.ndarray, opening: np.ndarray, held) -> None:
        model, data = self._model, self._data
        travel = CLOSED_TRAVEL + 0.5 * (opening - OPENINGS[0])
        data.qpos[self._joints] = joints
        data.qpos[self._fingers] = travel[:, None] * [1.0, -1.0]
        mujoco.mj_kinematics(model, data)
        for arm, (name, thing) in enumerate(zip("lr", held, strict=True)):
            position, rotation = np.array([10.0 * (1 + arm), 0.0, 10.0]), np.eye(3)
            if thing is not None:
                site = data.site(f"{name}_grip")
                frame = site.xmat.reshape(3, 3)
                position, rotation = site.xpos + frame @ thing.position, frame @ thing.rotation
            body = model.body(f"{name}_held").mocapid[0]
            data.mocap_pos[body] = position
            mujoco.mju_mat2Quat(data.mocap_quat[body], np.ascontiguousarray(rotation).ravel())
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_collision(model, data)

    def _judge_distances(self, share: float) -> None:
        """Require that everything near keeps a share of its distance."""
        for contact in self._data.contact:
            first, second = (self._model.geom(int(index)).name for index in contact.geom)
            need = self._needs[frozenset((first, second))]
            self.least = min(self.least, contact.dist / need) if share else self.least
            _require(
                contact.dist >= share * need - ROUNDING,
                f"{first} is {1000 * contact.dist:.1f} mm from {second}, not {1000 * share * need:.0f}",
            )

    def _judge_workspace(self) -> None:
        model, data = self._model, self._data
        axis = np.abs(data.geom_xmat[self._links].reshape(-1, 3, 3)[:, :, 2])
        size, centre = model.geom_size[self._links], data.geom_xpos[self._links]
        reach = axis * size[:, 1:2] + size[:, :1]
        inside = (centre - reach >= WORKSPACE[0] - ROUNDING) & (centre + reach <= WORKSPACE[1] + ROUNDING)
        _require(inside.all(), "a link outside the workspace")

    def _lowest(self, held) -> np.ndarray:
        """Return the heights of the lowest points of what is held [2] [m]; infinite for empty hands."""
        lowest = np.full(2, np.inf)
        for arm, (name, thing) in enumerate(zip("lr", held, strict=True)):
            if thing is not None:
                geom = self._data.geom(f"{name}_held")
                up = np.abs(geom.xmat.reshape(3, 3)[2]) @ (0.5 * np.asarray(thing.size))
                lowest[arm] = geom.xpos[2] - up
        return lowest


def _require(good, words: str) -> None:
    if not good:
        raise BrokenLimitError(words)


def _compile() -> tuple[mujoco.MjModel, dict[frozenset[str], float]]:
    """Return two arms, a table and a box for each hand, and which pairs keep how much distance [m]."""
    spec = mujoco.MjSpec()
    text = (resources.files("taskschema") / "data" / "sawyer.xml").read_text()
    for name, (position, turn) in zip("lr", BASES, strict=True):
        frame = spec.worldbody.add_frame(
            pos=position, quat=[np.cos(0.5 * turn), 0.0, 0.0, np.sin(0.5 * turn)]
        )
        spec.attach(mujoco.MjSpec.from_string(text), prefix=f"{name}_", frame=frame)
        body = spec.worldbody.add_body(name=f"{name}_held", mocap=True)
        body.add_geom(name=f"{name}_held", type=mujoco.mjtGeom.mjGEOM_BOX, size=[1e-3] * 3)
    spec.worldbody.add_geom(name="table", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[2.0, 2.0, 0.1])
    for geom in spec.geoms:
        geom.contype = geom.conaffinity = 0
    needs = _needs()
    for pair in needs:
        first, second = sorted(pair)
        spec.add_pair(geomname1=first, geomname2=second, margin=NEAR)
    return spec.compile(), needs


def _needs() -> dict[frozenset[str], float]:
    needs = {frozenset((f"l_{one}", f"r_{other}")): ARMS for one in LINKS for other in LINKS}
    for arm, other in ("lr", "rl"):
        for link in LINKS[1:]:
            needs[frozenset((f"{arm}_{link}", "table"))] = FINGERS_TABLE if "finger" in link else TABLE
        for place, link in enumerate(LINKS):
            for far in LINKS[place + 3 :]:
                if link not in ("right_l6_0", *HAND):  # a hand is one piece with its fingers
                    needs[frozenset((f"{arm}_{link}", f"{arm}_{far}"))] = SELF
        for link in LINKS[:5]:
            needs[frozenset((f"{arm}_{link}", f"{arm}_held"))] = HELD
        for link in LINKS[:6]:  # hands may both touch what one of them holds
            needs[frozenset((f"{other}_{link}", f"{arm}_held"))] = HELD
    return needs
