"""What Ray itself takes of the cores while its actors do nothing: `python -m bench.idle_actors [ACTORS]`.

It bounds row 5: fifty processes share with each other what this leaves. Actors here hold none of our code.
"""

import argparse
import time
from typing import Any

import psutil

from taskschema_learner.machine import machine
from taskschema_learner.workers.ray_runtime import RayRuntime

CALM_SECONDS = 10.0
"""For what starts with the actors to end [s]."""
SECONDS = 30.0


class Idle:
    """An actor that waits."""

    def pid(self) -> int:
        """Return its process."""
        return psutil.Process().pid


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("actors", type=int, nargs="?", default=10)
    count = parser.parse_args().actors
    runtime = RayRuntime()
    runtime.start()
    try:
        print(f"On {machine()}: {measure(count)}")
    finally:
        runtime.stop()


def measure(count: int) -> str:
    """Return what so many idle actors took of a core, each of them and their node."""
    import ray

    remote: Any = ray.remote(Idle).options(num_cpus=0, max_concurrency=3)
    actors = [remote.remote() for _ in range(count)]
    pids = set(ray.get([actor.pid.remote() for actor in actors]))
    time.sleep(CALM_SECONDS)
    processes = psutil.Process().children(recursive=True)
    before = {process: _cpu_seconds(process) for process in processes}
    switches = sum(_wakes(process) for process in processes if process.pid in pids)
    time.sleep(SECONDS)
    used = {process: _cpu_seconds(process) - seconds for process, seconds in before.items()}
    woken = sum(_wakes(process) for process in processes if process.pid in pids) - switches
    each = sum(seconds for process, seconds in used.items() if process.pid in pids) / count / SECONDS
    node = sum(seconds for process, seconds in used.items() if process.pid not in pids) / SECONDS
    return (
        f"{count} idle actors take {each:.2%} of a core each, woken {woken / count / SECONDS:.0f} times a "
        f"second; Ray's own processes {node:.1%} together; 50 actors {50 * each:.0%} of a core"
    )


def _cpu_seconds(process: psutil.Process) -> float:
    times = process.cpu_times()
    return float(times.user + times.system)


def _wakes(process: psutil.Process) -> int:
    """Return how often the main thread gave up its core of itself."""
    return int(process.num_ctx_switches().voluntary)


if __name__ == "__main__":
    main()
