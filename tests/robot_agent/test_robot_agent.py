"""The agent's loop on a real Redis: what is delivered, what is dropped, what survives."""

import csv
import logging
import os
import signal
import threading

import numpy as np
import pytest
from agent_setup import CONFIG, TASK, AgentBench, ScriptedWorld, open_round
from bus_setup import Run, gather

from taskschema.bus.connection import connect
from taskschema.bus.messages import WorkItem
from taskschema.bus.records import RunRecords
from taskschema.bus.worker_bus import WorkerBus
from taskschema.config import RunConfig
from taskschema.errors import ConfigError
from taskschema.policies import Policy
from taskschema.randomness import EpisodeKey, Purpose, generator
from taskschema.trajectory import TrajectoryFormat
from taskschema_learner.embedded_redis import EmbeddedRedis
from taskschema_robot.agent.episode_log import EpisodeLog
from taskschema_robot.agent.world import EpisodeDroppedError
from taskschema_robot.errors import NotReadyError, RobotError
from taskschema_robot.reward.judge import Outcome


@pytest.fixture
def run(shared_redis):
    with Run(shared_redis.url, CONFIG) as fresh:
        yield fresh


@pytest.fixture
def bench(run, tmp_path):
    made = AgentBench(run, tmp_path)
    yield made
    made.leave()


def test_every_slot_is_run_once_and_let_in(run, bench):
    learner, _ = open_round(run)
    bench.world.outcomes = [Outcome.FAILURE, Outcome.SUCCESS]
    bench.serve(3)
    results = gather(learner, 3)
    first = next(result for result in results if result.slot == 0).trajectories[0]
    assert first.success
    assert len(first) == 2
    others = [result.trajectories[0] for result in results if result.slot != 0]
    assert all(not item.success and len(item) == 3 for item in others)
    assert bench.world.resets == 3
    assert bench.agent.progress.episodes == 3


