"""Random, extreme and malformed commands at the gate: none that breaks a limit reaches a driver.

What reaches the drivers is judged by a second opinion that shares no code with the gate's own checks.
"""

import numpy as np
import pytest
from motions import PERIOD, grasp_of_the_bar, skill_motion, straight
from recording_arms import HOME, TestBench

from taskschema.kinematics.sawyer import sawyer
from taskschema.safety.arm_model import LINKS, ArmModel
from taskschema.safety.motion import HeldObject, Motion
from taskschema.safety.refusal import RefusalKind
from taskschema.tasks import get_task

EXTREME = np.array([0.0, -0.0, 1e-320, 1e-9, 1e9, 1e300, -1e300, np.inf, -np.inf, np.nan, np.pi, -np.pi])


def random_command(rng: np.random.Generator, valid: Motion) -> Motion:
    """A valid motion spoilt in one of many ways, or nonsense from the start."""
    kind = rng.integers(13)  # 12: as it is
    joints, opening = valid.joints.copy(), valid.opening.copy()
    step, arm, joint = rng.integers(joints.shape[1]), rng.integers(2), rng.integers(7)
    if kind == 0:
        joints = rng.normal(size=(2, int(rng.integers(1, 30)), 7)) * 10.0 ** rng.integers(-3, 4)
        opening = rng.uniform(-0.1, 0.2, joints.shape[:2])
    elif kind == 1:
        joints[arm, step, joint] = rng.choice(EXTREME)
    elif kind == 2:
        joints[arm, step:, joint] += rng.normal() * 10.0 ** rng.integers(-3, 2)
    elif kind == 3:
        joints[:, step:] = HOME[:, None] + rng.normal(size=(2, 1, 7)) * rng.uniform(0.0, 2.0)
    elif kind == 4:
        opening[arm, step] = rng.choice(EXTREME)
    elif kind == 5:
        joints = [joints[:1], joints[..., :6], joints[:, :0], joints[0], joints.astype(object)][
            rng.integers(5)
        ]
    elif kind == 6:
        joints = joints[:, ::-1].copy()
    elif kind == 7:
        joints = joints + rng.normal(size=(2, 1, 7)) * 0.05
    elif kind == 8:
        return Motion(joints, opening, float(rng.choice([0.0, -PERIOD, 1e-9, 0.02, np.nan, np.inf])))
    elif kind == 9:
        held = HeldObject(rng.choice(EXTREME, 3), rng.normal(size=3), rng.normal(size=(3, 3)))
        return Motion(joints, opening, PERIOD, held=(held, None))
    elif kind == 10:
        joints = joints[:, :: int(rng.integers(2, 6))]
        opening = opening[:, : joints.shape[1]]
    elif kind == 11:
        joints = np.repeat(joints[:, :1], 2, axis=1) + rng.normal(size=(2, 2, 7)) * 1e-3
        opening = opening[:, :2]
    return Motion(joints, opening, PERIOD)


def motions_to_spoil() -> list[Motion]:
    end = HOME.copy()
    end[:, 0] += 0.3
    return [
        grasp_of_the_bar(),
        straight(HOME, end),
        skill_motion(HOME, ("lift", "no_op"), ([0.2], [])),
    ]


class SecondOpinion:
    """Judges what drivers received, from the vendor's limits and the collision model's distances alone."""

    def __init__(self) -> None:
        self._model = ArmModel()
        m, index = self._model, self._model.index
        self._arm_pairs = [(index(0, left), index(1, right)) for left in LINKS for right in LINKS]
        self._table_pairs = [(index(arm, link), index(None, "table")) for arm in (0, 1) for link in LINKS[1:]]
        assert len(m.shapes) == 2 * (len(LINKS) + 1) + 1

    def judge(self, sent: np.ndarray, *, every: int = 1) -> None:
        """Set-points [2, S, 7] that both drivers received."""
        arm = sawyer()
        assert np.isfinite(sent).all()
        assert (sent >= arm.lower).all()
        assert (sent <= arm.upper).all()
        velocity = np.diff(sent, axis=1) / PERIOD
        assert (np.abs(velocity) <= arm.velocity * 1.001).all()
        assert (np.abs(np.diff(velocity, axis=1)) / PERIOD <= arm.acceleration * 1.01 + 1e-6).all()
        steps = sorted({*range(0, sent.shape[1], every), sent.shape[1] - 1})
        for step in steps:
            self._model.place(sent[:, step])
            for first, second in self._arm_pairs + self._table_pairs:
                assert self._model.distance(first, second, 0.05) > 0.0, self._model.shapes[first].name


