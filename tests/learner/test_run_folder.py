"""The run's folder: atomic, versioned, locked, and clear about what is wrong."""

import json
import random
from pathlib import Path

import msgspec
import pytest

from taskschema.config import FORMAT_VERSION, RunConfig
from taskschema.errors import ConfigError, RunFolderError
from taskschema.metrics import RoundMetrics
from taskschema_learner.cli.run_reference import run_name
from taskschema_learner.runs.run_folder import RunFolder, write_atomically

CONFIG = RunConfig(task="toy", seed=7)


def row(number: int) -> RoundMetrics:
    values = {}
    for field in msgspec.structs.fields(RoundMetrics):
        values[field.name] = {int: number, float: number / 3, str: "ab"}.get(
            field.type, (0.1, 1e-17, number / 7)
        )
    return RoundMetrics(**values)


def test_what_is_created_can_be_opened(tmp_path):
    RunFolder.create(tmp_path / "run", CONFIG)
    folder = RunFolder.open(tmp_path / "run")
    assert (folder.config, folder.agent, folder.device) == (CONFIG, "simulation", "cpu")


def test_agent_and_device_come_back_where_they_were_written_down(tmp_path):
    RunFolder.create(tmp_path / "run", CONFIG, agent="robot", device="cuda")
    folder = RunFolder.open(tmp_path / "run")
    assert (folder.agent, folder.device) == ("robot", "cuda")
    path = folder.path / "config.json"
    content = json.loads(path.read_text())
    del content["agent"], content["device"]
    path.write_text(json.dumps(content))
    earlier = RunFolder.open(tmp_path / "run")
    assert (earlier.config, earlier.agent, earlier.device) == (CONFIG, None, None)


@pytest.mark.parametrize("place", [".", "../run", "sub/.."])
def test_a_run_has_its_folder_s_name_however_that_is_given(tmp_path, monkeypatch, place):
    (tmp_path / "run" / "sub").mkdir(parents=True)
    monkeypatch.chdir(tmp_path / "run")
    assert RunFolder.create(Path(place), CONFIG).name == "run"
    assert RunFolder.open(Path(place)).name == "run"
    assert run_name(place) == run_name("run") == "run"


def test_a_name_that_cannot_be_a_run_s_is_refused_before_anything_is_written(tmp_path):
    with pytest.raises(ConfigError, match="lower-case"):
        RunFolder.create(tmp_path / "UPPER", CONFIG)
    assert list(tmp_path.iterdir()) == []


def test_an_existing_run_is_not_overwritten(tmp_path):
    RunFolder.create(tmp_path / "run", CONFIG)
    with pytest.raises(RunFolderError, match="--resume"):
        RunFolder.create(tmp_path / "run", RunConfig(task="toy", seed=8))
    assert RunFolder.open(tmp_path / "run").config == CONFIG


def test_a_missing_run_is_named(tmp_path):
    with pytest.raises(RunFolderError, match="no run"):
        RunFolder.open(tmp_path / "nothing")


def test_another_format_version_says_what_to_do(tmp_path):
    RunFolder.create(tmp_path / "run", CONFIG)
    path = tmp_path / "run" / "config.json"
    content = json.loads(path.read_text())
    content["format_version"] = FORMAT_VERSION + 1
    content["unknown_field_of_a_later_version"] = 1
    path.write_text(json.dumps(content))
    with pytest.raises(RunFolderError, match="format version"):
        RunFolder.open(tmp_path / "run")


@pytest.mark.parametrize("seed", range(20))
def test_a_damaged_config_is_refused(tmp_path, seed):
    RunFolder.create(tmp_path / "run", CONFIG)
    path = tmp_path / "run" / "config.json"
    data = bytearray(path.read_bytes())
    path.write_bytes(data[: random.Random(seed).randrange(len(data) - 2)])
    with pytest.raises(RunFolderError, match=r"damaged|no run"):
        RunFolder.open(tmp_path / "run")


def test_metrics_come_back_exactly(tmp_path):
    folder = RunFolder.create(tmp_path / "run", CONFIG)
    rows = [row(number) for number in range(5)]
    for item in rows:
        folder.append_metrics(item)
    assert folder.read_metrics() == rows
    folder.keep_metrics(rows[:3])
    folder.append_metrics(rows[3])
    assert folder.read_metrics() == rows[:4]


def test_a_reader_sees_whole_rows_wherever_the_writer_is(tmp_path):
    folder = RunFolder.create(tmp_path / "run", CONFIG)
    rows = [row(number) for number in range(2)]
    for item in rows:
        folder.append_metrics(item)
    path = folder.path / "metrics.csv"
    data = path.read_bytes()
    for size in range(len(data) + 1):
        path.write_bytes(data[:size])
        assert folder.read_metrics() == rows[: max(data[:size].count(b"\n") - 1, 0)]


@pytest.mark.parametrize("text", ["round\n0\n", "round,schema_entropy,schema_probability\n0\n", "\xff\n"])
def test_metrics_of_another_shape_are_damaged(tmp_path, text):
    folder = RunFolder.create(tmp_path / "run", CONFIG)
    (folder.path / "metrics.csv").write_text(text, encoding="latin-1")
    with pytest.raises(RunFolderError, match="damaged"):
        folder.read_metrics()


def test_keeping_no_metrics_still_takes_new_ones(tmp_path):
    folder = RunFolder.create(tmp_path / "run", CONFIG)
    folder.append_metrics(row(0))
    folder.keep_metrics([])
    folder.append_metrics(row(1))
    assert folder.read_metrics() == [row(1)]


def test_a_second_lock_is_refused(tmp_path):
    folder = RunFolder.create(tmp_path / "run", CONFIG)
    with folder.locked():
        second = RunFolder.open(tmp_path / "run").locked()
        with pytest.raises(RunFolderError, match="Another learner"):
            second.__enter__()


def test_a_failed_write_changes_nothing(tmp_path, monkeypatch):
    path = tmp_path / "file"
    write_atomically(path, b"old")

    def full(descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(RunFolderError, match="No space left"):
        write_atomically(path, b"new")
    assert path.read_bytes() == b"old"
    assert [item.name for item in tmp_path.iterdir()] == ["file"]
