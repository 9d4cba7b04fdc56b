"""TensorBoard event files of a run."""

from pathlib import Path
from types import TracebackType
from typing import Self

from torch.utils.tensorboard import SummaryWriter as TensorBoardWriter

from taskschema.metrics import RoundMetrics

_TAGS = {
    "success_rate": "success/round",
    "success_last_100": "success/last_100",
    "policy_loss": "loss/policy",
    "value_loss": "loss/value",
    "argument_entropy": "policy/argument_entropy",
    "approximate_kl": "policy/approximate_kl",
    "clip_fraction": "policy/clip_fraction",
    "gradient_norm": "policy/gradient_norm",
    "diverged": "simulation/diverged",
    "refused": "safety/refused_steps",
    "seconds_collect": "seconds/collect",
    "seconds_update": "seconds/update",
    "seconds_checkpoint": "seconds/checkpoint",
}


class SummaryWriter:
    """Writes a round's metrics as scalars over episodes; close it, or use it in `with`."""

    def __init__(self, folder: Path, *, rounds_done: int) -> None:
        """Open event files in `folder`; what an earlier try wrote beyond `rounds_done` is hidden."""
        self._writer = TensorBoardWriter(str(folder), purge_step=rounds_done)

    def write(self, metrics: RoundMetrics) -> None:
        """Add one round, at its round number."""
        for field, tag in _TAGS.items():
            self._scalar(tag, getattr(metrics, field), metrics.round)
        for row, value in enumerate(metrics.schema_entropy, start=1):
            self._scalar(f"schema/entropy_step_{row}", value, metrics.round)
        for row, value in enumerate(metrics.schema_probability, start=1):
            self._scalar(f"schema/best_probability_step_{row}", value, metrics.round)
        self._scalar("episodes", metrics.episodes, metrics.round)

    def _scalar(self, tag: str, value: float, step: int) -> None:
        self._writer.add_scalar(tag, value, step)

    def __enter__(self) -> Self:
        """Return itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Flush and close."""
        self._writer.close()
