"""The learner's memory: `python -m bench.learner_memory SLOTS < MESSAGE` prints its peak [bytes].

The message is one slot's, as a worker sends it; it stands for every slot of the round that the learner
updates with. A process of its own, since memory that was once used is not given back; without a simulator,
as in the learner's image.
"""

import dataclasses
import re
import subprocess
import sys
from pathlib import Path

from taskschema.config import RunConfig
from taskschema.tasks.registry import get_task
from taskschema.trajectory import TrajectoryFormat, decode_slot
from taskschema_learner.learner import Learner

TASK = "lateral-lifting"


def measure(message: bytes, slots: int) -> int:
    """Return the resident memory that a learner of so many slots a round has needed at most [bytes]."""
    words = [sys.executable, "-m", "bench.learner_memory", str(slots)]
    done = subprocess.run(words, input=message, stdout=subprocess.PIPE, check=True)
    return int(done.stdout)


def main() -> None:
    slots, message = int(sys.argv[1]), sys.stdin.buffer.read()
    config, task = RunConfig(task=TASK, slots=slots), get_task(TASK)
    learner, expected = Learner(config, task), TrajectoryFormat.of(task, config)
    trajectories = [
        dataclasses.replace(item, slot=slot)
        for slot in range(slots)
        for item in decode_slot(message, expected)
    ]
    learner.update(trajectories)
    print(_peak())


def _peak() -> int:
    # Not getrusage: its figure outlives `exec`, and may be that of the process which started this one.
    match = re.search(r"^VmHWM:\s+(\d+) kB$", Path("/proc/self/status").read_text(), re.MULTILINE)
    assert match is not None
    return 1024 * int(match[1])


if __name__ == "__main__":
    main()
