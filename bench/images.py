"""What seeing costs: `python -m bench.images` prints frames, passes and skill steps per second, and shares.

On lateral lifting, with the schema given: rounds on images that one worker and the learner make after one
another, over a Redis of their own, each part timed by itself. `python -m bench.image_training` measures whole
trainings, where workers share the cores. `--write` brings the figures into docs/train-from-images.md.
"""

import argparse
import tempfile
import time
from collections import defaultdict
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import torch
from threadpoolctl import threadpool_limits

from bench.report import with_section
from taskschema.bus.admission import SlotResult
from taskschema.bus.connection import connect
from taskschema.bus.learner_bus import LearnerBus
from taskschema.bus.records import RunRecords
from taskschema.bus.worker_bus import WorkerBus
from taskschema.config import ImageConfig, RunConfig
from taskschema.policies import ImagePolicy, PolicySnapshot
from taskschema.randomness import EpisodeKey, Purpose, generator, round_generator
from taskschema.tasks.lateral_lifting import LateralLifting
from taskschema.trajectory import encode_slot
from taskschema_learner.embedded_redis import EmbeddedRedis
from taskschema_learner.learner import Learner
from taskschema_learner.machine import machine, today
from taskschema_learner.networks.initial_weights import initial_spatial_weights
from taskschema_learner.networks.spatial_network import SpatialNetwork
from taskschema_worker.seen_scene_environment import SeenSceneEnvironment
from taskschema_worker.worker import Worker

PAGE = Path(__file__).parents[1] / "docs" / "train-from-images.md"
BEGIN = "<!-- measured: written by python -m bench.images -->"
RUN = "bench"
TASK = LateralLifting()
RENDERING, ACTING, RUNNING, SENDING = "rendering", "acting", "running", "sending"
COLLECTING, TAKING_IN, LEARNING = "collecting", "taking in", "learning"
PARTS = (
    "rendering",
    "acting",
    "simulation and planning",
    "leasing, and waiting for what is sent",
    "taking in what was sent",
    "learning",
)


class Spent:
    """Wall time and this process's processor time [s], by part of the work."""

    def __init__(self) -> None:
        self.wall: defaultdict[str, float] = defaultdict(float)
        self.processor: defaultdict[str, float] = defaultdict(float)

    @property
    def clocks(self) -> tuple[dict[str, float], dict[str, float]]:
        """Wall time, then processor time."""
        return self.wall, self.processor

    @contextmanager
    def on(self, part: str) -> Iterator[None]:
        """Count what happens inside."""
        wall, processor = time.perf_counter(), time.process_time()
        yield
        self.wall[part] += time.perf_counter() - wall
        self.processor[part] += time.process_time() - processor

    def method(self, owner: type, name: str, part: str) -> Any:
        """Count the calls of a method while the returned context is entered."""
        original = getattr(owner, name)

        def counted(*arguments: Any) -> Any:
            with self.on(part):
                return original(*arguments)

        return patch.object(owner, name, counted)


def rounds(slots: int, count: int) -> list[str]:
    """Return lines that say how the time of some rounds on images is spent."""
    config = RunConfig(task=TASK.name, policy="oracle", observation="image", slots=slots)
    spent, steps, message_bytes = Spent(), 0, []
    with ExitStack() as stack:
        folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="bench-"))
        url = stack.enter_context(EmbeddedRedis(Path(folder))).url
        RunRecords(connect(url)).register_run(RUN, config)
        learner, bus = Learner(config, TASK), LearnerBus(connect(url), RUN, config)
        bus.acquire()
        worker = Worker(WorkerBus(connect(url), RUN, "bench"))
        stack.callback(worker.close)
        stack.enter_context(spent.method(SeenSceneEnvironment, "frames", RENDERING))
        stack.enter_context(spent.method(ImagePolicy, "act", ACTING))
        stack.enter_context(spent.method(Worker, "_collect", RUNNING))
        stack.enter_context(spent.method(WorkerBus, "submit", SENDING))
        for number in range(count):
            bus.open_round(number, learner.snapshot(), range(slots))
            results: list[SlotResult] = []
            while bus.missing:
                with spent.on(COLLECTING):
                    worker.run_once(1)
                with spent.on(TAKING_IN):
                    results += bus.results(0.1)
            trajectories = [item for result in results for item in result.trajectories]
            with spent.on(LEARNING):
                learner.update(trajectories)
            bus.trim(number)
            steps += sum(map(len, trajectories))
            message_bytes += [len(encode_slot(result.trajectories)) for result in results]
    return [*_tables(spent, steps), "", *_sending(spent, message_bytes)]


