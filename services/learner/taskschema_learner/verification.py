"""Verifying a run: computing it again and comparing the policies' hashes round by round."""

from collections.abc import Callable

import msgspec

from taskschema.errors import RunFolderError
from taskschema_learner.recomputation import published_trunk, recompute
from taskschema_learner.run_folder import RunFolder
from taskschema_learner.run_policies import initial_policy_of


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
        RunFolderError: if the run has no rounds, or its metrics lack one.

    """
    rows = folder.read_metrics()[:rounds]
    if not rows:
        raise RunFolderError(f"The run in {folder.path} has no rounds yet: there is nothing to verify.")
    if [row.round for row in rows] != list(range(len(rows))):
        raise RunFolderError(f"metrics.csv in {folder.path} is damaged: its rounds are not 0, 1, 2, ...")
    computed = ""
    again_by_round = recompute(folder.config, len(rows), published_trunk(folder), initial_policy_of(folder))
    for done, (row, again) in enumerate(zip(rows, again_by_round, strict=True), start=1):
        computed = again.sha256
        if computed != row.sha256:
            return Verification(folder.name, done, row.round, row.sha256, computed)
        if progress is not None:
            progress(done, len(rows))
    return Verification(folder.name, len(rows), None, rows[-1].sha256, computed)
