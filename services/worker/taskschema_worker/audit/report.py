"""What an audit found, as data, JSON and a table."""

import json
import math
from dataclasses import asdict, dataclass
from typing import Any

from taskschema.tasks.task import Schema

EXPERT_TARGET = 0.95
CORNER_TARGET = 0.90
IDLE_LIMIT = 0.02
EPISODES_LIMIT, LARGE_EPISODES_LIMIT = 20_000, 200_000
"""Expected episodes to a first success: at most this, with no more schemas than `LARGE`, and with more."""
LARGE = 729
"""Schemas of a family with three skills and three steps."""
CONFIDENCE_Z = 1.959964
"""Of a two-sided 95 % interval."""


@dataclass(frozen=True)
class Rate:
    """A success rate with its 95 % Wilson interval (Wilson 1927)."""

    successes: int
    trials: int

    @property
    def value(self) -> float:
        """Return the observed rate."""
        return self.successes / self.trials

    @property
    def interval(self) -> tuple[float, float]:
        """Return the lower and upper end of the interval."""
        n, z = self.trials, CONFIDENCE_Z
        centre = (self.value + z * z / (2 * n)) / (1 + z * z / n)
        half = z / (1 + z * z / n) * math.sqrt(self.value * (1 - self.value) / n + z * z / (4 * n * n))
        return max(0.0, centre - half), min(1.0, centre + half)

    def __str__(self) -> str:
        low, high = self.interval
        return f"{self.value:.2%} ({self.successes} of {self.trials}; {low:.2%} to {high:.2%})"


@dataclass(frozen=True)
class Corner:
    """How the expert does at one extreme of the randomisation."""

    name: str
    rate: Rate


@dataclass(frozen=True)
class SchemaRate:
    """How often a schema solves random instances."""

    schema: Schema
    rate: Rate
    searched: bool = False
    """With arguments that a search near the expert's found, not with the expert's own."""


@dataclass(frozen=True)
class SearchedSchema:
    """What an argument search found for a schema."""

    schema: Schema
    rate: Rate
    """Of the arguments found, on fresh instances."""
    search_successes: int
    search_episodes: int
    """Successes and episodes of the search itself."""


