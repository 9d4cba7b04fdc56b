"""Nothing of a local Ray outlives the process that started it, not even one that is killed."""

import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path

WAIT_SECONDS = 5.0
"""Longest wait for the end of the reaping [s]; it takes milliseconds."""

# Standard library alone, in a process of its own: it waits until its input ends, as it does when the
# process at its other end dies, and then ends what is left. Ray's own agents look for their server for a
# minute before they give up. A process number that was given to somebody else meanwhile has another start.
_REAP = """
import os, shutil, signal, sys
def start(pid):
    try:
        with open(f"/proc/{pid}/stat") as file:
            return file.read().rpartition(")")[2].split()[19]
    except OSError:
        return None
first = [(int(word), start(word)) for word in sys.stdin.readline().split()]
sys.stdin.read()
for pid, began in first:
    if began is not None and start(pid) == began:
        try:
            os.kill(pid, signal.SIGKILL)
        except ProcessLookupError:
            pass
shutil.rmtree(sys.argv[1], ignore_errors=True)
"""


class RayReaper:
    """Ends processes and removes their folder when told to, or when this process dies.

    Args:
        folder: Ray's temporary folder.
        processes: process ids of Ray's servers and agents.

    """

    def __init__(self, folder: Path, processes: Iterable[int]) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-I", "-S", "-c", _REAP, str(folder)],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            text=True,
            start_new_session=True,  # what ends this process's group must not end it
        )
        assert self._process.stdin is not None
        self._process.stdin.write(" ".join(map(str, processes)) + "\n")
        self._process.stdin.flush()

    def reap(self) -> None:
        """End what is left and remove the folder."""
        assert self._process.stdin is not None
        self._process.stdin.close()
        self._process.wait(WAIT_SECONDS)
