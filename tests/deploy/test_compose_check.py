"""`make compose-test` ends with one line and takes everything down, however it ends."""

import os
import signal
import subprocess
from pathlib import Path

import pytest
from tests.compose import __main__ as check


class Recorded:
    """Stands where the stack does, without an engine."""

    last: "Recorded"

    def __init__(self, compose: list[str], folder: Path, task: str) -> None:
        Recorded.last = self
        self.folder, self.cleaned = folder, 0
        (folder / "compose.env").write_text("RAY_AUTH_TOKEN=secret\n")

    def clean(self) -> None:
        self.cleaned += 1

    def compose(self, *words: str) -> str:
        raise RuntimeError("the engine is gone")


@pytest.fixture
def removed(monkeypatch):
    """Return the images that are removed in the end; a build makes one dangling."""
    dangling, removed = [{"old"}, {"old", "new"}], []
    monkeypatch.setattr(check, "compose_command", lambda: ["docker-compose"])
    monkeypatch.setattr(check, "Stack", Recorded)
    monkeypatch.setattr(check, "dangling_images", lambda: dangling.pop(0))
    monkeypatch.setattr(check, "remove_images", removed.extend)
    before = signal.getsignal(signal.SIGTERM)
    yield removed
    signal.signal(signal.SIGTERM, before)


@pytest.mark.parametrize(
    "error",
    [
        AssertionError("another hash"),
        RuntimeError("up: no"),
        TimeoutError("no sign of 2 workers"),
        ValueError("too many values to unpack"),
        subprocess.CalledProcessError(1, "docker"),
        subprocess.TimeoutExpired("docker", 300),
    ],
    ids=lambda error: type(error).__name__,
)
def test_every_failure_is_one_line_and_leaves_nothing(monkeypatch, capsys, removed, error) -> None:
    def fail(stack):
        raise error

    monkeypatch.setattr(check, "check", fail)
    assert check.main() == 1
    assert capsys.readouterr().out == f"compose-test: FAILED: {type(error).__name__}: {error}\n"
    assert Recorded.last.cleaned == 2
    assert not Recorded.last.folder.exists()
    assert removed == ["new"]


def test_a_signal_takes_everything_down(monkeypatch, removed) -> None:
    monkeypatch.setattr(check, "check", lambda stack: os.kill(os.getpid(), signal.SIGTERM))
    with pytest.raises(SystemExit, match="compose-test: FAILED: ended by signal 15"):
        check.main()
    assert Recorded.last.cleaned == 2
    assert not Recorded.last.folder.exists()
    assert removed == ["new"]
