"""Verifying a run: computing it again and comparing the policies' hashes round by round."""

from collections.abc import Callable, Iterator

import msgspec

from taskschema.errors import RunFolderError
from taskschema.metrics import RoundMetrics
from taskschema.trajectory import Trajectory
from taskschema_learner.runs.recomputation import RecomputedRound, recompute
from taskschema_learner.runs.run_folder import RunFolder
from taskschema_learner.runs.run_policies import initial_policy_of, published_trunk

SAME_BITS = "Bits are the same only with the same lock file and the same kind of processor."
"""What to look at where a round comes out differently."""


class Verification(msgspec.Struct, frozen=True):
    """What a recomputation showed."""

    run: str
    rounds: int
    """Rounds that were computed again and compared."""
    first_difference: int | None
    """The first round, from 0, after which the hashes differ; None: all are the same."""
    recorded_sha256: str
    """Hash that the run recorded after the last round compared."""
    computed_sha256: str
    """Hash that the recomputation gave there."""

    @property
    def same(self) -> bool:
        """Whether every hash is the same."""
        return self.first_difference is None


def verify(
    folder: RunFolder, rounds: int | None = None, progress: Callable[[int, int], None] | None = None
) -> Verification:
    """Compute a run's first rounds (None: all of them) again, until one differs.

    Args:
        folder: the run.
        rounds: how many rounds to compare at most.
        progress: told (rounds compared, rounds in all) after every round.

    Raises:
        TaskschemaError: if the run has no rounds, its metrics lack one, or it cannot be computed again here.

    """
    recorded = _recorded_rounds(folder, rounds)
    computed = ""
    for done, (row, again) in enumerate(_computed_again(folder, recorded), start=1):
        computed = again.sha256
        if computed != row.sha256:
            return Verification(folder.name, done, row.round, row.sha256, computed)
        if progress is not None:
            progress(done, len(recorded))
    return Verification(folder.name, len(recorded), None, recorded[-1].sha256, computed)


def training_episodes(folder: RunFolder, rounds: int) -> list[Trajectory]:
    """Return the episodes that a run's first rounds, at most as many as it has, were trained on.

    Raises:
        TaskschemaError: if they cannot be computed again here, or come out as others.

    """
    episodes: list[Trajectory] = []
    for row, again in _computed_again(folder, _recorded_rounds(folder, rounds)):
        if again.sha256 != row.sha256:
            raise RunFolderError(
                f"Round {row.round} of {folder.name} comes out differently here, so its episodes are not the "
                f"run's. {SAME_BITS}"
            )
        episodes += again.trajectories
    return episodes


def _recorded_rounds(folder: RunFolder, rounds: int | None) -> list[RoundMetrics]:
    """Return the rows of a run's first rounds (None: of all of them).

    Raises:
        RunFolderError: if there are none, one is missing, or a robot ran the episodes.

    """
    if folder.agent == "robot":
        raise RunFolderError(f"{folder.path} is a robot's run: its episodes cannot be computed again.")
    rows = folder.read_metrics()[:rounds]
    if not rows:
        raise RunFolderError(
            f"The run in {folder.path} has no rounds yet: there is nothing to compute again."
        )
    if [row.round for row in rows] != list(range(len(rows))):
        raise RunFolderError(f"metrics.csv in {folder.path} is damaged: its rounds are not 0, 1, 2, ...")
    return rows


def _computed_again(
    folder: RunFolder, recorded: list[RoundMetrics]
) -> Iterator[tuple[RoundMetrics, RecomputedRound]]:
    """Yield each row with its round, computed again on the device that the run learned on."""
    trunk, initial = published_trunk(folder), initial_policy_of(folder)
    again = recompute(folder.config, len(recorded), trunk, initial, folder.device or "cpu")
    yield from zip(recorded, again, strict=True)
