"""What is kept of every step and of the seconds before a fault, and that keeping it delays no stop."""

import dataclasses
import json
import logging

import numpy as np
import pytest
from motions import straight
from recording_arms import HOME, TestBench
from scripted_expert import TASK, Expert
from twin_setup import LockStep

from taskschema.randomness import EpisodeKey
from taskschema.safety.limits import SafetyLimits
from taskschema_robot.agent.episode import EpisodeRunner
from taskschema_robot.agent.fault_record import FaultRecord
from taskschema_robot.agent.step_log import StepLog, StepRecord
from taskschema_robot.agent.twin_world import TrueWorld
from taskschema_robot.drivers.recorded_arm import RECORDED_SECONDS, RecordedArm
from taskschema_robot.objects.catalogue import HEAVY_BAR
from taskschema_robot.safety.fault import FaultError
from taskschema_robot.safety.gate import SafetyGate
from taskschema_robot.twin.faults import FaultKind

LIMITS = SafetyLimits()
SIZE = np.array(HEAVY_BAR.size)


class Meeting(Expert):
    """Begins with hands that meet over the middle of the bar."""

    def act(self, observations, step, streams):
        actions = super().act(observations, step, streams)
        nowhere = np.zeros_like(actions.arguments)
        return dataclasses.replace(actions, arguments=nowhere) if step == 0 else actions


@pytest.fixture
def twin():
    running = LockStep(HEAVY_BAR)
    yield running
    running.close()


def recording_gate(twin: LockStep, folder) -> SafetyGate:
    arms = [RecordedArm(arm) for arm in twin.arms]
    faults = FaultRecord(folder, [arm.last_seconds for arm in arms])
    return SafetyGate(tuple(arms), twin.clock, LIMITS, (), faults)


def test_every_step_is_a_line(twin, tmp_path):
    gate = SafetyGate(twin.arms, twin.clock, LIMITS)
    gate.prepare()
    for attempt in range(2):  # two sessions in one folder
        world = TrueWorld(twin.client, TASK, HEAVY_BAR, twin.clock)
        log = StepLog(tmp_path / "steps.jsonl")
        runner = EpisodeRunner(TASK, SIZE, gate, world, twin.clock, LIMITS, listeners=[log])
        begin = twin.clock.now()
        trajectory, record = runner.run(EpisodeKey(0, 3, 7, 0, attempt), Meeting(0.35))
    lines = [json.loads(line) for line in (tmp_path / "steps.jsonl").read_text().splitlines()]
    second = [line for line in lines if line["attempt"] == 1]
    assert len(lines) == 2 * len(second)
    assert [line["step"] for line in second] == list(range(len(trajectory)))
    assert [tuple(line["skills"]) for line in second] == record.skills
    first, grasp = second[0], second[1]
    assert (first["round"], first["slot"], first["seconds"]) == (3, 7, 0.0)
    assert first["refused"] == record.refusals[0]
    assert first["arguments"]["left.top_grasp.x"] == 0.0
    assert set(first["arguments"]) == {
        f"{arm}.top_grasp.{name}" for arm in ("left", "right") for name in ("x", "y", "z_orientation")
    }
    assert (grasp["refused"], grasp["fault"]) == (None, None)
    assert begin < first["time"] <= grasp["time"] < grasp["time"] + grasp["seconds"] < twin.clock.now()
    assert grasp["seconds"] > 1.0
    assert len(grasp["pose"]) == 7


