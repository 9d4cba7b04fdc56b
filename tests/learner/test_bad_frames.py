"""Trainings whose camera fails: real workers refuse what they cannot see, and the run waits to be mended."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bus_setup import Run, gather
from spatial_setup import some_weights

from taskschema.bus.connection import connect
from taskschema.bus.records import RunRecords
from taskschema.bus.worker_bus import WorkerBus
from taskschema.config import RunConfig
from taskschema.errors import QuarantineLimitError
from taskschema.policies import ImagePolicy, PolicySnapshot
from taskschema.tasks.registry import task_of
from taskschema.trajectory import encode_slot
from taskschema_learner.composition import TrainOptions, run_training
from taskschema_learner.runs.progress import Limits
from taskschema_learner.runs.recomputation import recompute
from taskschema_learner.runs.run_folder import RunFolder
from taskschema_worker.environments import environment_of
from taskschema_worker.rollout import collect_slots
from taskschema_worker.worker import Worker

CAPPED_TASK = """
from pathlib import Path
from taskschema.tasks.toy import Toy, ToyEnvironment

class CappedEnvironment(ToyEnvironment):
    '''While there is a cap, it is on the cameras of some episodes: by where their left handle is.'''

    def frames(self, episodes):
        frames = super().frames(episodes)
        covered = self._handles[episodes, 0, 0] < {covered}
        frames[covered & Path({cap!r}).exists()] //= 100
        return frames

class Capped(Toy):
    def make_environment(self, threads=1):
        return CappedEnvironment(self)
"""


class Quiet:
    """An observer that shows nothing."""

    def __getattr__(self, name):
        return lambda *arguments, **named: None


def capped(cap: Path, covered: float) -> RunConfig:
    """Return a run in which episodes with a handle left of `covered` [m] show nothing while `cap` exists."""
    source = CAPPED_TASK.format(cap=str(cap), covered=covered)
    return RunConfig(
        task="Capped", task_source=source, observation="image", slots=4, episodes_per_slot=2, seed=1
    )


@pytest.mark.parametrize("workers", [0, 1])
def test_a_black_camera_ends_the_run_in_one_line_and_it_goes_on_when_mended(shared_redis, tmp_path, workers):
    cap = tmp_path / "cap"
    cap.touch()
    config = capped(cap, covered=1.0)
    options = TrainOptions(
        config,
        tmp_path / f"capped-{workers}",
        workers=workers,
        limits=Limits(None, 1),
        redis=shared_redis.url,
        api=None,
    )
    with pytest.raises(QuarantineLimitError, match=r"^Slot \d of round 0 was refused 3 times.*black.*camera"):
        run_training(options, Quiet())
    records = RunRecords(connect(shared_redis.url))
    run = options.run_dir.name
    assert records.status(run).state == "failed"
    refused = records.quarantine_counts(run)
    assert refused.keys() == {"bad_frame"}
    assert 3 <= refused["bad_frame"] <= 12

    cap.unlink()
    assert run_training(replace(options, resume=True, workers=0), Quiet())
    row = RunFolder.open(options.run_dir).read_metrics()[-1]
    assert row.sha256 == [each.sha256 for each in recompute(config, 1)][-1], "as if nothing had happened"
    assert records.quarantine_counts(run)["bad_frame"] <= 12, "no slot was refused a fourth time"


def test_only_slots_that_show_nothing_are_refused(shared_redis, tmp_path):
    cap = tmp_path / "cap"
    config = capped(cap, covered=-0.05)
    task = task_of(config)
    snapshot = PolicySnapshot(0, some_weights(), np.zeros((3, 9)))
    expected = [
        encode_slot(item)
        for item in collect_slots(
            environment_of(config, task),
            ImagePolicy(snapshot, task, "small"),
            seed=config.seed,
            round_index=0,
            slots=range(4),
            episodes_per_slot=2,
            horizon=3,
        )
    ]
    cap.touch()
    with Run(shared_redis.url, config) as run:
        learner = run.learner()
        worker = Worker(WorkerBus(connect(run.url), run.name, "worker"))
        learner.open_round(0, snapshot, range(4))
        assert worker.run_once(1) == 4
        seen = {result.slot: encode_slot(result.trajectories) for result in gather(learner, 3)}
        (unseen,) = set(range(4)) - seen.keys()
        assert seen == {slot: data for slot, data in enumerate(expected) if slot != unseen}
        assert worker.run_once(1) == 1
        assert learner.results(1.0) == []
        assert worker.run_once(1) == 1
        with pytest.raises(QuarantineLimitError, match=f"Slot {unseen} of round 0 was refused 3 times"):
            learner.results(1.0)
        assert run.records.quarantine_counts(run.name) == {"bad_frame": 3}
        worker.close()
