"""Random, extreme and malformed commands at the gate: none that breaks a limit reaches a driver.

What reaches the drivers is judged by a second opinion, which has a model, limits and distances of its own.
"""

import dataclasses

import numpy as np
import pytest
from motions import PERIOD, grasp_of_the_bar, skill_motion, straight
from recording_arms import HOME, TestBench
from second_opinion import ACCELERATION, LOWER, UPPER, VELOCITY, BrokenLimitError, SecondOpinion

from taskschema.kinematics.rotation import vertical_turn
from taskschema.kinematics.sawyer import rethink_gripper, sawyer
from taskschema.safety.motion import HeldObject, Motion
from taskschema.safety.refusal import Refusal, RefusalKind
from taskschema.tasks import get_task

TASKS = [get_task(name) for name in ("lateral-lifting", "picking", "opening", "rotating")]
NEVER_OF_A_PLAN = (RefusalKind.MALFORMED, RefusalKind.VELOCITY, RefusalKind.ACCELERATION)
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
    end, far = HOME.copy(), HOME.copy()
    end[:, 0] += 0.3
    far[:, 6] = sawyer().upper[6] - 0.005
    return [
        grasp_of_the_bar(),
        straight(HOME, end),
        straight(HOME, far),  # into the margin: refused as it is
        skill_motion(HOME, ("lift", "no_op"), ([0.2], [])),
    ]


class JudgedBench(TestBench):
    """A gate between two recording arms, and the second opinion on all that reaches them."""

    def __init__(self) -> None:
        super().__init__()
        self.opinion = SecondOpinion()
        self.openings: list[list[float]] = [[], []]
        for arm, openings in zip(self.arms, self.openings, strict=True):
            arm.set_gripper = self._noting(arm.set_gripper, openings)

    @staticmethod
    def _noting(set_gripper, openings: list[float]):
        def note(opening: float) -> None:
            openings.append(opening)
            set_gripper(opening)

        return note

    def put(self, joints: np.ndarray) -> None:
        for arm, row in zip(self.arms, joints, strict=True):
            arm.positions = row.copy()

    def execute(self, motion: Motion) -> Refusal | None:
        """Make a motion or have it refused; judge what was sent."""
        for arm, openings in zip(self.arms, self.openings, strict=True):
            arm.commands.clear()
            openings.clear()
        refusal = self.gate.execute(motion)
        if refusal is not None:
            assert self.sent == 0, refusal
            assert self.openings == [[], []]
            return refusal
        sent = np.stack([[positions for _, positions in arm.commands] for arm in self.arms])
        for told, planned in zip(self.openings, motion.opening, strict=True):
            assert set(told) <= set(planned.tolist()), "an opening that nobody planned"
        # The end is sent again until the arms have arrived: these arms are there at once.
        extra = sent.shape[1] - motion.opening.shape[1]
        opening = np.pad(motion.opening, ((0, 0), (0, extra)), mode="edge")
        self.opinion.judge(sent, opening, motion.held, motion.period)
        return None


def throw(commands: int, seed: int) -> tuple[int, int, JudgedBench]:
    """Throw commands at a gate, from home each time; return how many were let through, and how many not."""
    rng = np.random.default_rng(seed)
    valid, passed, bench = motions_to_spoil(), 0, JudgedBench()
    for _ in range(commands):
        bench.put(HOME)
        passed += bench.execute(random_command(rng, valid[rng.integers(len(valid))])) is None
    assert bench.gate.fault is None
    return passed, commands - passed, bench


def random_skills(rng: np.random.Generator, joints: np.ndarray) -> Motion:
    """A plan of two skills of a random task, with random arguments; every third hand holds something."""
    task = TASKS[rng.integers(len(TASKS))]
    instance = task.draw_instance(rng)
    skills = [task.pairs.skills[rng.integers(len(task.pairs.skills))] for _ in range(2)]
    arguments = [[rng.uniform(item.low, item.high) for item in skill.arguments] for skill in skills]
    names = [skill.name for skill in skills]
    motion = skill_motion(joints, names, arguments, task=task, instance=instance)
    size = np.array(task.object_size) * instance.scale
    held = tuple(random_held(rng, size) if rng.random() < 1 / 3 else None for _ in range(2))
    return dataclasses.replace(motion, held=held)


def random_held(rng: np.random.Generator, size: np.ndarray) -> HeldObject:
    """An object between the fingers, taken somewhere along it and turned anyhow about the hand's axis."""
    turn = rng.uniform(-np.pi, np.pi)
    rotation = vertical_turn(np.array([turn]))[0]
    return HeldObject(size, rotation @ (rng.uniform(-0.4, 0.4, 3) * size), rotation)


def sweep_plans(plans: int, seed: int) -> tuple[int, int, JudgedBench]:
    """Plan skills with random arguments from wherever the last ones led; judge all that is let through."""
    rng = np.random.default_rng(seed)
    passed, bench = 0, JudgedBench()
    bench.holding = 0
    for number in range(plans):
        if number % 3 == 0:
            bench.put(HOME)
        motion = random_skills(rng, bench.positions())
        refusal = bench.execute(motion)
        passed += refusal is None
        bench.holding += refusal is None and motion.held != (None, None)
        assert refusal is None or refusal.kind not in NEVER_OF_A_PLAN, refusal
    assert bench.gate.fault is None
    return passed, plans - passed, bench


