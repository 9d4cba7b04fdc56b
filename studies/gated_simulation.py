"""What `--safety-gate` lets through, and what it costs: `python -m studies.gated_simulation lateral-lifting`.

Simulates the same episodes of the initial policy under the paper's schema, or of a run's newest policy, as
usual and as the robot's agent runs them. Times are of the processor, of one thread.
"""

import argparse
import time
from contextlib import closing
from pathlib import Path

from taskschema.config import RunConfig
from taskschema.policies import ActingPolicy, policy_of
from taskschema.tasks.registry import task_of
from taskschema.tasks.task import Task
from taskschema.trajectory import Trajectory
from taskschema_learner.evaluation import HELD_OUT
from taskschema_learner.learner import Learner
from taskschema_learner.machine import machine
from taskschema_learner.runs.run_folder import RunFolder
from taskschema_learner.runs.run_policies import newest_policy
from taskschema_worker.environments import make_environment
from taskschema_worker.rollout import collect_slots

BATCH_SLOTS = 25


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("task")
    parser.add_argument("--episodes", type=int, default=2000)
    parser.add_argument("--run", type=Path, help="folder of a run, whose newest policy acts")
    arguments = parser.parse_args()
    config = RunConfig(task=arguments.task, policy="oracle")
    task = task_of(config)
    snapshot = Learner(config, task).snapshot()
    if arguments.run is not None:
        folder = RunFolder.open(arguments.run)
        config, snapshot = folder.config, newest_policy(folder)
    policy = policy_of(config, task, snapshot)
    print(f"{machine()}, {task.name}, version {snapshot.version}:")
    for gated in (False, True):
        made, seconds = _episodes(task, policy, config.seed + HELD_OUT, arguments.episodes, gated=gated)
        steps = sum(len(item) for item in made)
        refused = sum(item.refused for item in made)
        print(
            f"{'with' if gated else 'without'} the gate: {sum(item.success for item in made)} of {len(made)} "
            f"episodes succeed, {refused} of {steps} steps are refused; {1000 * seconds / len(made):.1f} ms "
            "an episode"
        )


def _episodes(
    task: Task, policy: ActingPolicy, seed: int, count: int, *, gated: bool
) -> tuple[list[Trajectory], float]:
    """Return at least `count` episodes, and the processor's time that they took [s]."""
    made: list[Trajectory] = []
    with closing(make_environment(task, safety_gate=gated)) as environment:
        started = time.process_time()
        for round_index in range(-(-count // (4 * BATCH_SLOTS))):
            slots = collect_slots(
                environment,
                policy,
                seed=seed,
                round_index=round_index,
                slots=range(BATCH_SLOTS),
                episodes_per_slot=4,
                horizon=task.horizon,
            )
            made += [item for slot in slots for item in slot]
        return made, time.process_time() - started


if __name__ == "__main__":
    main()
