"""Run the benches named, or all: `python -m bench [NAME or row number ...]`.

All of them together also write `bench/results.json` and the pages that show it (`bench.report`); `--write`
brings the rows of chosen benches up to date there.
"""

import argparse
import importlib
import json
import time
from typing import Any

from bench import report
from bench.entry import RESULTS, Entry, table
from taskschema_learner.machine import machine

BENCHES: dict[str, tuple[tuple[int, ...], str]] = {
    "simulation": ((1,), "simulated seconds per wall second against robosuite's own env.step"),
    "physics": ((3,), "cost of a physics step, steps a skill, and the limits of motions"),
    "resets": ((10,), "reset of an episode against robosuite's hard reset"),
    "learner_update": ((6,), "the learner's update against Stable-Baselines3's"),
    "publishing": ((8,), "time from publishing a policy until an idle worker has it"),
    "service": ((2, 7, 13), "the whole service while it trains, against the same physics alone"),
    "schema_requests": ((9,), "GET /schema at 200 requests per second while training"),
    "stopped_worker": ((12,), "a round with one of its workers stopped in the middle"),
    "scaling": ((5, 11), "1, 2, 4, 8, 16 and 50 workers on the same cores"),
    "saturation": ((5,), "where one learner and one Redis saturate"),
    "fidelity": ((4,), "the shipped physics against a fine reference"),
    "rendering": ((14,), "the overhead frame: how long it takes, and what the arms hide in it"),
    "seeds": ((13,), "minutes and episodes of `taskschema train lateral-lifting` to 90 %, seed by seed"),
}
"""Module of each bench, the rows it measures, and what it is about."""


def main() -> None:
    words = [f"{name} ({', '.join(map(str, rows))}): {text}" for name, (rows, text) in BENCHES.items()]
    parser = argparse.ArgumentParser(prog="python -m bench", description=__doc__)
    parser.add_argument("benches", nargs="*", metavar="BENCH", help="; ".join(words))
    parser.add_argument("--repeats", type=int, default=5, help="interleaved repeats of each measurement")
    parser.add_argument(
        "--write",
        action="store_true",
        help="bring the rows of chosen benches up to date in bench/results.json",
    )
    arguments = parser.parse_args()
    names = chosen(arguments.benches)
    entries: list[Entry] = []
    started = time.monotonic()
    for name in names:
        print(f"[{time.monotonic() - started:5.0f} s] {name}: {BENCHES[name][1]} ...", flush=True)
        entries += importlib.import_module(f"bench.{name}").measure(arguments.repeats)
    print(f"\n{machine()}\n\n{table(entries)}")
    rows = [entry.as_dict() for entry in entries]
    if not arguments.benches:
        write(rows)
    elif arguments.write:
        write(replaced(json.loads(RESULTS.read_text()), rows))
    report.main()  # whatever was written: scaling and saturation always keep what they find, in growth.json


def write(rows: list[dict[str, Any]]) -> None:
    """Replace the recorded results."""
    RESULTS.write_text(json.dumps(rows, indent=1) + "\n")


def replaced(rows: list[dict[str, Any]], newer: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the rows with those in their places that were measured again; what is new comes last."""
    by_name = {row["name"]: row for row in newer}
    kept = [by_name.pop(row["name"], row) for row in rows]
    return [*kept, *by_name.values()]


def chosen(words: list[str]) -> list[str]:
    """Return the benches meant by names and row numbers; all of them if there are none."""
    names = [
        name
        for name, (rows, _) in BENCHES.items()
        if not words or name in words or any(str(row) in words for row in rows)
    ]
    known = {*BENCHES, *(str(row) for rows, _ in BENCHES.values() for row in rows)}
    unknown = [word for word in words if word not in known]
    if unknown:
        raise SystemExit(f"No bench {', '.join(unknown)}; there are: {', '.join(BENCHES)}, or rows 1 to 14.")
    return names


if __name__ == "__main__":
    main()
