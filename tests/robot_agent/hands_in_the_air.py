"""Hands that are up, on recording arms, with an episode's runner that has to put down what they hold."""

import numpy as np
from recording_arms import TestBench

from taskschema.kinematics.inverse import solve_inverse
from taskschema.kinematics.sawyer import rethink_gripper, sawyer_pair
from taskschema.safety.motion import Motion
from taskschema.tasks import get_task
from taskschema_robot.agent.episode import EpisodeRunner
from taskschema_robot.objects.catalogue import HEAVY_BAR

TASK = get_task("lateral-lifting")
TOOK_AT = 0.05
"""Height at which hands closed [m]."""


def heights(joints: np.ndarray) -> list[float]:
    return [arm.forward(row[None])[0][0, 2] for arm, row in zip(sawyer_pair(), joints, strict=True)]


def raised(*wanted: float) -> np.ndarray:
    """Joint angles [2, 7] of hands above where they are at home, at such heights [m]."""
    rows = []
    for arm, row, height in zip(sawyer_pair(), TASK.home_joints, wanted, strict=True):
        position, rotation = arm.forward(row[None])
        rows.append(solve_inverse(arm, np.array([[*position[0, :2], height]]), rotation, row[None]).joints[0])
    return np.stack(rows)


class InTheAir:
    """Hands that closed, or press, at `TOOK_AT` and are now at such heights [m]."""

    def __init__(self, *at: float, closed: tuple[bool, bool] = (True, True), world=None) -> None:
        self.bench = TestBench(raised(*at))
        self.released: list[str] = []
        self.runner = EpisodeRunner(
            TASK,
            np.array(HEAVY_BAR.size),
            self.bench.gate,
            world,
            self.bench.clock,
            self.bench.limits,
            release=self.released.append,
        )
        gripper, joints = rethink_gripper(), self.bench.positions()
        opening = np.where(closed, gripper.closed, gripper.open)
        self.bench.gate.execute(
            Motion(np.repeat(joints[:, None], 2, 1), np.repeat(opening[:, None], 2, 1), 0.01)
        )
        hands = self.runner._planner.hands
        hands.opening, hands.joints, hands.took_at = opening, joints, [TOOK_AT, TOOK_AT]
        hands.pressing = [not shut for shut in closed]

    def put_down(self) -> list[float]:
        self.runner._put_down(recovering=False)
        return heights(self.bench.positions())
