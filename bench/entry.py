"""One measured figure, beside its target."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from statistics import median

from taskschema_learner.machine import today

RESULTS = Path(__file__).with_name("results.json")
"""Every bench's entries."""


@dataclass(frozen=True)
class Entry:
    id: int
    """Row of the table in docs/performance.md."""
    name: str
    value: float
    unit: str
    target: float | None
    """None: reported beside the others, without a target of its own."""
    better: str
    """`higher` or `lower`."""
    spread: float
    """Largest minus smallest of the repeats."""
    measured: str = field(default_factory=today)
    """Day, in UTC."""

    @classmethod
    def of(
        cls, id: int, name: str, samples: Sequence[float], unit: str, target: float | None, better: str
    ) -> "Entry":
        """Return the median of the repeats, with their spread."""
        return cls(id, name, median(samples), unit, target, better, max(samples) - min(samples))

    @property
    def reached(self) -> bool | None:
        """Whether the target is reached; None without one."""
        if self.target is None:
            return None
        return self.value >= self.target if self.better == "higher" else self.value <= self.target

    def as_dict(self) -> dict[str, object]:
        return asdict(self)


def table(entries: Sequence[Entry]) -> str:
    """Return the entries as a Markdown table."""
    rows = ["| # | measured | value | spread | target | reached |", "|---|---|---|---|---|---|"]
    rows += [_row(entry) for entry in sorted(entries, key=lambda entry: entry.id)]
    return "\n".join(rows)


def _row(entry: Entry) -> str:
    sign = "≥" if entry.better == "higher" else "≤"
    # Shares are measured from 0 to 1, but for those that have their unit.
    factor, unit = (100, "%") if "share" in entry.name and entry.unit in ("", "x") else (1, entry.unit)
    value = f"{figure(factor * entry.value)} {unit}".rstrip()
    target = "" if entry.target is None else f"{sign} {figure(factor * entry.target)} {unit}".rstrip()
    reached = {True: "yes", False: "**no**", None: ""}[entry.reached]
    spread = figure(factor * entry.spread, digits=2)
    return f"| {entry.id} | {entry.name} | {value} | {spread} | {target} | {reached} |"


def figure(value: float, digits: int = 3) -> str:
    """Return a number for people: so many significant digits, and never less than all before the point."""
    text = f"{value:.{digits}g}"
    return f"{value:,.0f}" if abs(float(text)) >= 10**digits else text
