"""Checkpoints are whole or refused, and a failed write costs nothing."""

import logging
import random
import resource
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from taskschema.errors import RunFolderError
from taskschema_learner.runs.checkpoint import Checkpoint, load_latest, save


def checkpoint(number: int, size: int = 50) -> Checkpoint:
    arrays = {
        "weights.mean": np.arange(size, dtype=np.float32) + number,
        "schema.logits": np.full((3, 9), float(number)),
        "version": np.array(number, dtype=np.int64),
        "nothing": np.zeros(0, dtype=np.int64),
    }
    return Checkpoint(number, token=7, arrays=arrays, metadata={"progress": '{"episodes": 12}', "é": "ü"})


def test_comes_back_as_it_was(tmp_path: Path) -> None:
    written = checkpoint(3)
    path = save(tmp_path / "checkpoints", written)
    assert path.is_file()
    read = load_latest(tmp_path / "checkpoints")
    assert read is not None
    assert (read.round, read.token, read.metadata) == (3, 7, written.metadata)
    assert read.arrays.keys() == written.arrays.keys()
    for name, array in written.arrays.items():
        assert read.arrays[name].dtype == array.dtype
        assert read.arrays[name].shape == array.shape
        assert np.array_equal(read.arrays[name], array)


def test_arrays_that_are_not_contiguous(tmp_path: Path) -> None:
    array = np.arange(12.0).reshape(3, 4).T
    save(tmp_path, Checkpoint(0, 0, {"a": array}))
    read = load_latest(tmp_path)
    assert read is not None
    assert np.array_equal(read.arrays["a"], array)


def test_only_the_last_few_are_kept(tmp_path: Path) -> None:
    for number in range(12):
        save(tmp_path, checkpoint(number), keep=3)
    assert sorted(path.name[:14] for path in tmp_path.iterdir()) == [f"round-{n:08d}" for n in (9, 10, 11)]
    read = load_latest(tmp_path)
    assert read is not None
    assert read.round == 11


def test_no_checkpoint_is_none(tmp_path: Path) -> None:
    assert load_latest(tmp_path) is None
    assert load_latest(tmp_path / "missing") is None


@pytest.mark.parametrize("seed", range(20))
def test_damage_anywhere_is_refused_and_the_one_before_is_used(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, seed: int
) -> None:
    rng = random.Random(seed)
    save(tmp_path, checkpoint(1))
    newest = save(tmp_path, checkpoint(2))
    data = bytearray(newest.read_bytes())
    if seed % 2:
        del data[rng.randrange(len(data)) :]
    else:
        data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
    newest.write_bytes(bytes(data))
    with caplog.at_level(logging.WARNING):
        read = load_latest(tmp_path)
    assert read is not None
    assert read.round == 1
    assert newest.name in caplog.text
    assert "refused" in caplog.text


def test_all_bad_is_an_error_of_one_line(tmp_path: Path) -> None:
    for number in range(2):
        save(tmp_path, checkpoint(number)).write_bytes(b"")
    with pytest.raises(RunFolderError, match="None of the 2 checkpoints") as caught:
        load_latest(tmp_path)
    assert "\n" not in str(caught.value)


def test_half_written_files_are_no_checkpoints(tmp_path: Path) -> None:
    path = save(tmp_path, checkpoint(1))
    (tmp_path / "round-00000002-abc.part").write_bytes(path.read_bytes()[:100])
    read = load_latest(tmp_path)
    assert read is not None
    assert read.round == 1
    save(tmp_path, checkpoint(2))
    assert sorted(item.suffix for item in tmp_path.iterdir()) == [".safetensors"] * 2


_FULL_DISK = """
import sys
from pathlib import Path
import numpy as np
from taskschema.errors import RunFolderError
from taskschema_learner.runs.checkpoint import Checkpoint, save
try:
    save(Path(sys.argv[1]), Checkpoint(2, 0, {"big": np.zeros(100_000)}))
except RunFolderError as error:
    print(error)
    sys.exit(1)
"""


def test_no_room_is_one_line_and_costs_nothing(tmp_path: Path) -> None:
    """A limit on the size of files stands for a full disk: the write fails halfway in the same way."""
    save(tmp_path, checkpoint(1))
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    result = subprocess.run(
        [sys.executable, "-c", _FULL_DISK, str(tmp_path)],
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000)),
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert result.returncode == 1, result.stderr
    assert result.stdout.count("\n") == 1
    assert "--resume" in result.stdout
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before
    read = load_latest(tmp_path)
    assert read is not None
    assert read.round == 1


def test_a_folder_that_cannot_be_made(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(RunFolderError, match="cannot be written"):
        save(tmp_path / "file" / "checkpoints", checkpoint(1))
