"""The agent's loop: lease a slot, run its episode, keep it, deliver it."""

import dataclasses
import logging
import threading
import time
from pathlib import Path

from taskschema.bus.lease import Lease
from taskschema.bus.messages import WorkItem
from taskschema.bus.records import RunRecords
from taskschema.bus.worker_bus import WorkerBus
from taskschema.errors import BusError, ConfigError
from taskschema.policies import ActingPolicy, policy_of
from taskschema.randomness import EpisodeKey
from taskschema.tasks.scene_task import SceneTask
from taskschema.trajectory import Trajectory, TrajectoryFormat
from taskschema_robot.agent.acknowledging import AcknowledgedArms
from taskschema_robot.agent.episode import EpisodeRecord, EpisodeRunner
from taskschema_robot.agent.episode_log import EpisodeLog
from taskschema_robot.agent.operator import Operator
from taskschema_robot.agent.progress import Progress
from taskschema_robot.agent.world import EpisodeDroppedError, NobodyThereError, SessionEndedError
from taskschema_robot.errors import EffectTimeoutError, NotConnectedError, NotReadyError, RobotError
from taskschema_robot.safety.fault import Fault, FaultError, RecoveryError

log = logging.getLogger("taskschema.robot")

LEASE_SECONDS = 6 * 3600.0
"""A robot's slot stays its own for hours: nobody else can run it."""
BLOCK_MS = 1_000
RETRY_SECONDS = 1.0
MOST_RECOVERIES = 5
"""Faults on the way home after which only a person's hands help."""
MOST_ATTEMPTS = 20
"""An episode that one session drops so often ends it: something is wrong with more than the episode."""


