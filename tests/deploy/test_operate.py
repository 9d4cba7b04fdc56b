"""docs/operate.md: a run is backed up while it trains, and restored, with the commands that stand there."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from bus_setup import wait_until
from prometheus_client.parser import text_string_to_metric_families
from tests.compose.documented import script

from taskschema_learner.api.exposition import exposition
from taskschema_learner.api.folder_source import FolderSource
from taskschema_learner.runs.run_folder import RunFolder

DOCS = (Path(__file__).parents[2] / "docs/operate.md").read_text(encoding="utf-8")
COMMAND = Path(sys.executable).with_name("taskschema")
RUN = "toy-run"
PATIENCE_SECONDS = 240.0
"""For what takes seconds on an idle machine."""
TRAIN = ["train", "--rounds", "12", "--until-success", "0", "--workers", "0", "--api", "none"]


def documented(section: str) -> str:
    return script("operate.md", section).replace("lateral-lifting", RUN)


def shell(script: str, folder: Path) -> str:
    environment = {**os.environ, "PATH": f"{COMMAND.parent}:{os.environ['PATH']}"}
    done = subprocess.run(
        ["bash", "-euc", script],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        timeout=PATIENCE_SECONDS,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def rounds(run: Path) -> int:
    return len(RunFolder.open(run).read_metrics()) if (run / "metrics.csv").exists() else 0


@pytest.mark.timeout(900)
def test_a_run_is_backed_up_while_it_trains_and_restored(tmp_path: Path) -> None:
    run = tmp_path / "runs" / RUN
    slow = f"{Path(__file__).parents[1] / 'learner/slow_toy.py'}:SlowToy"
    words = [*TRAIN, "--task-file", slow, "--run-dir", str(run)]
    training = subprocess.Popen([COMMAND, *words], stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    try:
        wait_until(lambda: rounds(run) >= 3 or training.poll() is not None, seconds=PATIENCE_SECONDS)
        assert training.poll() is None, training.communicate()[0].decode()
        shell(documented("Back up a run"), tmp_path)
        assert training.poll() is None, "it was to be copied while it trains"
        output, _ = training.communicate(timeout=PATIENCE_SECONDS)
    finally:
        training.kill()
    assert training.returncode == 0, output.decode()
    # The documented command trains until it succeeds; this run is to end, and on its own.
    printed = shell(f"{documented('Restore a run').rstrip()} {' '.join(TRAIN[1:])}", tmp_path)
    hash_before = printed.splitlines()[0]
    restored = tmp_path / "restored" / RUN
    assert (restored / "redis/redis.conf").read_text() != (run / "redis/redis.conf").read_text()
    rows = RunFolder.open(restored).read_metrics()
    assert [row.round for row in rows] == list(range(12)), "no round is missing from the table"
    assert [row.sha256 for row in rows] == [row.sha256 for row in RunFolder.open(run).read_metrics()]
    assert hash_before in [row.sha256 for row in rows[:-1]], "the copy was of a round before the last"
    check_metrics_are_documented(restored)


def check_metrics_are_documented(run: Path) -> None:
    """Every metric that the API tells about a run stands in the table."""
    families = text_string_to_metric_families(exposition(FolderSource(run)).decode())
    named = set(re.findall(r"`(taskschema_\w+)", DOCS))
    for family in families:
        name = f"{family.name}_total" if family.type == "counter" else family.name
        name = re.sub(r"^(taskschema_api_process_).*", r"\1", name)
        assert name in named, name
