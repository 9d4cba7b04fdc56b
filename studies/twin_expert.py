"""Can the nine objects be handled on the twin at all? `python -m studies.twin_expert [OBJECT ...]`.

A scripted expert makes the paper's schema through the safety gate, with the parts that `taskschema-robot run`
is made of: rosbridge over real sockets, in lock-step. `--write` replaces `results/robot-twin/expert.md`.
"""

import argparse
import logging
import time
from collections import Counter
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from taskschema.arrays import AnyArray
from taskschema.policies import Actions, Actor
from taskschema.randomness import EpisodeKey
from taskschema.safety.limits import SafetyLimits
from taskschema.tasks.registry import get_task, load_task_source, read_task_file
from taskschema.tasks.scene_task import SceneTask
from taskschema_learner.machine import machine
from taskschema_robot.agent.episode import EpisodeRunner
from taskschema_robot.agent.twin_world import TrueWorld
from taskschema_robot.agent.world import EpisodeDroppedError
from taskschema_robot.cli.arms import own_twin, twin_hardware
from taskschema_robot.objects.catalogue import OBJECTS, get_object
from taskschema_robot.objects.robot_object import RobotObject
from taskschema_robot.safety.fault import FaultError
from taskschema_robot.safety.gate import SafetyGate

OUT = Path("results/robot-twin/expert.md")
RATE = 50
"""Set-points a second."""
Values = dict[str, tuple[float, ...]]
"""Arguments of skills by name [SI], from the object's centre."""
TASKS = {
    "aluminium-tray": "docs/examples/tray.py:Tray",
    "rolling-pin": "docs/examples/carried.py:RollingPin",
    "plastic-box": "docs/examples/carried.py:Box",
}
"""Of objects that a task of their own describes; the others', by their family."""


def _t_handle(reach: float) -> tuple[Values, Values]:
    """Return a recipe that puts the hand behind a T-handle's near arm, `reach` [m] from its middle."""
    turn, behind = (np.pi, np.pi, 0.75 * np.pi), np.deg2rad(50.7)
    place = reach * np.array([np.cos(behind), np.sin(behind)])
    left, right = (
        {"go_to_pose": (*(side * place), 0.08, *turn), "rotate": (0.0, 0.0, 0.77 * reach)}
        for side in (-1.0, 1.0)
    )
    return left, right


BALL: tuple[Values, Values] = (
    {"top_grasp": (0.0, -0.1, 5.96), "lift": (0.32,)},
    {"go_to_pose": (0.053, 0.028, 0.005, 3.03, 2.95, 2.75), "lift": (0.27,)},
)
RECIPES: dict[str, tuple[Values, Values]] = {
    "soccer-ball": BALL,
    "t-wrench": _t_handle(0.115),
    "corkscrew": _t_handle(0.1),
}
"""Of the left and the right arm, where an object's expert is not its task's."""


class Expert(Actor):
    """Makes the paper's schema, then no-ops."""

    def __init__(self, task: SceneTask, recipe: tuple[Values, Values]) -> None:
        self._task, self._recipe = task, recipe

    def act(self, observations: AnyArray, step: int, generators: Sequence[np.random.Generator]) -> Actions:
        """Return what it does in one episode; see `Actor`."""
        task = self._task
        made = step < len(task.paper_pairs)
        pair = int(task.paper_pairs[step]) if made else task.pairs.index("no_op", "no_op")
        arguments = task.expert_arguments(observations, step)
        for arm, values in enumerate(self._recipe):
            for index, skill in enumerate(task.pairs.skills):
                if skill.name in values:
                    arguments[:, task.pairs.columns(arm, index)] = values[skill.name]
        return Actions(np.array([pair]), task.pairs.to_normalised(arguments).astype(np.float32), arguments)


@dataclass
class Tally:
    """What the expert's episodes came to."""

    successes: int = 0
    failures: int = 0
    refused: Counter[str] = field(default_factory=Counter)
    """Steps that the gate refused, by its reason."""
    dropped: Counter[str] = field(default_factory=Counter)
    """Episodes that a fault ended, by its reason."""

    def __str__(self) -> str:
        refused, dropped = self.refused.total(), self.dropped.total()
        return f"{self.successes} solved, {self.failures} failed, {dropped} dropped; {refused} steps refused"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("objects", nargs="*", metavar="OBJECT", help=f"of {', '.join(OBJECTS)}; default: all")
    parser.add_argument("--episodes", type=int, default=20, help="of each object")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--write", action="store_true", help=f"replace {OUT}, of all objects")
    arguments = parser.parse_args()
    if arguments.write and arguments.objects:
        parser.error("--write needs all objects: name none")
    logging.getLogger("taskschema").setLevel(logging.CRITICAL)
    tallies = {}
    for name in arguments.objects or OBJECTS:
        started = time.monotonic()
        tallies[name] = rehearse(get_object(name), arguments.episodes, arguments.seed)
        print(f"{name}: {tallies[name]} in {time.monotonic() - started:.0f} s", flush=True)
    if arguments.write:
        OUT.write_text(_document(tallies, arguments.episodes))


def rehearse(item: RobotObject, episodes: int, seed: int) -> Tally:
    """Run the expert's episodes with an object on a twin."""
    task = task_for(item)
    tally, limits = Tally(), SafetyLimits(speed_ratio=1.0, period=1.0 / RATE)
    with ExitStack() as stack:
        client = own_twin(stack, item)
        hardware = twin_hardware(stack, client, limits.period)
        gate = SafetyGate(hardware.drivers, hardware.clock, limits)
        gate.prepare()
        world = TrueWorld(client, task, item, hardware.clock)
        runner = EpisodeRunner(task, np.array(item.size), gate, world, hardware.clock, limits)
        expert = Expert(task, RECIPES.get(item.name, ({}, {})))
        for slot in range(episodes):
            try:
                trajectory, record = runner.run(EpisodeKey(seed, 0, slot, 0), expert)
            except FaultError as error:
                tally.dropped[error.fault.reason] += 1
                gate.acknowledge("bench")
                runner.recover()
            except EpisodeDroppedError as error:
                tally.dropped[str(error)] += 1
            else:
                tally.successes += trajectory.success
                tally.failures += not trajectory.success
                tally.refused.update(record.refusals)
    return tally


def _document(tallies: dict[str, Tally], episodes: int) -> str:
    lines = [
        "# The nine objects in an expert's hands",
        "",
        f"`python -m studies.twin_expert --episodes {episodes} --write` on {machine()}.",
        "A scripted expert makes the paper's schema with each object of the catalogue on the twin, through",
        "the safety gate, over rosbridge in lock-step: what it solves, a policy can learn. `dropped`",
        "episodes were ended by a fault and do not count; `refused` are steps.",
        "",
        "| object | family | solved | failed | dropped | refused | most often |",
        "|---|---|---|---|---|---|---|",
    ]
    for name, tally in tallies.items():
        reasons = (tally.refused + tally.dropped).most_common(1)
        cells = (
            name,
            get_object(name).family.replace("_", " "),
            f"{tally.successes} of {tally.successes + tally.failures}",
            str(tally.failures),
            str(tally.dropped.total()),
            str(tally.refused.total()),
            reasons[0][0] if reasons else "",
        )
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join([*lines, ""])


def task_for(item: RobotObject) -> SceneTask:
    """Return the task that an object is for."""
    task = get_task(item.family.replace("_", "-"))
    if item.name in TASKS:
        task = load_task_source(*read_task_file(TASKS[item.name]))
    assert isinstance(task, SceneTask)
    return task


if __name__ == "__main__":
    main()
