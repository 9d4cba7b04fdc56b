"""One measured figure, beside its target."""

from dataclasses import asdict, dataclass
from statistics import median


@dataclass(frozen=True)
class Entry:
    id: int
    """Row of the table in docs/performance.md."""
    name: str
    value: float
    unit: str
    target: float
    better: str
    """`higher` or `lower`."""
    spread: float
    """Largest minus smallest of the repeats."""

    @classmethod
    def of(cls, id: int, name: str, samples: list[float], unit: str, target: float, better: str) -> "Entry":
        return cls(id, name, median(samples), unit, target, better, max(samples) - min(samples))

    @property
    def reached(self) -> bool:
        return self.value >= self.target if self.better == "higher" else self.value <= self.target

    def as_dict(self) -> dict[str, object]:
        return asdict(self)