def _sending(spent: Spent, message_bytes: list[int]) -> list[str]:
    sending, running, collecting = (spent.wall[part] for part in (SENDING, RUNNING, COLLECTING))
    milliseconds = 1e3 * sending / len(message_bytes)
    return [
        f"A slot has {np.mean(message_bytes) / 1e6:.2f} MB and takes {milliseconds:.1f} ms to send: "
        f"{sending / (running + sending):.1%} of a worker's wall time,",
        f"if it had to wait for that. Leasing and waiting, as it is: {1 - running / collecting:.1%}.",
    ]


def _tables(spent: Spent, steps: int) -> list[str]:
    """Return rates and shares; every step has one frame, which is seen once to act."""
    rates = {
        "overhead frames rendered": [steps / clock[RENDERING] for clock in spent.clocks],
        "passes of the small trunk to act": [steps / clock[ACTING] for clock in spent.clocks],
        "skill steps from images, with learning": [steps / sum(_parts(clock)) for clock in spent.clocks],
    }
    lines = ["| a second | of wall time | of processor time |", "|---|---|---|"]
    lines += [f"| {name} | {wall:.1f} | {processor:.1f} |" for name, (wall, processor) in rates.items()]
    lines += ["", "| share | of wall time | of processor time |", "|---|---|---|"]
    shares = [[part / sum(_parts(clock)) for part in _parts(clock)] for clock in spent.clocks]
    return lines + [
        f"| {name} | {wall:.1%} | {processor:.1%} |"
        for name, wall, processor in zip(PARTS, *shares, strict=True)
    ]


def _parts(clock: dict[str, float]) -> list[float]:
    """Return the seconds of each of `PARTS`."""
    simulation = clock[RUNNING] - clock[RENDERING] - clock[ACTING]
    waiting = clock[COLLECTING] - clock[RUNNING]
    return [clock[RENDERING], clock[ACTING], simulation, waiting, clock[TAKING_IN], clock[LEARNING]]


def frozen_trunk(frames: int) -> list[str]:
    """Return lines on passes of the frozen trunk, and on an epoch on its cached maps against running it."""
    config = RunConfig(task=TASK.name, observation="image", image=ImageConfig(trunk="vgg16"))
    weights = initial_spatial_weights(round_generator(0, 0, Purpose.INITIAL_WEIGHTS), config, TASK)
    network = SpatialNetwork(TASK, config.image)
    network.load(weights)
    keys = [EpisodeKey(0, 0, 0, index) for index in range(frames)]
    streams = [generator(key, Purpose.ACTION) for key in keys]
    rng = generator(keys[0], Purpose.RESET)
    seen = rng.integers(0, 256, (frames, 256, 256, 3), dtype=np.uint8)
    snapshot = PolicySnapshot(0, weights, np.zeros((TASK.horizon, len(TASK.pairs))))
    policy, spent = ImagePolicy(snapshot, TASK, "vgg16"), Spent()
    with spent.on("act"):
        policy.act(seen, 0, streams)
    with spent.on("learn"):
        features = network.inputs(seen)
    with spent.on("epoch"):
        evaluation = network(features)
        loss = evaluation.mean.square().mean() + evaluation.response.square().mean()
        torch.autograd.grad(loss, network.flat)
    clock = spent.processor
    return [
        "",
        f"Passes of VGG16's trunk a second of processor time: {frames / clock['act']:.2f} to act, in numpy, "
        f"{frames / clock['learn']:.2f} to learn. An epoch",
        f"of PPO on its cached maps takes {clock['epoch'] / clock['learn']:.1%} of the time of running it.",
    ]


def main() -> None:
    """Measure with products on one thread; other work on the machine changes the wall time alone."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--slots", type=int, default=25)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--frames", type=int, default=8, help="that VGG16 sees; 0: leave it out")
    parser.add_argument("--write", action="store_true", help=f"bring the figures into {PAGE.name}")
    options = parser.parse_args()
    size = f"{options.rounds} rounds of {options.slots} slots"
    with threadpool_limits(limits=1):
        torch.set_num_threads(1)
        lines = [f"{today()}, on {machine()}, products on one thread; {size}.", ""]
        lines += rounds(options.slots, options.rounds)
        if options.frames:
            lines += frozen_trunk(options.frames)
    publish("\n".join(lines), BEGIN, write=options.write)


def publish(text: str, begin: str, *, write: bool) -> None:
    """Print a section of the page, and if wanted write it between its marks there."""
    print(text)
    if write:
        PAGE.write_text(with_section(PAGE.read_text(encoding="utf-8"), text, begin), encoding="utf-8")


if __name__ == "__main__":
    main()