@dataclass(frozen=True)
class AuditReport:
    """The three parts of an audit (results/audit holds the tasks')."""

    task: str
    paper_schema: Schema
    seed: int
    effort: str
    schema_count: int
    """|X|^T"""
    expert: Rate
    corners: tuple[Corner, ...]
    good: tuple[SchemaRate, ...]
    """Schemas of length T that the expert's or searched arguments solve in at least 95 % of instances."""
    nearly_good: tuple[SchemaRate, ...]
    """Schemas that those arguments solve in part."""
    idle: tuple[SearchedSchema, ...]
    """Schemas with one arm idle throughout."""
    sample: tuple[SearchedSchema, ...]
    """A seeded sample of the schemas that are neither good nor idle."""
    random: Rate
    """Uniformly random arguments under the paper's schema."""
    random_good: Rate
    """Uniformly random arguments under each of the good schemas in turn: p."""

    @property
    def expected_episodes(self) -> float:
        """|X|^T / (m p): expected until a good schema's first success; infinite if none succeeded."""
        return self._expected(self.random_good)

    @property
    def expected_by_paper_schema(self) -> float:
        """The same as if all good schemas were as hard to find arguments for as the paper's."""
        return self._expected(self.random)

    def _expected(self, random: Rate) -> float:
        found = len(self.good) * random.value
        return self.schema_count / found if found else math.inf

    @property
    def episodes_limit(self) -> int:
        """Return how many expected episodes are too many, which grows with the number of schemas."""
        return EPISODES_LIMIT if self.schema_count <= LARGE else LARGE_EPISODES_LIMIT

    @property
    def verdicts(self) -> dict[str, bool]:
        """Return whether each demand is met."""
        return {
            "expert at least 95 %": self.expert.value >= EXPERT_TARGET,
            "expert at least 90 % at every corner": all(c.rate.value >= CORNER_TARGET for c in self.corners),
            "one arm idle: at most 2 %": all(item.rate.value <= IDLE_LIMIT for item in self.idle),
            f"expected episodes at most {self.episodes_limit:,}": (
                self.expected_episodes <= self.episodes_limit
            ),
        }

    @property
    def good_schemas_json(self) -> str:
        """Return the good set as the package data that results are compared with."""
        rows = ",\n".join(" " + json.dumps(item.schema) for item in self.good)
        return f"[\n{rows}\n]\n"

    def to_json(self) -> str:
        """Return everything as JSON."""
        document: dict[str, Any] = asdict(self)
        document |= {
            "expected_episodes": self.expected_episodes,
            "expected_by_paper_schema": self.expected_by_paper_schema,
            "verdicts": self.verdicts,
        }
        return json.dumps(document, indent=1) + "\n"

    def to_markdown(self) -> str:
        """Return the table that is committed under `results/audit`."""
        lines = [
            f"# Audit of {self.task}",
            "",
            f"`taskschema audit {self.task} --effort {self.effort}`, seed {self.seed}. "
            "Rates with 95 % Wilson intervals.",
            "",
            "| demand | met |",
            "|---|---|",
            *(f"| {name} | {_yes(met)} |" for name, met in self.verdicts.items()),
            f"| for comparison: the same if all good schemas were as hard as the paper's | "
            f"{_yes(self.expected_by_paper_schema <= self.episodes_limit)} |",
            "",
            "## (a) The scripted expert under the paper's schema",
            "",
            "| instances | success |",
            "|---|---|",
            f"| random | {self.expert} |",
            *(f"| {corner.name} | {corner.rate} |" for corner in self.corners),
            "",
            "## (b) The good set",
            "",
            *self._good_lines(),
            "",
            "### One arm idle throughout, after an argument search on each",
            "",
            *_search_lines(self.idle),
            "",
            "### A sample of the other schemas, after an argument search on each",
            "",
            *_search_lines(self.sample),
            "",
            "## (c) How rare is a first success?",
            "",
            f"Uniformly random arguments succeed in {self.random} under the paper's schema, and under the "
            f"good schemas, taken in turn, in p = {self.random_good}. With m = {len(self.good)} good schemas "
            f"of {self.schema_count}, uniformly random schemas take |X|^T / (m p) = "
            f"{self.expected_episodes:,.0f} episodes to a good one's first success. If all were as hard as "
            f"the paper's, it would be {self.expected_by_paper_schema:,.0f}.",
        ]
        return "\n".join(lines) + "\n"

    def _good_lines(self) -> list[str]:
        own = self.paper_schema
        equal = [item for item in self.good if item.schema[: len(own)] == own]
        other = [item for item in self.good if item.schema[: len(own)] != own]
        head = (
            f"{len(self.good)} of {self.schema_count} schemas are good: {len(equal)} begin with the paper's "
            f"steps and end there, {len(other)} are equivalent."
        )
        rows = [_rate_line(item) for item in other]
        nearly = [_rate_line(item) for item in self.nearly_good]
        table = ["", "| equivalent schema (left, right) | success | arguments |", "|---|---|---|", *rows]
        if nearly:
            table += [
                "",
                "Solved in part, and so not good:",
                "",
                "| schema | success | arguments |",
                "|---|---|---|",
                *nearly,
            ]
        return [head, *table]


def _yes(met: bool) -> str:
    return "yes" if met else "**no**"


def _search_lines(items: tuple[SearchedSchema, ...]) -> list[str]:
    if not items:
        return ["None searched."]
    successes = sum(item.search_successes for item in items)
    episodes = sum(item.search_episodes for item in items)
    worst = sorted(items, key=lambda item: (-item.rate.value, -item.search_successes))[:12]
    return [
        f"{len(items)} schemas, {successes} successes in {episodes:,} episodes of search. Most successful:",
        "",
        "| schema (left, right) | arguments found, on fresh instances | successes while searching |",
        "|---|---|---|",
        *(
            f"| {_text(item.schema)} | {item.rate} | {item.search_successes} of {item.search_episodes} |"
            for item in worst
        ),
    ]


def _rate_line(item: SchemaRate) -> str:
    source = "a search's" if item.searched else "the expert's"
    return f"| {_text(item.schema)} | {item.rate} | {source} |"


def _text(schema: Schema) -> str:
    return "; ".join(f"{left}, {right}" for left, right in schema)