def test_commands_that_break_a_limit_reach_no_driver():
    passed, refused, _ = throw(400, seed=0)
    assert passed > 10
    assert refused > 200


def test_swept_plans_keep_clear():
    passed, refused, bench = sweep_plans(45, seed=0)
    assert passed > 5
    assert refused > 5
    assert bench.holding > 0


@pytest.mark.slow
@pytest.mark.timeout(7200)
def test_100_000_commands():
    report("commands", *throw(100_000, seed=1))


@pytest.mark.slow
@pytest.mark.timeout(7200)
def test_2_000_swept_plans():
    passed, refused, bench = sweep_plans(2_000, seed=1)
    report("plans", passed, refused, bench)
    print(f"{bench.holding} of those let through held something")
    assert passed > 200
    assert bench.holding > 50


def report(what: str, passed: int, refused: int, bench: JudgedBench) -> None:
    """Print the figures of docs/run-a-robot.md (`-s`)."""
    opinion = bench.opinion
    print(f"\n{passed + refused} {what}: {passed} let through, {refused} refused;")
    print(f"{opinion.set_points} set-points, the nearest shapes at {opinion.least:.2f} of their clearance")


def still(joints: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return np.repeat(joints[:, None], 3, axis=1), np.full((2, 3), rethink_gripper().open)


def test_the_second_opinion_can_say_yes():
    SecondOpinion().judge(*still(HOME))


@pytest.mark.parametrize(
    ("words", "spoil"),
    [
        ("finite", lambda joints, opening: joints.__setitem__((0, 1, 2), np.nan)),
        ("margin", lambda joints, opening: joints.__setitem__((1, slice(None), 6), 4.705)),
        ("velocity", lambda joints, opening: joints[0, 1:].__iadd__(0.05)),
        ("acceleration", lambda joints, opening: joints[0, 1:].__iadd__(0.0014)),
        ("opening", lambda joints, opening: opening.__setitem__((1, 2), 0.08)),
    ],
)
def test_the_second_opinion_can_say_no_to_numbers(words, spoil):
    joints, opening = still(HOME)
    spoil(joints, opening)
    with pytest.raises(BrokenLimitError, match=words):
        SecondOpinion().judge(joints, opening)


LOW = skill_motion(HOME, ("top_grasp", "no_op"), ([0.0, 0.0, 0.0], [])).joints[:, -1]
LOW[0, 1] += 0.05
"""The left hand's fingers in the table."""


def changed(**angles: float) -> np.ndarray:
    """Home with angles of the left arm changed, joint `j0` to `j6`."""
    joints = HOME.copy()
    for name, angle in angles.items():
        joints[0, int(name[1])] = angle
    return joints


@pytest.mark.parametrize(
    ("words", "joints"),
    [
        ("from r_", changed(j0=0.0, j1=-0.6, j3=1.2)),
        ("table is|from table", LOW),
        ("workspace", changed(j0=1.57, j1=0.0, j3=0.0, j5=0.0)),
        ("from l_", changed(j1=-1.2, j3=3.03, j5=2.9)),
    ],
)
def test_the_second_opinion_can_say_no_to_places(words, joints):
    with pytest.raises(BrokenLimitError, match=words):
        SecondOpinion().judge(*still(joints))


def test_the_second_opinion_can_say_no_to_what_is_held():
    large = HeldObject(np.array([0.9, 0.9, 0.05]), np.array([0.0, 0.0, -0.3]), np.eye(3))
    with pytest.raises(BrokenLimitError, match="l_held"):
        SecondOpinion().judge(*still(HOME), (large, None))
    hanging = HeldObject(np.full(3, 0.05), np.array([0.0, 0.0, 0.15]), np.eye(3))
    lower = skill_motion(HOME, ("top_grasp", "no_op"), ([0.0, 0.0, 0.0], []))
    with pytest.raises(BrokenLimitError, match="pressed down"):
        SecondOpinion().judge(lower.joints, lower.opening, (hanging, None))


@pytest.mark.parametrize(
    ("check", "throwing"),
    [
        ("taskschema.safety.sweep.Sweep.check", lambda: sweep_plans(100, seed=0)),
        ("taskschema.safety.plan_checks.check_joint_limits", lambda: throw(2_000, seed=0)),
        ("taskschema.safety.plan_checks.check_rates", lambda: throw(2_000, seed=0)),
        ("taskschema.safety.plan_checks.check_gripper", lambda: throw(2_000, seed=0)),
    ],
)
def test_a_gate_that_lacks_a_check_is_found_out(monkeypatch, check, throwing):
    monkeypatch.setattr(check, lambda *arguments, **named: None)
    with pytest.raises(BrokenLimitError):
        throwing()


def test_the_second_opinion_has_the_vendors_limits():
    """Written down twice: so that neither changes alone."""
    arm = sawyer()
    for mine, theirs in ((LOWER, arm.lower), (UPPER, arm.upper), (VELOCITY, arm.velocity)):
        np.testing.assert_array_equal(mine, theirs)
    np.testing.assert_array_equal(ACCELERATION, arm.acceleration)