def test_a_row_names_the_picture_that_the_outcome_was_judged_by(run, bench, tmp_path):
    open_round(run)
    bench.world.outcomes = [Outcome.FAILURE, Outcome.SUCCESS]
    bench.serve(3)
    with (tmp_path / "episodes.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    last = [f"{int(row['slot']):06d}-0-{int(row['steps']) - 1}" for row in rows]
    assert [row["evidence"] for row in rows] == [f"000000-{name}.png" for name in last]
    assert [row["steps"] for row in rows] == ["2", "3", "3"]


def test_what_acted_is_what_is_streamed(run, bench):
    learner, snapshot = open_round(run)
    bench.serve(3)
    policy = Policy(snapshot, TASK.pairs, TASK.observation)
    for result in gather(learner, 3):
        trajectory = result.trajectories[0]
        key = EpisodeKey(CONFIG.seed, 0, result.slot, 0)
        for step in range(3):
            stream = generator(key, Purpose.ACTION, step)
            again = policy.act(trajectory.observations[step : step + 1], step, [stream])
            assert again.pairs[0] == trajectory.pairs[step]
            np.testing.assert_array_equal(again.raw[0], trajectory.arguments[step])


def test_a_fault_drops_the_episode_and_it_is_run_again(run, bench, tmp_path):
    learner, _ = open_round(run)
    broken = []

    def break_once() -> None:
        if not broken:
            broken.append(True)
            bench.arms.clock.after(0.05, lambda: bench.arms.arms[1].changes.update(collision=True))

    bench.world.on_reset = break_once
    bench.serve(3)
    results = gather(learner, 3)
    attempts = {result.slot: result.trajectories[0].attempt for result in results}
    assert sorted(attempts.values()) == [0, 0, 1]
    assert [fault.kind for fault in bench.operator.acknowledged] == ["collision"]
    assert len(bench.operator.drops) == 1
    progress = bench.agent.progress
    assert progress.episodes == 3  # the dropped one is not a failure
    assert progress.dropped == 1
    with (tmp_path / "dropped.csv").open(newline="") as file:
        (row,) = csv.DictReader(file)
    assert (row["round"], row["attempt"]) == ("0", "0")
    assert "it has detected a collision" in row["reason"]
    assert int(row["skills"]) >= 1  # the one that the fault broke off
    with (tmp_path / "episodes.csv").open(newline="") as file:
        counted = sum(float(line["seconds"]) for line in csv.DictReader(file))
    assert float(row["seconds"]) > 0.05
    assert progress.seconds == pytest.approx(counted + float(row["seconds"]), abs=0.03)


def test_an_acknowledgement_that_comes_too_early_is_asked_for_again(run, bench, monkeypatch):
    """Before the button is released, more often than arms may try to get home; then after another stop."""
    monkeypatch.setattr("taskschema_robot.agent.robot_agent.RETRY_SECONDS", 0.0)
    learner, _ = open_round(run)
    arm, asked = bench.arms.arms[1], []
    reset = arm.reset

    def acknowledge(fault) -> str:
        asked.append(fault.reason)
        arm.reset = still_pressed if len(asked) < 9 else stopped_again if len(asked) == 9 else reset
        return "tester"

    def still_pressed() -> None:
        raise NotReadyError("right: the emergency stop button is pressed: release it first.")

    def stopped_again() -> None:
        reset()
        bench.arms.gate.stop("the stop key")

    def press() -> None:
        bench.world.on_reset = lambda: None
        bench.arms.clock.after(0.05, lambda: arm.changes.update(emergency_stop=True))

    bench.operator.acknowledge = acknowledge
    bench.world.on_reset = press
    bench.serve(3)
    assert sorted(item.trajectories[0].attempt for item in gather(learner, 3)) == [0, 0, 1]
    first = "right arm: its emergency stop is pressed"
    again = "right: the emergency stop button is pressed: release it first."
    assert asked == [first, *[f"{first}\n\nNot yet: {again}"] * 8, "the stop key"]


@pytest.mark.parametrize(
    ("said", "lines"),
    [
        (True, ["A person undid it: it was a success", "Round 0, slot 0, attempt 0: success after 3 steps"]),
        (False, ["Round 0, slot 0, attempt 0: failure after 3 steps"]),
        (None, ["Round 0, slot 0, attempt 0: dropped: A person dropped it."]),
    ],
)
def test_what_a_person_says_stands_in_the_log(run, bench, caplog, said, lines):
    caplog.set_level(logging.INFO, "taskschema.robot")
    open_round(run)
    answers = [said]
    bench.operator.review = lambda record: answers.pop() if answers else False
    bench.serve(1)
    begin = caplog.messages.index("Judged as failure: as scripted")
    for place, line in enumerate(lines, 1):
        assert caplog.messages[begin + place].startswith(line)


def test_an_unknown_outcome_is_never_a_failure(run, tmp_path):
    learner, _ = open_round(run)
    world = ScriptedWorld([Outcome.UNKNOWN] * 3, looks=[Outcome.UNKNOWN])
    bench = AgentBench(run, tmp_path, world)
    bench.serve(3)
    assert any("unknown" in reason for reason in bench.operator.drops)
    assert sorted(item.trajectories[0].attempt for item in gather(learner, 3)) == [0, 0, 1]
    bench.leave()


def test_a_kept_episode_is_delivered_without_moving_again(run, tmp_path):
    learner, snapshot = open_round(run)
    first = AgentBench(run, tmp_path)
    item = WorkItem(0, 1, snapshot.sha256)
    lease = next(lease for lease in first.bus.lease(100) if lease.item.slot == 1)
    policy = Policy(first.bus.policy(lease), TASK.pairs, TASK.observation)
    trajectory = first.agent._perform(item, policy, threading.Event())
    first.agent._log.keep(item, [trajectory])
    first.bus._heartbeat._stop.set()  # killed before it could deliver
    first.bus._heartbeat._thread.join()
    second = AgentBench(run, tmp_path)
    second.serve(3)
    assert second.world.resets == 2
    result = next(result for result in gather(learner, 3) if result.slot == 1)
    np.testing.assert_array_equal(result.trajectories[0].arguments, trajectory.arguments)
    second.leave()


def test_the_log_is_kept_until_a_checkpoint_covers_it(run, bench):
    open_round(run)
    bench.serve(3)
    log = bench.agent._log
    assert len(log) == 3
    RunRecords(connect(run.url)).set_progress(run.name, round_index=0, version=0)
    assert log.forget(0) == 0
    assert log.forget(1) == 3
    assert len(log) == 0


def test_a_redis_that_dies_loses_nothing(tmp_path):
    with EmbeddedRedis(tmp_path / "redis") as server, Run(server.url, CONFIG) as run:
        learner, _ = open_round(run)
        bench = AgentBench(run, tmp_path / "agent")
        killed = []

        def kill_once() -> None:
            if not killed:
                killed.append(server.pid)
                os.kill(server.pid, signal.SIGKILL)

        bench.world.on_reset = kill_once
        bench.serve(3)
        assert killed
        assert {result.slot for result in gather(learner, 3)} == {0, 1, 2}
        assert bench.world.resets == 3
        bench.leave()


def test_robots_and_simulation_never_serve_the_same_run(run, bench):
    worker = WorkerBus(connect(run.url), run.name, "worker")
    with pytest.raises(ConfigError, match="served by robot agents"):
        worker.join()


def test_a_robot_runs_one_episode_a_slot(shared_redis, tmp_path):
    four_each = RunConfig(task="lateral-lifting")
    with Run(shared_redis.url, four_each) as run, pytest.raises(ConfigError, match="--agent robot"):
        AgentBench(run, tmp_path)


def test_an_episode_that_is_dropped_for_ever_ends_the_agent(run, tmp_path):
    open_round(run)
    bench = AgentBench(run, tmp_path, ScriptedWorld([Outcome.UNKNOWN] * 100, looks=[Outcome.UNKNOWN] * 100))
    with pytest.raises(EpisodeDroppedError, match="dropped 20 times"):
        bench.serve(3)
    bench.leave()


def test_a_damaged_log_is_named(tmp_path):
    log = EpisodeLog(tmp_path, TrajectoryFormat.of(TASK, CONFIG))
    item = WorkItem(0, 0, "0" * 64)
    assert log.find(item) is None
    (tmp_path / "000000-000000.episode").write_bytes(b"nonsense")
    with pytest.raises(RobotError, match="damaged"):
        log.find(item)
    assert log.drop(item) == 1
    assert log.drop(item) == 2
    assert log.attempts(item) == 2
