"""`python -m tests.compose.many_workers 50`: so many worker containers on one machine.

Builds, brings the stack up with one worker, scales to N, waits until N workers live and rounds pass, measures
what the containers hold, and compares the run's hash with that of the same run embedded. It leaves nothing
behind, and needs some 0.35 GiB of memory a worker. With `--write` what the containers hold goes to
bench/growth.json, for docs/scale.md.
"""

import argparse
import sys
import tempfile
import time
from pathlib import Path

from bench import growth, report
from tests.compose.comparison import embedded_hash, finish
from tests.compose.ending import FAILURES, leave_in_order
from tests.compose.engine import SkippedError, compose_command
from tests.compose.stack import PROFILES, RUN, Stack

TASK = "lateral-lifting"
PATIENCE_SECONDS = 1800.0
BYTES = {"KiB": 2**10, "MiB": 2**20, "GiB": 2**30}


def main() -> int:
    """Measure, and return the exit status."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("workers", type=int, help="how many containers")
    parser.add_argument("--write", action="store_true", help="keep what they hold in bench/growth.json")
    options = parser.parse_args()
    try:
        compose = compose_command()
    except SkippedError as reason:
        print(f"many-workers: skipped: {reason}.")
        return 0
    leave_in_order("many-workers")
    with tempfile.TemporaryDirectory(prefix="many-workers-") as folder:
        stack = Stack(compose, Path(folder), TASK, PATIENCE_SECONDS)
        stack.clean()
        try:
            line, containers = measure(stack, options.workers)
        except FAILURES as error:
            print(f"many-workers: FAILED: {type(error).__name__}: {error}")
            return 1
        finally:
            stack.clean()
    if options.write:
        growth.write(containers=containers)
        report.main()
    print(f"many-workers: {line}")
    return 0


def measure(stack: Stack, workers: int) -> tuple[str, growth.Containers]:
    """Run so many workers; return what was measured, on one line, and what their containers hold."""
    stack.compose(*PROFILES, "build")
    stack.compose("up", "-d", "--no-build", "--scale", "worker=1")
    stack.wait(lambda: stack.version() >= 0, f"run {RUN}")
    stack.post(f"/runs/{RUN}/pause")  # or the first workers make more rounds than can be compared
    started = time.monotonic()
    stack.compose("up", "-d", "--no-build", "--scale", f"worker={workers}")
    created = time.monotonic() - started
    join(stack, workers, started)
    joined = time.monotonic() - started
    stack.post(f"/runs/{RUN}/resume")
    stack.rounds_pass(2)
    held = {name: in_bytes(size) for name, size in stack.memory().items()}
    each = sorted(size for name, size in held.items() if name.startswith("worker"))
    (head,) = [size for name, size in held.items() if name.startswith("head")]
    a_round = stack.rounds_pass(2) / 2
    rounds, here = finish(stack, {RUN: "learner"})
    stack.compose("rm", "--stop", "--force", "worker")  # idle, they would take a core from what comes
    there = embedded_hash(stack, TASK, rounds)
    if here != there:
        raise AssertionError(f"the run's hash after {rounds} rounds is {here}, embedded it is {there}")
    line = (
        f"1 -> {workers} workers in {joined:.0f} s (their containers were made in {created:.0f} s); "
        f"a worker container holds {each[0] / 2**20:.0f} to {each[-1] / 2**20:.0f} MiB, "
        f"the head {head / 2**20:.0f}, all together "
        f"{sum(held.values()) / 2**30:.1f} GiB; {a_round:.1f} s a round; "
        f"hash {here[:12]} after {rounds} rounds equals the embedded run's"
    )
    return line, growth.Containers(workers, worker_bytes=each[-1], head_bytes=head)


def join(stack: Stack, workers: int, started: float) -> None:
    """Wait until so many workers live, and tell of each ten."""
    told = 0

    def all_live() -> bool:
        nonlocal told
        live = stack.live_workers()
        if live // 10 > told // 10:
            print(f"  {live} workers after {time.monotonic() - started:.0f} s", flush=True)
            told = live
        return live == workers

    stack.wait(all_live, f"{workers} workers")


def in_bytes(size: str) -> float:
    """Return what the engine writes as 331.2MiB."""
    return float(size[:-3]) * BYTES[size[-3:]]


if __name__ == "__main__":
    sys.exit(main())