def throw(commands: int, seed: int) -> tuple[int, int]:
    """Throw commands at a gate, from home each time; return how many were let through and how many not."""
    rng = np.random.default_rng(seed)
    opinion, valid = SecondOpinion(), motions_to_spoil()
    passed = 0
    bench = TestBench()
    for _ in range(commands):
        for arm, home in zip(bench.arms, HOME, strict=True):
            arm.positions = home.copy()
            arm.commands.clear()
        refusal = bench.gate.execute(random_command(rng, valid[rng.integers(len(valid))]))
        sent = [np.array([positions for _, positions in arm.commands]) for arm in bench.arms]
        if refusal is not None:
            assert bench.sent == 0, refusal
            continue
        passed += 1
        opinion.judge(np.stack(sent), every=20)
    assert bench.gate.fault is None
    return passed, commands - passed


def sweep_plans(plans: int, seed: int) -> tuple[int, int]:
    """Plan skills with random arguments from wherever the last ones led; judge all that is let through."""
    rng = np.random.default_rng(seed)
    opinion, passed = SecondOpinion(), 0
    tasks = [get_task("lateral-lifting"), get_task("opening")]
    bench = TestBench()
    for number in range(plans):
        if number % 3 == 0:
            for arm, home in zip(bench.arms, HOME, strict=True):
                arm.positions = home.copy()
        task = tasks[rng.integers(2)]
        instance = task.draw_instance(rng)
        skills = [task.pairs.skills[rng.integers(len(task.pairs.skills))] for _ in range(2)]
        arguments = [[rng.uniform(item.low, item.high) for item in skill.arguments] for skill in skills]
        names = [skill.name for skill in skills]
        motion = skill_motion(bench.positions(), names, arguments, task=task, instance=instance)
        for arm in bench.arms:
            arm.commands.clear()
        refusal = bench.gate.execute(motion)
        if refusal is None:
            passed += 1
            sent = [np.array([positions for _, positions in arm.commands]) for arm in bench.arms]
            opinion.judge(np.stack(sent), every=4)
        else:
            assert bench.sent == 0
            assert refusal.kind not in (RefusalKind.MALFORMED, RefusalKind.VELOCITY, RefusalKind.ACCELERATION)
    assert bench.gate.fault is None
    return passed, plans - passed


def test_commands_that_break_a_limit_reach_no_driver():
    passed, refused = throw(400, seed=0)
    assert passed > 10
    assert refused > 200


def test_swept_plans_keep_clear():
    passed, refused = sweep_plans(30, seed=0)
    assert passed > 3
    assert refused > 3


@pytest.mark.slow
@pytest.mark.timeout(3600)
def test_100_000_commands():
    passed, refused = throw(100_000, seed=1)
    print(f"{passed} let through, {refused} refused")
    assert passed + refused == 100_000


@pytest.mark.slow
@pytest.mark.timeout(3600)
def test_2_000_swept_plans():
    passed, refused = sweep_plans(2_000, seed=1)
    print(f"{passed} let through, {refused} refused")
    assert passed + refused == 2_000
    assert passed > 200


def test_the_second_opinion_can_say_no():
    into_each_other = np.repeat(HOME[:, None], 3, axis=1)
    into_each_other[0, :, 1] = -0.6
    into_each_other[0, :, 3] = 1.2
    into_each_other[0, :, 0] = 0.0
    with pytest.raises(AssertionError):
        SecondOpinion().judge(into_each_other)
    too_fast = np.repeat(HOME[:, None], 3, axis=1)
    too_fast[0, 1:, 0] += 0.02
    with pytest.raises(AssertionError):
        SecondOpinion().judge(too_fast)
