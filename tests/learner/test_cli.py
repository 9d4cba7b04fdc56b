"""The `taskschema` command as a user types it, on a toy run that a real training made."""

import json
import re
import subprocess
import sys
import time
from pathlib import Path

import msgspec
import numpy as np
import pytest
from rendering_setup import renders
from typer.testing import CliRunner

from taskschema.schema import SchemaDocument
from taskschema_learner.cli.main import app
from taskschema_learner.cli.transfer import initial_logits
from taskschema_learner.runs.run_folder import RunFolder
from taskschema_learner.runs.verification import verify
from taskschema_learner.schemas.schema_file import read_schema
from taskschema_worker.rendering.backend import working_backend

COMMAND = Path(sys.executable).with_name("taskschema")
TRAIN = ["train", "toy", "--workers", "0", "--slots", "5", "--seed", "3", "--api", "none"]


def taskschema(*arguments, cwd, status=0):
    result = subprocess.run(
        [COMMAND, *arguments], cwd=cwd, capture_output=True, text=True, timeout=120, stdin=subprocess.DEVNULL
    )
    assert result.returncode == status, result.stderr + result.stdout
    assert "Traceback" not in result.stderr
    return result.stdout


@pytest.fixture(scope="module", autouse=True)
def own_signing_key(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("TASKSCHEMA_SIGNING_KEY", str(tmp_path_factory.mktemp("key") / "signing-key.pem"))
        yield


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    place = tmp_path_factory.mktemp("place")
    output = taskschema(*TRAIN, "--rounds", "3", cwd=place)
    (place / "output.txt").write_text(output)
    return place


def test_training_says_what_it_found_and_where_it_is(place):
    output = (place / "output.txt").read_text()
    assert "3 rounds are done" in output
    assert "60 episodes" in output  # 3 rounds of 5 slots of 4 episodes
    assert "Schema found: (" in output
    assert "Run folder: runs/toy-schema-seed3" in output
    run = place / "runs" / "toy-schema-seed3"
    assert (run / "curve.png").read_bytes().startswith(b"\x89PNG")
    lines = [json.loads(line) for line in (run / "log.jsonl").read_text().splitlines()]
    assert all(set(line) >= {"time", "part", "level", "message"} for line in lines)


def test_a_training_that_logs_for_programs_draws_its_curve_too(tmp_path):
    taskschema(*TRAIN, "--rounds", "1", "--log-format", "json", cwd=tmp_path)
    run = tmp_path / "runs" / "toy-schema-seed3"
    assert (run / "curve.png").read_bytes().startswith(b"\x89PNG")
    assert (run / "finished.json").exists()


def test_hash_prints_one_sha256_and_nothing_else(place):
    output = taskschema("hash", "toy-schema-seed3", cwd=place)
    rows = RunFolder.open(place / "runs" / "toy-schema-seed3").read_metrics()
    assert output == rows[-1].sha256 + "\n"
    assert output == taskschema("hash", "runs/toy-schema-seed3", cwd=place)


def test_schema_is_shown_compared_and_exported(place):
    table = taskschema("schema", "toy-schema-seed3", cwd=place)
    assert "left arm" in table
    words = taskschema("schema", "toy-schema-seed3", "--compare-paper", cwd=place)
    assert words.startswith("Schema found: (")
    assert any(word in words for word in ("equal", "equivalent", "different"))
    document = msgspec.json.decode(
        taskschema("schema", "toy-schema-seed3", "--json", "--export", "found.json", cwd=place),
        type=SchemaDocument,
    )
    assert read_schema(place / "found.json") == document
    assert (document.version, document.horizon, len(document.pairs)) == (3, 3, 9)
    used = [item for item in document.best if item.used] or document.best
    for good, verdict in (([], "different"), ([[(item.left, item.right) for item in used]], "equivalent")):
        (place / "good.json").write_bytes(msgspec.json.encode(good))
        assert verdict in taskschema("schema", "toy-schema-seed3", "--good-schemas", "good.json", cwd=place)


def test_a_schema_found_before_starts_another_run_and_can_stay_frozen(place, monkeypatch):
    taskschema("schema", "toy-schema-seed3", "--export", "start.json", cwd=place)
    options = ["--rounds", "1", "--freeze-schema", "--run-dir", "frozen"]
    taskschema(*TRAIN, "--init-schema", "start.json", *options, cwd=place)
    given = RunFolder.open(place / "runs" / "toy-schema-seed3").read_schema().logits
    folder = RunFolder.open(place / "frozen")
    assert folder.read_schema().logits == given
    assert folder.config.schema.frozen
    monkeypatch.chdir(place)
    from_run = initial_logits("toy-schema-seed3", folder.config)
    assert from_run == folder.config.schema.initial_logits


def test_eval_reports_both_kinds_of_actions(place):
    answer = json.loads(taskschema("eval", "toy-schema-seed3", "--episodes", "20", "--json", cwd=place))
    for kind in ("sampled", "mean"):
        rate = answer[kind]
        assert rate["episodes"] == 20
        assert rate["low"] <= rate["rate"] <= rate["high"]
    assert "95 % confidence" in taskschema("eval", "toy-schema-seed3", "--episodes", "5", cwd=place)


def test_verify_recomputes_the_run_and_names_the_first_round_that_differs(place):
    folder = RunFolder.open(place / "runs" / "toy-schema-seed3")
    rows = folder.read_metrics()
    assert taskschema("verify", "toy-schema-seed3", cwd=place).startswith("The same: 3 rounds")
    try:
        folder.keep_metrics([rows[0], msgspec.structs.replace(rows[1], sha256="0" * 64), rows[2]])
        assert verify(folder, rounds=1).same
        found = json.loads(taskschema("verify", "toy-schema-seed3", "--json", cwd=place, status=1))
        assert (found["first_difference"], found["computed_sha256"]) == (1, rows[1].sha256)
    finally:
        folder.keep_metrics(rows)


def test_export_and_plot_write_files(place):
    taskschema("export", "toy-schema-seed3", "held-out.jsonl", "--episodes", "3", cwd=place)
    assert len((place / "held-out.jsonl").read_text().splitlines()) == 3
    taskschema("export", "toy-schema-seed3", "trained.npz", "--rounds", "2", cwd=place)
    with np.load(place / "trained.npz", allow_pickle=False) as arrays:
        assert arrays["round"].tolist() == [0] * 20 + [1] * 20
    every = taskschema("export", "toy-schema-seed3", "all.npz", "--rounds", "9", cwd=place)
    assert every == "all.npz: 60 training episodes of the first 3 rounds, computed again\n"
    path = taskschema("plot", "toy-schema-seed3", "--output", "one.png", cwd=place).strip()
    assert (place / path).read_bytes().startswith(b"\x89PNG")
    taskschema("plot", "toy-schema-seed3", "runs/toy-schema-seed3", cwd=place)
    assert (place / "curves.png").exists()


def test_tasks_and_skills_are_listed_quickly(place):
    names = {task["name"] for task in json.loads(taskschema("tasks", "--json", cwd=place))}
    assert {"lateral-lifting", "toy"} <= names
    assert "lateral-lifting" in taskschema("tasks", cwd=place)
    skills = {skill["name"]: skill for skill in json.loads(taskschema("skills", "--json", cwd=place))}
    lift = skills["lift"]["arguments"][0]
    assert (lift["name"], lift["unit"], lift["low"], lift["high"]) == ("distance", "m", 0.0, 0.5)
    assert "starts:" in taskschema("skills", cwd=place)
    script = (
        "import sys; sys.argv = ['taskschema', '--help']\n"
        "from taskschema_learner.cli.main import main\n"
        "try: main()\n"
        "except SystemExit: pass\n"
        "print([n for n in ('torch', 'ray', 'mujoco', 'matplotlib', 'fastapi') if n in sys.modules])"
    )
    result = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert result.stdout.splitlines()[-1] == "[]"


def test_help_is_there_for_every_command(place):
    overview = taskschema("--help", cwd=place)
    commands = [command.name or command.callback.__name__ for command in app.registered_commands]
    assert len(commands) == 16
    for command in commands:
        assert command in overview
        result = CliRunner().invoke(app, [command, "--help"])
        assert result.exit_code == 0
        assert "Usage: " in result.output
        assert len(result.output.splitlines()) > 8


def test_doctor_tells_what_works(place):
    checks = {check["name"]: check for check in json.loads(taskschema("doctor", "--json", cwd=place))}
    assert {"python", "packages", "cores", "memory", "disk", "physics", "rendering", "redis"} <= set(checks)
    assert checks["redis"]["status"] == checks["torch"]["status"] == "works"
    assert all(check["advice"] for check in checks.values() if check["status"] != "works")
    rendering = checks["rendering"]
    assert rendering["status"] == ("works" if renders() else "optional")
    if renders():
        line = r"(\w+) draws with \S.*: ([\d.]+) ms for an overhead frame"
        drawn = re.fullmatch(line, rendering["finding"])
        assert drawn, rendering["finding"]
        assert drawn[1] == working_backend()
        assert 0.0 < float(drawn[2]) < 10_000.0


def test_serve_answers_from_the_folder(place):
    import urllib.request

    server = subprocess.Popen(
        [COMMAND, "serve", "toy-schema-seed3", "--api", "127.0.0.1:0"],
        cwd=place,
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        url = server.stdout.readline().split()[1]
        deadline = time.monotonic() + 30
        while True:
            try:
                with urllib.request.urlopen(f"{url}/schema", timeout=5) as answer:
                    assert json.load(answer)["task"] == "toy"
                break
            except OSError:
                assert time.monotonic() < deadline
    finally:
        server.terminate()
        server.wait(timeout=10)
