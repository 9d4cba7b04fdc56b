"""Bring the measured figures into docs/performance.md and docs/scale.md: `python -m bench.report`.

Everything between the marks is rewritten from `bench/results.json` and `bench/growth.json`: no figure there
is typed by hand.
"""

import json
from collections import defaultdict
from pathlib import Path

from bench import cluster_needs, growth
from bench.entry import RESULTS, Entry, table

DOCUMENT = Path(__file__).parents[1] / "docs" / "performance.md"
SCALE = DOCUMENT.with_name("scale.md")
PICTURE = DOCUMENT.with_name("growth.png")
CAPTION = "episodes per second over workers, on these cores and predicted for a cluster"
BEGIN, END = "<!-- measured: written by python -m bench.report -->", "<!-- end of measured -->"
CLUSTER_WORKERS = (1, 2, 4, 8, 16, 50, 200)
CLUSTER_SLOTS = (50, 400)


def main() -> None:
    entries = [Entry(**item) for item in json.loads(RESULTS.read_text())]
    measured = growth.read()
    for page, text in ((DOCUMENT, section(entries, measured)), (SCALE, cluster_needs.section(measured))):
        page.write_text(with_section(page.read_text(encoding="utf-8"), text), encoding="utf-8")
    draw(measured, PICTURE)
    print(f"{DOCUMENT}, {SCALE} and {PICTURE} are up to date.")


def with_section(document: str, text: str, begin: str = BEGIN) -> str:
    """Return the document with everything from the mark `begin` to the next mark `END` replaced.

    Raises:
        SystemExit: if a mark is gone.
    """
    before, found, rest = document.partition(begin)
    _, end, after = rest.partition(END)
    if not found or not end:
        raise SystemExit(f"The page has lost its marks {begin!r} and {END!r}: put them back.")
    return f"{before}{begin}\n\n{text}\n\n{end}{after}"


def section(entries: list[Entry], measured: growth.Growth) -> str:
    """Return the tables."""
    lines = [f"Measured on {measured.machine}.", *_days(entries), "", table(entries), ""]
    lines += [
        "### Workers on these cores",
        "",
        *_day(measured, "counts"),
        *_counts(measured),
        "",
        f"![{CAPTION}]({PICTURE.name})",
    ]
    if measured.parts is not None:
        lines += [
            "",
            "### A cluster, from the measured parts",
            "",
            *_day(measured, "parts"),
            *_cluster(measured.parts),
        ]
    return "\n".join(lines)


def _days(entries: list[Entry]) -> list[str]:
    """Return which rows were measured on which day."""
    rows: dict[str, set[int]] = defaultdict(set)
    for entry in entries:
        rows[entry.measured].add(entry.id)
    return [f"Rows of {day}: {', '.join(map(str, sorted(rows[day])))}." for day in sorted(rows)]


def _day(measured: growth.Growth, part: str) -> list[str]:
    return [f"Measured on {measured.days[part]}.", ""] if part in measured.days else []


def _counts(measured: growth.Growth) -> list[str]:
    rows = [
        f"| {item.workers} | {item.episodes_per_second:.1f} | {item.seconds_per_round:.2f} | {item.repeats} |"
        for item in measured.counts
    ]
    return ["| workers | episodes/s | s a round | runs |", "|---|---|---|---|", *rows]


def _cluster(parts: growth.Parts) -> list[str]:
    lines = [
        f"One worker a core. A slot's message has {parts.message_bytes:,} bytes; it costs the learner "
        f"{1e3 * parts.intake_seconds:.2f} ms to take in and Redis {1e3 * parts.redis_seconds:.2f} ms.",
        "",
        "| workers | slots a round | s a round | episodes/s | share of the update |",
        "|---|---|---|---|---|",
    ]
    for slots in CLUSTER_SLOTS:
        for workers in CLUSTER_WORKERS:
            item = growth.predict(parts, workers, slots)
            lines.append(
                f"| {workers} | {slots} | {item.seconds_per_round:.2f} | {item.episodes_per_second:,.0f} "
                f"| {item.learner_share:.0%} |"
            )
    lines += ["", "| part | trajectories/s it can take | workers that make as many |", "|---|---|---|"]
    saturation = growth.saturation(parts)
    lines += [
        f"| {name} | {episodes:,.0f} | {workers:,.0f} |" for name, (episodes, workers) in saturation.items()
    ]
    first = min(saturation, key=lambda name: saturation[name][1])
    lines += [
        "",
        f"The part of the service that saturates first is the {first}.".replace("the Redis", "Redis"),
    ]
    return lines


def draw(measured: growth.Growth, path: Path) -> None:
    """Draw episodes per second over workers: measured on this machine, predicted for a cluster."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(figsize=(7, 4.5), layout="constrained")
    workers = [item.workers for item in measured.counts]
    axes.plot(
        workers,
        [item.episodes_per_second for item in measured.counts],
        "o-",
        label="on these cores, measured",
    )
    if measured.parts is not None:
        for slots in CLUSTER_SLOTS:
            rates = [
                growth.predict(measured.parts, count, slots).episodes_per_second for count in CLUSTER_WORKERS
            ]
            axes.plot(
                CLUSTER_WORKERS, rates, "--", label=f"a core a worker, {slots} slots a round, predicted"
            )
    axes.set(xscale="log", yscale="log", xlabel="workers", ylabel="episodes per second")
    axes.grid(visible=True, which="both", alpha=0.3)
    axes.legend()
    figure.savefig(path, dpi=120)
    pyplot.close(figure)


if __name__ == "__main__":
    main()
