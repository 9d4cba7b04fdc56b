"""The first rounds of a training, computed here: their policies, and all states and controls of the physics.

A run is a function of its config and seed, so these are the very rounds that a service with the same seed
runs; their hashes say so.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import mujoco.rollout
import numpy as np

from bench.service_process import TASK
from taskschema.arrays import FloatArray, IntArray
from taskschema.config import RunConfig
from taskschema.policies import Policy, PolicySnapshot
from taskschema.randomness import EpisodeKey, Purpose, generator
from taskschema.tasks.registry import get_task
from taskschema.tasks.scene_task import SceneTask
from taskschema.trajectory import Trajectory
from taskschema_learner.learner import Learner
from taskschema_worker.rollout import collect_slots
from taskschema_worker.scene_environment import SceneEnvironment
from taskschema_worker.simulation import Advance, Simulation


@dataclass(frozen=True)
class RecordedRounds:
    """Files of the recorded rounds."""

    folder: Path
    config: RunConfig
    sha256: list[str]
    """Hash of the policy after each round."""

    def snapshot(self, round_index: int) -> PolicySnapshot:
        """Return the policy that the round was collected with."""
        return PolicySnapshot.from_bytes((self.folder / f"policy{round_index}").read_bytes())

    def stretches(self, round_index: int, worker: int) -> Any:
        """Return what one worker's physics saw in a round."""
        return np.load(self.folder / f"round{round_index}-worker{worker}.npz", allow_pickle=False)


def worker_slots(config: RunConfig, worker: int, workers: int) -> range:
    """Return a worker's share of a round's slots."""
    share = -(-config.slots // workers)
    return range(worker * share, min((worker + 1) * share, config.slots))


def record(folder: Path, rounds: int, workers: int, config: RunConfig | None = None) -> RecordedRounds:
    """Compute the first rounds of a run of `TASK` as `workers` processes would share them."""
    config = config or RunConfig(task=TASK)
    task = get_task(TASK)
    assert isinstance(task, SceneTask)
    learner, environment, hashes = Learner(config, task), SceneEnvironment(task), []
    for round_index in range(rounds):
        snapshot = learner.snapshot()
        (folder / f"policy{round_index}").write_bytes(snapshot.to_bytes())
        trajectories: list[Trajectory] = []
        for worker in range(workers):
            log = _StateLog(environment._simulation)
            slots = worker_slots(config, worker, workers)
            trajectories += collect(environment, task, config, snapshot, round_index, slots)
            log.write(folder / f"round{round_index}-worker{worker}.npz")
        learner.update(trajectories)
        hashes.append(learner.snapshot().sha256)
    environment.close()
    return RecordedRounds(folder, config, hashes)


def collect(
    environment: SceneEnvironment,
    task: SceneTask,
    config: RunConfig,
    snapshot: PolicySnapshot,
    round_index: int,
    slots: range,
) -> list[Trajectory]:
    """Run some slots of a round as one batch, as a worker does."""
    policy = Policy(snapshot, task.pairs, task.observation)
    collected = collect_slots(
        environment,
        policy,
        seed=config.seed,
        round_index=round_index,
        slots=slots,
        episodes_per_slot=config.episodes_per_slot,
        horizon=task.horizon,
    )
    return [trajectory for slot in collected for trajectory in slot]


class _StateLog:
    """Takes down what goes into the simulator, until it is written."""

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation
        self._advance = simulation.advance
        self._arrays: list[dict[str, Any]] = []
        simulation.advance = self._logged  # type: ignore[method-assign]

    def _logged(self, episodes: IntArray, controls: FloatArray) -> Advance:
        simulation = self._simulation
        clock = np.zeros((len(episodes), 1))
        state = [clock, simulation.positions[episodes], simulation.velocities[episodes]]
        self._arrays.append(
            {
                "episodes": episodes.copy(),
                "initial": np.concatenate(state, axis=1),
                "warmstart": simulation._warmstart[episodes],
                "controls": controls.copy(),
            }
        )
        return self._advance(episodes, controls)

    def write(self, path: Path) -> None:
        """Write the file and stop logging."""
        self._simulation.advance = self._advance  # type: ignore[method-assign]
        named = {f"{name}{i}": array for i, item in enumerate(self._arrays) for name, array in item.items()}
        np.savez(path, count=np.array(len(self._arrays)), **named)


class Replay:
    """Recorded stretches of physics, ready to run again through nothing but `mujoco.rollout`."""

    def __init__(self, recorded: RecordedRounds, rounds: list[int], worker: int, workers: int) -> None:
        config, task = recorded.config, get_task(TASK)
        assert isinstance(task, SceneTask)
        simulation = Simulation(task, threads=1)
        slots = worker_slots(config, worker, workers)
        self._data = simulation._data
        self._spec = simulation._spec
        self._rollout = mujoco.rollout.Rollout(nthread=0)
        self.physics_steps = 0
        self._calls: list[tuple[list[mujoco.MjModel], FloatArray, FloatArray, FloatArray]] = []
        for round_index in rounds:
            with recorded.stretches(round_index, worker) as file:
                models = _models(simulation, task, config, round_index, slots)
                for index in range(int(file["count"])):
                    controls = file[f"controls{index}"]
                    chosen = [models[episode] for episode in file[f"episodes{index}"]]
                    call = (chosen, file[f"initial{index}"], controls, file[f"warmstart{index}"])
                    self._calls.append(call)
                    self.physics_steps += controls.shape[0] * controls.shape[1]

    def __call__(self) -> FloatArray:
        """Run everything and return the last state."""
        states = np.empty(0)
        for models, initial, controls, warmstart in self._calls:
            steps = controls.shape[1]
            states = np.empty((len(models), steps, initial.shape[1]))
            self._rollout.rollout(
                models,
                self._data,
                initial,
                controls,
                control_spec=self._spec,
                skip_checks=True,
                nstep=steps,
                initial_warmstart=warmstart,
                state=states,
            )
        return np.asarray(states[-1, -1])


def _models(
    simulation: Simulation, task: SceneTask, config: RunConfig, round_index: int, slots: range
) -> list[mujoco.MjModel]:
    """Return new models of the episodes of some slots, each with the object that it drew."""
    keys = [
        EpisodeKey(config.seed, round_index, slot, episode)
        for slot in slots
        for episode in range(config.episodes_per_slot)
    ]
    simulation._models = []
    simulation.reset([task.draw_instance(generator(key, Purpose.RESET)) for key in keys])
    return simulation._models
