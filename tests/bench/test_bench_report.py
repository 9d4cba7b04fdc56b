"""What becomes of measured figures: predictions for a cluster, and the section of the document."""

import json
import re

import msgspec
import pytest
from bench import growth, scaling
from bench.entry import RESULTS, Entry
from bench.report import BEGIN, DOCUMENT, END, PICTURE, draw, section, with_section
from bus_setup import some_metrics

from taskschema_learner.machine import today

PARTS = growth.Parts(
    rollout_seconds={1: 0.1, 50: 2.6},
    update_seconds={50: 0.05, 100: 0.15},
    intake_seconds=0.001,
    redis_seconds=0.0001,
    message_bytes=4000,
)
MEASURED = growth.Growth("a machine", (growth.WorkerCount(1, 80.0, 2.5, 5),), PARTS)

DAYS = ((11, "2026-01-01"), (3, "2026-01-01"), (4, "2026-01-02"), (3, "2026-01-02"))


def test_a_round_lasts_as_long_as_its_largest_share_and_the_update():
    # 8 workers: shares of 7 slots, 0.1 + 6/49 * 2.5 = 0.406 s, then 0.05 s.
    item = growth.predict(PARTS, workers=8, slots=50)
    assert item.seconds_per_round == pytest.approx(0.1 + 6 / 49 * 2.5 + 0.05)
    assert item.episodes_per_second == pytest.approx(200 / item.seconds_per_round)


def test_the_learners_intake_bounds_a_round_of_many_workers():
    # 1,000 slots on 1,000 workers: 0.1 s of simulation, but 1 s of intake; the update grows in proportion.
    item = growth.predict(PARTS, workers=1000, slots=1000)
    assert item.seconds_per_round == pytest.approx(1.0 + 1.5)


def test_saturation_counts_workers_that_make_as_many_trajectories():
    # One worker makes 200 trajectories in 2.6 s; the intake takes 4 in 1 ms.
    episodes, workers = growth.saturation(PARTS)["learner's intake"]
    assert episodes == pytest.approx(4000)
    assert workers == pytest.approx(4000 / (200 / 2.6))


def test_measurements_are_kept_beside_each_other(tmp_path):
    path = tmp_path / "growth.json"
    growth.write(path, parts=PARTS)
    growth.write(path, counts=MEASURED.counts)
    read = growth.read(path)
    assert (read.parts, read.counts) == (PARTS, MEASURED.counts)
    assert read.days == {"parts": today(), "counts": today()}


def test_the_section_says_which_rows_and_tables_are_of_which_day():
    entries = [Entry(number, "a", 1.0, "", None, "lower", 0.0, day) for number, day in DAYS]
    measured = msgspec.structs.replace(MEASURED, days={"counts": "2026-01-03", "parts": "2026-01-04"})
    text = section(entries, measured)
    assert "Rows of 2026-01-01: 3, 11.\nRows of 2026-01-02: 3, 4.\n" in text
    assert [text.count(f"Measured on 2026-01-0{day}.") for day in (3, 4)] == [1, 1]


def test_every_recorded_row_and_table_has_a_day():
    assert all(row["measured"] for row in json.loads(RESULTS.read_text()))
    assert growth.read().days.keys() >= {"counts", "parts"}


def test_the_section_stands_between_its_marks_and_the_rest_stays():
    text = section([Entry.of(2, "share of the limit", [0.95], "x", 0.93, "higher")], MEASURED)
    document = with_section(f"before {BEGIN} old {END} after", text)
    assert document.startswith("before ")
    assert document.endswith(f"{END} after")
    assert "| 2 | share of the limit | 95 % |" in document
    assert "old" not in document
    with pytest.raises(SystemExit, match="marks"):
        with_section("no marks", text)


def test_the_page_is_that_of_the_recorded_results():
    entries = [Entry(**row) for row in json.loads(RESULTS.read_text())]
    page = DOCUMENT.read_text(encoding="utf-8")
    assert page == with_section(page, section(entries, growth.read())), "run `python -m bench.report`"


def test_the_picture_is_drawn(tmp_path):
    draw(MEASURED, tmp_path / "growth.png")
    assert (tmp_path / "growth.png").stat().st_size > 10_000


def test_the_page_shows_the_picture_that_lies_beside_it():
    (path,) = re.findall(r"!\[[^]]+\]\(([^)]+)\)", section([], MEASURED))
    assert DOCUMENT.parent / path == PICTURE
    assert f"]({path})" in DOCUMENT.read_text()


def test_every_number_of_workers_runs_as_often_as_the_repeats(monkeypatch):
    started, written = [], {}

    class Service:
        def __init__(self, workers):
            started.append(workers)

        def __enter__(self):
            return self

        def __exit__(self, *error):
            pass

        def wait_for_workers(self):
            return 1.0

        def wait_for_rounds(self, count):
            return [some_metrics(number) for number in range(count)]

        def memory(self):
            return [1], 1

    monkeypatch.setattr(scaling, "ServiceProcess", Service)
    monkeypatch.setattr(growth, "write", lambda **changes: written.update(changes))
    scaling.measure(repeats=2)
    assert started == 2 * list(scaling.WORKERS)
    assert [(item.workers, item.repeats) for item in written["counts"]] == [
        (workers, 2) for workers in (1, 2, 4, 8, 16, 50)
    ]
