"""What seeing costs: `python -m bench.images` prints frames, passes and skill steps per second, and shares.

On lateral lifting, with the schema given: the steps of a training on images, timed one by one.
"""

import argparse
import time
from contextlib import closing

import numpy as np
import torch
from threadpoolctl import threadpool_limits

from taskschema.config import ImageConfig, RunConfig
from taskschema.policies import ImagePolicy, policy_of
from taskschema.randomness import EpisodeKey, Purpose, generator, round_generator
from taskschema.tasks.lateral_lifting import LateralLifting
from taskschema_learner.initial_weights import initial_spatial_weights
from taskschema_learner.learner import Learner
from taskschema_learner.machine import machine
from taskschema_learner.spatial_network import SpatialNetwork
from taskschema_worker.environments import make_environment
from taskschema_worker.rollout import collect_slots


def timed(environment: object, name: str, spent: dict[str, float]) -> None:
    """Count the processor time of a method under its name."""
    method = getattr(environment, name)

    def wrapper(*arguments):
        started = time.process_time()
        result = method(*arguments)
        spent[name] = spent.get(name, 0.0) + time.process_time() - started
        return result

    setattr(environment, name, wrapper)


def collecting(slots: int) -> None:
    """Print how the time of collecting trajectories on images is spent."""
    config = RunConfig(task="lateral-lifting", policy="oracle", observation="image", slots=slots)
    task = LateralLifting()
    learner = Learner(config, task)
    policy = policy_of(config, task, learner.snapshot())
    assert isinstance(policy, ImagePolicy)
    spent: dict[str, float] = {}
    with closing(make_environment(task, 1, "image")) as environment:
        timed(environment._environment, "frames", spent)
        timed(policy, "act", spent)
        started = time.process_time()
        found = collect_slots(
            environment, policy, seed=0, round_index=0, slots=range(slots), episodes_per_slot=4, horizon=3
        )
        seconds = time.process_time() - started
    trajectories = [item for slot in found for item in slot]
    steps, frames = sum(map(len, trajectories)), policy.trunk_passes
    started = time.process_time()
    learner.update(trajectories)
    update = time.process_time() - started
    total = seconds + update
    print(f"frames rendered: {frames / spent['frames']:.1f} per second")
    print(f"passes of the small trunk to act: {frames / spent['act']:.0f} per second")
    print(f"skill steps from images, with learning: {steps / total:.1f} per second")
    rest = seconds - spent["frames"] - spent["act"]
    for name, share in (
        ("rendering", spent["frames"]),
        ("acting", spent["act"]),
        ("simulation and planning", rest),
        ("learning", update),
    ):
        print(f"share of {name}: {share / total:.0%}")


def frozen_trunk(frames: int) -> None:
    """Print what an epoch on cached features costs against one that runs the frozen trunk."""
    config = RunConfig(task="lateral-lifting", observation="image", image=ImageConfig(trunk="vgg16"))
    task = LateralLifting()
    network = SpatialNetwork(task, config.image)
    network.load(initial_spatial_weights(round_generator(0, 0, Purpose.INITIAL_WEIGHTS), config, task))
    rng = generator(EpisodeKey(0, 0, 0, 0), Purpose.RESET)
    seen = rng.integers(0, 256, (frames, 256, 256, 3), dtype=np.uint8)
    started = time.process_time()
    features = network.inputs(seen)
    trunk = time.process_time() - started
    started = time.process_time()
    evaluation = network(features)
    loss = evaluation.mean.square().mean() + evaluation.response.square().mean()
    torch.autograd.grad(loss, network.flat)
    epoch = time.process_time() - started
    print(f"passes of VGG16's trunk to learn: {frames / trunk:.2f} per second")
    print(f"an epoch on cached features: {epoch / trunk:.1%} of running the trunk")


def main() -> None:
    """Measure processor time of all threads, products on one: other work on the machine does not count."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--slots", type=int, default=10)
    parser.add_argument("--frames", type=int, default=8)
    options = parser.parse_args()
    print(f"On {machine()}, processor time, products on one thread.")
    with threadpool_limits(limits=1):
        torch.set_num_threads(1)
        collecting(options.slots)
        frozen_trunk(options.frames)


if __name__ == "__main__":
    main()
