"""Run the benches named, or all: `python -m bench [simulation training learner_update ...]`."""

import argparse
import importlib
import json
from pathlib import Path

from bench.entry import Entry
from bench.machine import machine

BENCHES = {
    "simulation": "simulated seconds per wall second against robosuite's own env.step",
    "training": "episodes per second, shares of the wall time and memory while training",
    "learner_update": "the learner's update against Stable-Baselines3's",
}
RESULTS = Path(__file__).with_name("results.json")


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m bench", description=__doc__)
    parser.add_argument(
        "benches", nargs="*", choices=[[], *BENCHES], help="; ".join(map(": ".join, BENCHES.items()))
    )
    parser.add_argument("--repeats", type=int, default=5, help="interleaved repeats of each measurement")
    arguments = parser.parse_args()
    entries: list[Entry] = []
    for name in arguments.benches or BENCHES:
        print(f"{name}: {BENCHES[name]} ...", flush=True)
        entries += importlib.import_module(f"bench.{name}").measure(arguments.repeats)
    print(f"\n{machine()}\n\n{table(entries)}")
    if not arguments.benches:
        RESULTS.write_text(json.dumps([entry.as_dict() for entry in entries], indent=1) + "\n")


def table(entries: list[Entry]) -> str:
    """Return the entries as a Markdown table."""
    rows = ["| # | measured | value | spread | target | reached |", "|---|---|---|---|---|---|"]
    for entry in entries:
        sign = ">=" if entry.better == "higher" else "<="
        rows.append(
            f"| {entry.id} | {entry.name} | {entry.value:.3g} {entry.unit} | {entry.spread:.2g} "
            f"| {sign} {entry.target:g} {entry.unit} | {'yes' if entry.reached else 'no'} |"
        )
    return "\n".join(rows)


if __name__ == "__main__":
    main()
