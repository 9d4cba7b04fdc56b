"""How much faster than real time a twin trains: `python -m studies.twin_pace heavy-bar --episodes 20`.

Runs episodes of the initial policy over real sockets, as `studies.robot_twin` does, without a learner. The
pace by processor time is what the pace is on a machine that has nothing else to do.
"""

import argparse
import time
from contextlib import ExitStack

import numpy as np

from taskschema.config import RunConfig
from taskschema.policies import policy_of
from taskschema.randomness import EpisodeKey
from taskschema.safety.limits import SafetyLimits
from taskschema.tasks.registry import get_task
from taskschema.tasks.scene_task import SceneTask
from taskschema_learner.learner import Learner
from taskschema_learner.machine import machine
from taskschema_robot.agent.episode import EpisodeRunner
from taskschema_robot.agent.twin_world import TrueWorld
from taskschema_robot.cli.arms import own_twin, twin_hardware
from taskschema_robot.objects.catalogue import get_object
from taskschema_robot.safety.fault import FaultError
from taskschema_robot.safety.gate import SafetyGate


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("object")
    parser.add_argument("--episodes", type=int, default=20)
    parser.add_argument("--rate", type=int, default=50, help="set-points a second")
    arguments = parser.parse_args()
    with ExitStack() as stack:
        print(_measure(stack, arguments))


def _measure(stack: ExitStack, arguments: argparse.Namespace) -> str:
    item = get_object(arguments.object)
    task = get_task(item.family.replace("_", "-"))
    assert isinstance(task, SceneTask)
    config = RunConfig(task=item.family.replace("_", "-"), policy="oracle", episodes_per_slot=1)
    policy = policy_of(config, task, Learner(config, task).snapshot())
    limits = SafetyLimits(period=1.0 / arguments.rate)
    hardware = twin_hardware(stack, own_twin(stack, item), limits.period)
    gate = SafetyGate(hardware.drivers, hardware.clock, limits)
    assert hardware.twin is not None
    world = TrueWorld(hardware.twin, task, item, hardware.clock)
    gate.prepare()
    runner = EpisodeRunner(task, np.array(item.size), gate, world, hardware.clock, limits)
    began = hardware.clock.now(), time.monotonic(), time.process_time()
    for slot in range(arguments.episodes):
        try:
            runner.run(EpisodeKey(config.seed, 0, slot, episode=0, attempt=0), policy)
        except FaultError:
            gate.acknowledge("the bench")
            runner.recover()
    ended = hardware.clock.now(), time.monotonic(), time.process_time()
    simulated, wall, processor = (after - before for after, before in zip(ended, began, strict=True))
    return (
        f"{machine()}: {arguments.episodes} episodes, {simulated:.0f} s on the twin's clock in {wall:.1f} s: "
        f"{simulated / wall:.1f} times real time, {simulated / processor:.1f} times by processor time"
    )


if __name__ == "__main__":
    main()