def test_the_seconds_before_a_fault_are_kept(twin, tmp_path):
    gate = recording_gate(twin, tmp_path / "faults")
    gate.prepare()
    end = HOME.copy()
    end[:, 0] += 0.5
    assert gate.execute(straight(HOME, end, speed_ratio=0.08)) is None  # longer than what is kept
    twin.client.inject(FaultKind.JOINT_ERROR, 1)
    motion = straight(np.stack([state.positions for state in gate.states()]), HOME, speed_ratio=0.1)
    with pytest.raises(FaultError):
        gate.execute(motion)
    (path,) = (tmp_path / "faults").iterdir()
    assert path.name.endswith("-robot_error.npz")
    with np.load(path, allow_pickle=False) as kept:
        record = dict(kept)
    assert str(record["reason"]) == gate.fault.reason == "right arm: it reports an error"
    assert record["time"] == gate.fault.time
    for arm in ("left", "right"):
        seconds = gate.fault.time - record[f"{arm}_time"]
        assert 0.0 <= seconds[-1] < 0.1
        assert RECORDED_SECONDS - 0.1 < seconds[0] <= RECORDED_SECONDS + 0.1
        count = len(seconds)
        assert count > 0.8 * RECORDED_SECONDS / LIMITS.period
        sent, measured = record[f"{arm}_set_points"], record[f"{arm}_positions"]
        assert sent.shape == measured.shape == record[f"{arm}_efforts"].shape == (count, 7)
        assert record[f"{arm}_wrench"].shape == (count, 6)
        assert record[f"{arm}_gripper_opening"].shape == record[f"{arm}_set_opening"].shape == (count,)
        assert np.isnan(sent[-1]).all()
        assert np.abs(sent[:-1] - measured[:-1]).max() < 0.1
        assert np.ptp(measured[:, 0]) > 0.1
    assert record["right_error"][-1]
    assert not record["left_error"].any()


def test_nothing_is_written_before_both_arms_were_told_and_no_failure_stands_in_the_way(tmp_path, caplog):
    caplog.set_level(logging.INFO, "taskschema.robot")
    bench = TestBench()
    (tmp_path / "faults").write_text("a file where the folder should be")
    record = FaultRecord(tmp_path / "faults", [RecordedArm(arm).last_seconds for arm in bench.arms])
    stopped_before = []

    def listen(fault) -> None:
        stopped_before.append([bool(arm.stops) for arm in bench.arms])
        record(fault)

    gate = SafetyGate(bench.arms, bench.clock, bench.limits, (), listen)
    bench.clock.after(0.1, lambda: bench.arms[0].changes.update(collision=True))
    with pytest.raises(FaultError, match="has detected a collision"):
        gate.execute(straight(HOME, HOME + 0.1))
    assert stopped_before == [[True, True]]
    assert "What was before the fault is not kept" in caplog.text


def test_a_step_that_a_fault_broke_off_is_a_line_too(twin, tmp_path):
    gate = recording_gate(twin, tmp_path / "faults")
    gate.prepare()
    world, sleep, due = TrueWorld(twin.client, TASK, HEAVY_BAR, twin.clock), twin.clock.sleep_until, []
    log = StepLog(tmp_path / "steps.jsonl")
    runner = EpisodeRunner(TASK, SIZE, gate, world, twin.clock, LIMITS, listeners=[log])
    judge = world.judge

    def judge_and_break(start, name):
        due.append(twin.clock.now() + 0.5)
        return judge(start, name)

    def sleep_until(moment: float) -> None:
        sleep(moment)
        if due and twin.clock.now() > due[0]:
            due.clear()
            twin.client.inject(FaultKind.JOINT_ERROR, 0)

    world.judge, twin.clock.sleep_until = judge_and_break, sleep_until
    with pytest.raises(FaultError):
        runner.run(EpisodeKey(0, 0, 0, 0), Expert(0.35))
    first, broken = [json.loads(line) for line in (tmp_path / "steps.jsonl").read_text().splitlines()]
    assert first["fault"] is None
    assert broken["fault"] == gate.fault.reason
    assert 0.0 < broken["seconds"] < 1.0


def test_a_step_that_cannot_be_written_is_said_in_the_log(tmp_path, caplog):
    bench = TestBench()
    motion, now = straight(HOME, HOME), bench.clock.now()
    record = StepRecord(EpisodeKey(0, 0, 0, 0), 0, ("lift", "lift"), {}, np.zeros(7), motion, now)
    StepLog(tmp_path / "nowhere" / "steps.jsonl")(record)
    assert "A step is not in" in caplog.text
