"""Entries, their table, and which benches a word means."""

import json

import pytest
from bench.__main__ import BENCHES, chosen, replaced
from bench.entry import RESULTS, Entry, figure, table

from taskschema_learner.machine import today


def test_an_entry_holds_the_median_and_the_spread():
    entry = Entry.of(8, "delay", [3.0, 1.0, 7.0], "ms", 5, "lower")
    assert (entry.value, entry.spread, entry.reached) == (3.0, 6.0, True)


def test_a_recorded_entry_keeps_the_day_it_was_measured():
    entry = Entry.of(8, "delay", [3.0], "ms", 5, "lower")
    assert entry.measured == today()
    older = entry.as_dict() | {"measured": "2026-01-31"}
    assert Entry(**older).as_dict() == older


def test_higher_is_better_where_it_says_so():
    assert Entry.of(2, "share", [0.94], "x", 0.93, "higher").reached
    assert not Entry.of(2, "share", [0.92], "x", 0.93, "higher").reached
    assert Entry.of(2, "share", [0.92], "x", None, "higher").reached is None


def test_table_is_in_the_order_of_rows_and_marks_what_is_missed():
    text = table(
        [Entry.of(9, "late", [30.0], "ms", 25, "lower"), Entry.of(2, "early", [1.0], "x", 0.9, "higher")]
    )
    early, late = text.splitlines()[2:]
    assert early.startswith("| 2 | early")
    assert early.endswith("| yes |")
    assert late.endswith("| ≤ 25 ms | **no** |")


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (0.0199, "0.0199"),
        (99.96, "100"),
        (999.4, "999"),
        (999.6, "1,000"),
        (1296.4, "1,296"),
        (-2048, "-2,048"),
    ],
)
def test_figures_are_those_of_people(value, words):
    assert figure(value) == words
    assert (figure(224.4, digits=2), figure(0.0881, digits=2)) == ("224", "0.088")


def test_shares_are_in_per_cent_and_what_has_no_unit_is_a_number_alone():
    entries = [
        Entry(3, "largest share of the limits", 0.947, "x", 1, "lower", 0.027),
        Entry(7, "encoding, share", 0.02, "%", None, "lower", 0.003),
        Entry(13, "episodes to 90 %", 9000.0, "", 20_000, "lower", 6600.0),
        Entry(14, "share of the object seen", 1.0, "", None, "higher", 0.0),
    ]
    assert table(entries).splitlines()[2:] == [
        "| 3 | largest share of the limits | 94.7 % | 2.7 | ≤ 100 % | yes |",
        "| 7 | encoding, share | 0.02 % | 0.003 |  |  |",
        "| 13 | episodes to 90 % | 9,000 | 6,600 | ≤ 20,000 | yes |",
        "| 14 | share of the object seen | 100 % | 0 |  |  |",
    ]


def test_every_row_of_the_table_has_a_bench():
    assert {row for rows, _ in BENCHES.values() for row in rows} == set(range(1, 15))


def test_benches_are_chosen_by_name_and_by_row():
    assert chosen([]) == list(BENCHES)
    assert chosen(["11"]) == ["scaling"]
    assert chosen(["resets", "4"]) == ["resets", "fidelity"]
    with pytest.raises(SystemExit, match="No bench nonsense"):
        chosen(["nonsense"])


def test_rows_measured_again_take_the_place_of_those_before():
    rows = [{"name": "a", "value": 1}, {"name": "b", "value": 2}]
    newer = [{"name": "c", "value": 4}, {"name": "a", "value": 3}]
    assert [(row["name"], row["value"]) for row in replaced(rows, newer)] == [("a", 3), ("b", 2), ("c", 4)]
    assert [row["value"] for row in rows] == [1, 2]


def test_the_simulation_is_measured_against_forty_times_robosuite():
    compared = next(row for row in json.loads(RESULTS.read_text()) if "lite physics" in row["name"])
    assert (compared["id"], compared["target"], compared["better"]) == (1, 40.0, "higher")
