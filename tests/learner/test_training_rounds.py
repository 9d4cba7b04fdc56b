"""When rounds open: workers run the next one while the world is told of the last."""

import threading
from dataclasses import replace
from pathlib import Path

import pytest
from bus_setup import wait_until

from taskschema.bus.connection import connect
from taskschema.bus.records import RunRecords
from taskschema.config import RunConfig, override
from taskschema.errors import UnknownNameError
from taskschema.metrics import RoundMetrics
from taskschema.schema import SchemaView
from taskschema_learner import composition
from taskschema_learner.composition import TrainOptions, run_training
from taskschema_learner.runs.folder_state import folder_state
from taskschema_learner.runs.progress import Limits, Progress
from taskschema_learner.runs.run_folder import RunFolder
from taskschema_learner.training import TrainingContext
from taskschema_learner.update.algorithms import ALGORITHMS
from taskschema_learner.update.reinforce import Reinforce

ROUNDS = 3


class Watcher:
    """Notes which round status names, and which policy is published, when a round is announced."""

    def __init__(self, redis_url: str, run: str) -> None:
        self.records, self.run = RunRecords(connect(redis_url)), run
        self.announced: list[tuple[int, int | None, int]] = []
        self.pause_in: int | None = None

    def on_start(self, context: TrainingContext, rounds_done: int, progress: Progress) -> None:
        self.round, self.context = rounds_done, context

    def on_collecting(self, slots_done: int, slots: int) -> None:
        if self.round == self.pause_in:
            self.records.request(self.run, "pause")

    def on_round(self, metrics: RoundMetrics, schema: SchemaView, used_steps: int | None) -> None:
        policy = self.records.policy(self.run)
        assert policy is not None
        self.announced.append((metrics.round, self.records.status(self.run).round, policy.version))
        self.round += 1
        self.records.request(self.run, "resume")

    def on_finish(self, reason: str, finished: bool) -> None:
        self.finished = finished


@pytest.fixture
def options(shared_redis, tmp_path: Path, request) -> TrainOptions:
    name = f"rounds-{request.node.name.replace('_', '-')}"
    return TrainOptions(
        RunConfig(task="toy", slots=4),
        tmp_path / name,
        workers=0,
        limits=Limits(None, ROUNDS),
        redis=shared_redis.url,
        api=None,
    )


@pytest.mark.parametrize("field", ["ppo.algorithm", "schema.trainer"])
def test_an_unknown_method_is_refused_before_anything_is_written(options, field, monkeypatch):
    monkeypatch.setattr(composition, "open_folder", lambda options: pytest.fail("a folder was made"))
    config = override(options.config, {field: "guesswork"})
    with pytest.raises(UnknownNameError, match="Valid: "):
        run_training(replace(options, config=config), Watcher(options.redis, options.run_dir.name))


def test_an_algorithm_of_one_s_own_trains(options, monkeypatch):
    monkeypatch.setitem(ALGORITHMS, "mine", Reinforce)
    mine = replace(options, config=override(options.config, {"ppo.algorithm": "mine"}))
    assert run_training(mine, Watcher(options.redis, options.run_dir.name))


def test_the_next_round_is_open_before_the_last_is_announced(options):
    watcher = Watcher(options.redis, options.run_dir.name)
    assert run_training(options, watcher)
    assert (watcher.context.agent, watcher.context.workers) == ("simulation", None)
    # After the last one there is nothing to open: status still names it, on the policy that came of it.
    assert watcher.announced == [(0, 1, 1), (1, 2, 2), (2, 2, 3)]
    assert [row.round for row in watcher.records.curve(watcher.run)] == [0, 1, 2]


def test_no_round_opens_while_the_run_is_to_pause(options):
    watcher = Watcher(options.redis, options.run_dir.name)
    watcher.pause_in = 1
    assert run_training(options, watcher)
    assert watcher.announced == [(0, 1, 1), (1, 1, 2), (2, 2, 3)]


def test_the_next_learner_obeys_the_stop_of_a_dead_one(options):
    watcher = Watcher(options.redis, options.run_dir.name)
    assert run_training(replace(options, limits=Limits(None, 1)), watcher)
    watcher.records.set_state(watcher.run, "failed")
    watcher.records.request(watcher.run, "stop")
    resumed = replace(options, resume=True)
    assert not run_training(resumed, watcher)
    assert watcher.records.status(watcher.run).state == "stopped"
    assert [announced[0] for announced in watcher.announced] == [0]
    assert run_training(resumed, watcher)
    assert [announced[0] for announced in watcher.announced] == [0, 1, 2]


def test_the_start_knows_who_runs_the_episodes(options):
    watcher = Watcher(options.redis, options.run_dir.name)
    watcher.records.request(watcher.run, "stop")
    assert not run_training(replace(options, agent="robot"), watcher)
    assert (watcher.context.agent, watcher.context.workers) == ("robot", None)


def test_a_paused_run_stays_paused_when_resumed(options):
    watcher = Watcher(options.redis, options.run_dir.name)
    assert run_training(replace(options, limits=Limits(None, 1)), watcher)
    watcher.records.request(watcher.run, "pause")
    training = threading.Thread(target=run_training, args=(replace(options, resume=True), watcher))
    training.start()
    wait_until(lambda: watcher.records.status(watcher.run).state == "paused")
    watcher.records.request(watcher.run, "resume")
    training.join()
    assert watcher.finished
    assert [announced[0] for announced in watcher.announced] == [0, 1, 2]


class Stopper(Watcher):
    """Notes what the folder tells, and asks for a stop before a round."""

    def __init__(self, options: TrainOptions, stop_before: int) -> None:
        super().__init__(options.redis, options.run_dir.name)
        self.path, self.stop_before, self.states = options.run_dir, stop_before, set()

    def on_collecting(self, slots_done: int, slots: int) -> None:
        self.states.add(folder_state(RunFolder.open(self.path), self.round).state)

    def on_round(self, metrics: RoundMetrics, schema: SchemaView, used_steps: int | None) -> None:
        super().on_round(metrics, schema, used_steps)
        if self.round == self.stop_before:
            self.records.request(self.run, "stop")


def test_the_folder_tells_what_the_run_is_doing(options):
    watcher, goes_on = Stopper(options, ROUNDS + 1), replace(options, limits=Limits(None, 5), resume=True)
    assert run_training(options, watcher)
    folder = RunFolder.open(options.run_dir)
    assert watcher.states == {"running"}
    assert folder_state(folder, ROUNDS) == ("finished", "3 rounds are done")
    assert not run_training(goes_on, watcher)
    assert folder_state(folder, folder.read_metrics()[-1].policy_version).state == "stopped"
    watcher.stop_before = 0
    assert run_training(goes_on, watcher)
    assert folder_state(folder, 5) == ("finished", "5 rounds are done")
