"""Pages other than docs/performance.md that benches write figures into, and what arms hide in frames."""

import sys
from contextlib import closing

import msgspec
import numpy as np
import pytest
from bench import image_training, images, rendering
from bus_setup import some_metrics
from rendering_setup import needs_renderer

from taskschema.config import RunConfig
from taskschema.tasks.registry import get_task
from taskschema_learner.runs.run_folder import RunFolder
from taskschema_worker.audit.episodes import expert, run_schema
from taskschema_worker.recording import RecordingEnvironment


@pytest.fixture
def page(tmp_path, monkeypatch):
    """A copy of the page, which benches write into instead."""
    copy = tmp_path / images.PAGE.name
    copy.write_text(images.PAGE.read_text())
    monkeypatch.setattr(images, "PAGE", copy)
    return copy


def test_each_bench_of_images_writes_between_its_own_marks(page):
    before = page.read_text()
    images.publish("figures of rounds", images.BEGIN, write=True)
    images.publish("figures of trainings", image_training.BEGIN, write=True)
    text = page.read_text()
    assert f"{images.BEGIN}\n\nfigures of rounds\n\n<!-- end of measured -->" in text
    assert f"{image_training.BEGIN}\n\nfigures of trainings\n\n<!-- end of measured -->" in text
    assert text.partition(images.BEGIN)[0] == before.partition(images.BEGIN)[0]
    assert text.rpartition("<!-- end")[2] == before.rpartition("<!-- end")[2]


def test_without_write_figures_are_printed_alone(page, capsys):
    before = page.read_text()
    images.publish("figures", images.BEGIN, write=False)
    assert (page.read_text(), capsys.readouterr().out) == (before, "figures\n")


def test_the_table_of_trainings_is_written_into_the_page(page, monkeypatch):
    rows = [msgspec.structs.replace(some_metrics(number), steps=600 * number) for number in range(3)]
    monkeypatch.setattr(image_training, "train", lambda workers, slots, rounds: rows)
    monkeypatch.setattr(sys, "argv", ["image_training", "--workers", "2", "--write"])
    image_training.main()
    # 1,200 steps in two rounds of 3 x 0.5 s
    assert "| 2 | 400.0 | 1.5 | 33% | 33% | 33% |" in page.read_text()


@needs_renderer
def test_what_arms_hide_is_counted_under_a_runs_own_schema(tmp_path, monkeypatch, capsys):
    task = get_task("lateral-lifting")
    folder = RunFolder.create(tmp_path / "lifting", RunConfig(task=task.name))
    with closing(RecordingEnvironment(task)) as environment:
        instances = [task.draw_instance(np.random.default_rng(0))]
        schema = (("top_grasp", "no_op"), ("no_op", "top_grasp"), ("lift", "lift"))
        run_schema(environment, task, schema, instances, expert(task))
    monkeypatch.setattr(rendering, "run_episodes", lambda folder, count, mean: environment.episodes)
    monkeypatch.setattr(sys, "argv", ["rendering", str(folder.path)])
    rendering.main()
    first, _, *rows = capsys.readouterr().out.splitlines()
    assert first.startswith("(top_grasp, no_op), (no_op, top_grasp)")
    shares = [line.split("|")[3] for line in rows if "lifting: share of the object seen" in line]
    seen = [float(share.removesuffix("% ")) for share in shares]
    assert seen[0] == 100
    assert 30 < seen[1] < 95  # one hand is on the bar