class RobotAgent:
    """Serves one run with both arms.

    Args:
        bus: the agent's end, of kind `robot`.
        records: of the same Redis.
        run: name of the run.
        task: of the run.
        runner: of episodes.
        arms: for a person's acknowledgements.
        operator: that person.
        folder: of the agent's own log and progress.

    """

    def __init__(
        self,
        bus: WorkerBus,
        records: RunRecords,
        run: str,
        task: SceneTask,
        runner: EpisodeRunner,
        arms: AcknowledgedArms,
        operator: Operator,
        folder: Path,
    ) -> None:
        self._bus, self._records, self._run = bus, records, run
        self._task, self._runner, self._arms, self._operator = task, runner, arms, operator
        self._config = bus.join()
        if self._config.episodes_per_slot != 1:
            raise ConfigError("A robot runs one episode a slot: start the run with `--agent robot`.")
        self._log = EpisodeLog(folder / "episodes", TrajectoryFormat.of(task, self._config))
        self._leases: list[Lease] = []
        self.progress = Progress(folder / "episodes.csv")

    def run(self, stop: threading.Event) -> None:
        """Serve the run until told to stop or it is over; waits for a learner or a Redis that is away."""
        while not stop.is_set():
            try:
                status = self._records.status(self._run)
                self._log.forget(status.version)
                if status.state == "finished":
                    log.info("The run is finished: %s", status.message)
                    return
                if not self._leases:
                    self._leases = self._bus.lease(BLOCK_MS)
                while self._leases and not stop.is_set() and self._serve(self._leases[0], stop):
                    del self._leases[0]
            except BusError as error:
                log.warning("%s Trying again; what was done is kept.", error)
                stop.wait(RETRY_SECONDS)

    def _serve(self, lease: Lease, stop: threading.Event) -> bool:
        """Deliver a slot: as it was kept, or by running its episode; return whether it was."""
        trajectories = self._log.find(lease.item)
        if trajectories is None:
            policy = policy_of(self._config, self._task, self._bus.policy(lease))
            trajectory = self._perform(lease.item, policy, stop)
            if trajectory is None:
                return False
            trajectories = [trajectory]
            self._log.keep(lease.item, trajectories)
        self._bus.submit([(lease, trajectories)])
        return True

    def _perform(self, item: WorkItem, policy: ActingPolicy, stop: threading.Event) -> Trajectory | None:
        """Run a slot's episode until one attempt counts; a dropped one is never a failure.

        None: the session ends before.
        """
        tries = 0
        while not stop.is_set():
            attempt = self._log.attempts(item)
            key = EpisodeKey(self._config.seed, item.round, item.slot, episode=0, attempt=attempt)
            try:
                self._operator.begin(self.progress, f"round {item.round}, slot {item.slot}")
                trajectory, record = self._runner.run(key, policy)
                trajectory = self._reviewed(trajectory, record)
            except FaultError as error:
                tries += 1
                attempts = self._drop(item, key, error)
                try:
                    self._recover(error)
                finally:
                    self._count_dropped(item, attempts, error)
            except SessionEndedError:
                stop.set()
            except NobodyThereError as error:
                self._nobody_there(item, key, error)
            except EpisodeDroppedError as error:
                tries += 1
                self._count_dropped(item, self._drop(item, key, error), error)
            else:
                self.progress.add(item.round, item.slot, attempt, trajectory.success, record)
                outcome = "success" if trajectory.success else "failure"
                log.info(
                    "%s: %s after %d steps, %.0f s", _words(key), outcome, len(trajectory), record.seconds
                )
                return trajectory
            if tries == MOST_ATTEMPTS:
                self._abandon()
                raise EpisodeDroppedError(
                    f"The episode of round {item.round}, slot {item.slot} was dropped {tries} times: see the "
                    "log, mend what it says, and start the agent again."
                )
        self._abandon()
        return None

    def _nobody_there(self, item: WorkItem, key: EpisodeKey, error: NobodyThereError) -> None:
        """Drop an episode that waited for a person: a try only if a skill was begun."""
        if self._runner.so_far().skills:
            self._count_dropped(item, self._drop(item, key, error), error)
            return
        log.warning("%s: not begun: %s", _words(key), error)
        self._operator.dropped(str(error))

    def _abandon(self) -> None:
        """Leave nothing in the air when the session ends."""
        try:
            self._runner.abandon()
        except FaultError as error:
            self._recover(error)
        except EpisodeDroppedError as error:
            log.warning("What the hands hold is still in the air: %s", error)

    def _drop(self, item: WorkItem, key: EpisodeKey, error: RobotError) -> int:
        """Note that a try does not count; return how many of this slot have not."""
        log.warning("%s: dropped: %s", _words(key), error)
        self._operator.dropped(str(error))
        return self._log.drop(item)

    def _count_dropped(self, item: WorkItem, attempts: int, error: RobotError) -> None:
        """Count what a dropped try took, its recovery included: the arms were at it all the same."""
        self.progress.add_dropped(item.round, item.slot, attempts - 1, self._runner.so_far(), str(error))

    def _recover(self, stopped: FaultError) -> None:
        """Wait for a person's acknowledgement, then bring the arms home slowly; again if that fails, too."""
        fault = stopped.fault
        for _ in range(MOST_RECOVERIES):
            self._acknowledge(fault)
            try:
                self._runner.recover()
                return
            except FaultError as another:
                fault = another.fault
            except EpisodeDroppedError as error:  # nobody was there to hold a key: they are asked again
                self._operator.dropped(str(error))
        raise RecoveryError(
            f"The arms did not get home in {MOST_RECOVERIES} tries, the last time for this: {fault.reason}. "
            "Free them by hand, then start the agent again: nothing is lost."
        )

    def _acknowledge(self, fault: Fault) -> None:
        """Ask a person until their acknowledgement counts: one that comes too early is no try."""
        asked = fault
        while True:
            try:
                self._arms.acknowledge(self._operator.acknowledge(asked))
                return
            except FaultError as another:  # a stop that came meanwhile
                asked = fault = another.fault
            except (EffectTimeoutError, NotConnectedError, NotReadyError) as error:
                log.warning("Not acknowledged: %s", error)
                asked = dataclasses.replace(fault, reason=f"{fault.reason}\n\nNot yet: {error}")
                time.sleep(RETRY_SECONDS)

    def _reviewed(self, trajectory: Trajectory, record: EpisodeRecord) -> Trajectory:
        """Return the trajectory with the outcome that a person lets stand."""
        log.info("Judged as %s: %s", record.outcome, record.reason)
        success = self._operator.review(record)
        if success is None:
            raise EpisodeDroppedError("A person dropped it.")
        if success == trajectory.success:
            return trajectory
        log.warning("A person undid it: it was a %s", "success" if success else "failure")
        if not success and len(trajectory) < self._task.horizon:
            raise EpisodeDroppedError("It ended early as a success that it was not.")
        return dataclasses.replace(trajectory, success=success)


def _words(key: EpisodeKey) -> str:
    return f"Round {key.round}, slot {key.slot}, attempt {key.attempt}"
