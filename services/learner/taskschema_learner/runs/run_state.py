"""What a checkpoint makes durable about a run, and how a run comes back from it."""

import time

import msgspec

from taskschema.errors import RunFolderError
from taskschema.metrics import RoundMetrics
from taskschema_learner.learner import Learner
from taskschema_learner.runs.checkpoint import Checkpoint, load_latest, save
from taskschema_learner.runs.progress import Progress
from taskschema_learner.runs.run_folder import RunFolder

_PROGRESS = "progress"
_METRICS = "metrics"


def save_run(
    folder: RunFolder, learner: Learner, token: int, progress: Progress, metrics: RoundMetrics
) -> RoundMetrics:
    """Write the checkpoint of a round, then its row of `metrics.csv`; return the row with the time it took.

    The row is part of the checkpoint too, so that a crash between the two loses nothing.
    """
    started = time.monotonic()
    texts = {
        _PROGRESS: msgspec.json.encode(progress).decode(),
        _METRICS: msgspec.json.encode(metrics).decode(),
    }
    save(folder.checkpoints, Checkpoint(learner.version, token, learner.arrays(), texts))
    metrics = msgspec.structs.replace(metrics, seconds_checkpoint=time.monotonic() - started)
    folder.append_metrics(metrics)
    return metrics


def restore_run(folder: RunFolder, learner: Learner) -> Progress:
    """Bring the learner to the newest checkpoint, if there is one, and `metrics.csv` in line with it.

    Raises:
        RunFolderError: if the checkpoints, or the metrics before them, are damaged.
    """
    checkpoint = load_latest(folder.checkpoints)
    if checkpoint is None:
        folder.keep_metrics([])
        return Progress()
    learner.restore(checkpoint.arrays)
    try:
        progress = msgspec.json.decode(checkpoint.metadata[_PROGRESS], type=Progress)
        newest = msgspec.json.decode(checkpoint.metadata[_METRICS], type=RoundMetrics)
    except (KeyError, msgspec.MsgspecError) as error:
        raise RunFolderError(f"The newest checkpoint of {folder.path} is damaged: {error}.") from None
    rows = [row for row in folder.read_metrics() if row.round < newest.round]
    folder.keep_metrics([*rows, newest])
    return progress
