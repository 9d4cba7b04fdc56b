"""Whatever a user gets wrong is one clear line, a non-zero exit, and nothing half-written."""

import socket
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from taskschema.config import RunConfig
from taskschema.schema import SchemaView
from taskschema.tasks import get_task
from taskschema_learner.runs.run_folder import RunFolder

ROOT = Path(__file__).parents[2]
TRAY = (ROOT / "docs/examples/tray.py").read_text()
TOY = (ROOT / "shared/taskschema/tasks/toy.py").read_text()
COMMAND = Path(sys.executable).with_name("taskschema")


@pytest.fixture
def place(tmp_path):
    (tmp_path / "task.py").write_text("raise ValueError('broken')\n")
    for name, old, new in (
        ("unknown_skill", '"lift", "no_op"', '"lft", "no_op"'),
        ("no_body", '<body name="object">', '<body name="tray">'),
        ("no_scene", 'type="box"', 'type="bax"'),
        ("no_expert", "return arguments", "return arguments[0]"),
    ):
        (tmp_path / f"{name}.py").write_text(TRAY.replace(old, new))
    (tmp_path / "no_pictures.py").write_text(TOY.replace("def frames", "def no_frames"))
    (tmp_path / "no_class.py").write_text("number = 1\n")
    (tmp_path / "no_schema.json").write_text("{}\n")
    RunFolder.create(tmp_path / "runs" / "untrained", RunConfig(task="toy"))
    RunFolder.create(tmp_path / "runs" / "robots", RunConfig(task="toy"), agent="robot")
    for name, logits in (("undecided", np.zeros((3, 9))), ("decided", np.eye(3, 9))):
        folder = RunFolder.create(tmp_path / "runs" / name, RunConfig(task="toy"))
        view = SchemaView(get_task("toy").pairs, logits)
        folder.write_schema(view.document(run=name, task="toy", version=1, used_steps=None, updated_at=""))
    for name, content in (("corrupt", '{"format_ver'), ("newer", '{"format_version": 99}')):
        (tmp_path / "runs" / name).mkdir()
        (tmp_path / "runs" / name / "config.json").write_text(content)
    return tmp_path


def snapshot(place):
    return {path: path.read_bytes() for path in place.rglob("*") if path.is_file()}


def refused(place, *arguments):
    before = snapshot(place)
    result = subprocess.run(
        [COMMAND, *arguments],
        cwd=place,
        capture_output=True,
        text=True,
        timeout=120,
        stdin=subprocess.DEVNULL,
    )
    assert result.returncode == 1, result.stdout + result.stderr
    assert "Traceback" not in result.stderr
    assert result.stderr.startswith("Error: ")
    assert result.stderr.count("\n") == 1, result.stderr
    after = snapshot(place)
    assert {path for path in after if after[path] != before.get(path)} <= {place / "x"}
    assert set(before) <= set(after)
    return result.stderr


CASES = {
    "unknown task": (["train", "toi"], "Did you mean 'toy'?"),
    "no task": (["train"], "Name a TASK"),
    "unknown policy": (["train", "toy", "--policy", "shema"], "Did you mean 'schema'?"),
    "unknown algorithm": (["train", "toy", "--set", "ppo.algorithm=reinforc"], "Did you mean 'reinforce'?"),
    "unknown schema trainer": (["train", "toy", "--set", "schema.trainer=algorithm2"], "Valid: algorithm1"),
    "unknown observation": (["train", "toy", "--observation", "sound"], "Valid: image, state"),
    "a trunk for states": (["train", "toy", "--trunk", "small"], "for --observation image"),
    "looks for states": (["train", "toy", "--randomise-visuals"], "for --observation image"),
    "unknown trunk": (["train", "toy", "--observation", "image", "--trunk", "vgg"], "Did you mean 'vgg16'?"),
    "the baseline on images": (
        ["train", "toy", "--observation", "image", "--policy", "state"],
        "low-dimensional state",
    ),
    "no weights": (
        ["train", "toy", "--observation", "image", "--vgg-weights", "none.pth"],
        "cannot be read",
    ),
    "weights of no kind": (
        ["train", "toy", "--observation", "image", "--vgg-weights", "task.py"],
        "do not fit",
    ),
    "a public key of no kind": (
        ["train", "toy", "--init-schema", "no_schema.json", "--schema-public-key", "task.py"],
        "holds no public key",
    ),
    "unknown task file": (["train", "--task-file", "no.py:Task"], "'no.py' cannot be read"),
    "task file with an unknown skill": (
        ["train", "--task-file", "unknown_skill.py:Tray"],
        ": Unknown skill 'lft'. Did you mean 'lift'? Valid: go_to_pose, ",
    ),
    "task file without the object": (
        ["train", "--task-file", "no_body.py:Tray"],
        "has no body called object",
    ),
    "task file whose scene does not compile": (
        ["train", "--task-file", "no_scene.py:Tray", "--workers", "1"],
        "no_scene.py: object_mjcf of task 'tray' does not compile: XML Error",
    ),
    "task file without pictures": (
        ["train", "--task-file", "no_pictures.py:Toy", "--observation", "image", "--workers", "1"],
        "Task 'toy' has no pictures: use --observation state.",
    ),
    "task file without class": (["train", "--task-file", "task.py"], "FILE:CLASS"),
    "broken task file": (["train", "--task-file", "task.py:Task"], "ValueError: broken"),
    "task file of another class": (
        ["train", "--task-file", "no_class.py:Task"],
        "There is no Task class 'Task'",
    ),
    "unknown schema": (["train", "toy", "--init-schema", "none"], "Unknown run 'none'"),
    "no schema in the file": (["train", "toy", "--init-schema", "no_schema.json"], "is not a schema"),
    "a schema for a policy without one": (
        ["train", "toy", "--policy", "state", "--init-schema", "runs/decided"],
        "are for --policy schema: state learns no schema",
    ),
    "a schema to freeze for a policy that has its own": (
        ["train", "toy", "--policy", "oracle", "--freeze-schema"],
        "are for --policy schema: oracle learns no schema",
    ),
    "no schema to freeze": (["train", "toy", "--freeze-schema"], "--freeze-schema needs --init-schema"),
    "no schema to freeze, set": (["train", "toy", "--set", "schema.frozen=true"], "needs --init-schema"),
    "a schema that says nothing": (
        ["train", "toy", "--init-schema", "runs/undecided"],
        "runs/undecided has no schema to start from",
    ),
    "unknown field": (["train", "toy", "--set", "ppo.learning_rat=1"], "Did you mean 'ppo.learning_rate'?"),
    "no assignment": (["train", "toy", "--set", "seed"], "FIELD=VALUE"),
    "a field that a file's hash is": (
        ["train", "toy", "--observation", "image", "--set", "image.vgg_sha256=00"],
        "--vgg-weights FILE writes it",
    ),
    "value out of range": (["train", "toy", "--set", "ppo.clip=-1"], "'clip' must be above 0"),
    "value of another type": (["train", "toy", "--set", "slots=many"], "slots"),
    "no slots": (["train", "toy", "--slots", "0"], "between 1 and 100000"),
    "Ray elsewhere without Redis": (["train", "toy", "--ray", "10.0.0.1:6379"], "--ray needs --redis"),
    "unreachable Redis": (["train", "toy", "--redis", "redis://127.0.0.1:1", "--api", "none"], "Redis"),
    "Redis of no kind": (["train", "toy", "--redis", "nonsense", "--api", "none"], "no Redis URL"),
    "address of no kind": (["train", "toy", "--api", "here"], "HOST:PORT"),
    "nothing to resume": (["train", "toy", "--resume"], "There is no run in runs/toy-schema-seed0"),
    "resume of what": (["train", "--resume"], "Say which run to resume"),
    "resume of another config": (
        ["train", "toy", "--resume", "--run-dir", "runs/untrained", "--slots", "7"],
        "another config (slots: there 50, here 7)",
    ),
    "a run is there": (
        ["train", "toy", "--run-dir", "runs/untrained", "--api", "none"],
        "already holds a run",
    ),
    "unusable name of a run": (["train", "toy", "--run-dir", "UPPER", "--api", "none"], "lower-case"),
    "unknown run": (["schema", "untraind"], "Did you mean 'untrained'?"),
    "untrained run, schema": (["schema", "untrained"], "schema.json"),
    "untrained run, hash": (["hash", "untrained"], "no checkpoint yet"),
    "untrained run, eval": (["eval", "untrained"], "no policy yet"),
    "untrained run, verify": (["verify", "untrained"], "no rounds yet"),
    "verify of a robot's run": (["verify", "robots"], "cannot be computed again"),
    "a robot's training episodes": (
        ["export", "robots", "x.npz", "--rounds", "1"],
        "runs/robots is a robot's run: its episodes cannot be computed again",
    ),
    "workers for a robot's run": (
        ["train", "--resume", "--run-dir", "runs/robots", "--agent", "simulation"],
        "with --agent robot",
    ),
    "untrained run, plot": (["plot", "untrained"], "no rounds yet"),
    "corrupt run": (["hash", "corrupt"], "damaged config.json"),
    "run of another format": (["schema", "newer"], "format version 99"),
    "resume of a corrupt run": (["train", "--resume", "--run-dir", "runs/corrupt"], "damaged config.json"),
    "unknown audit": (["audit", "toi"], "Unknown task"),
    "audit of nothing": (["audit"], "Name a TASK"),
    "audit of a file with an unknown skill": (
        ["audit", "--task-file", "unknown_skill.py:Tray"],
        "Did you mean 'lift'?",
    ),
    "audit of a file whose expert is not fit": (
        ["audit", "--task-file", "no_expert.py:Tray"],
        "no_expert.py: what expert_arguments returns must be an array [10, 8]",
    ),
    "film of a file whose expert is not fit": (
        ["replay", "--task-file", "no_expert.py:Tray"],
        "no_expert.py: what expert_arguments returns must be an array [10, 8]",
    ),
    "audit of no file": (["audit", "--task-file", "nowhere.py:Mine"], "'nowhere.py' cannot be read"),
    "scale of nothing": (["scale", "3"], "No run trains here"),
    "scale of an unknown run": (["scale", "3", "--run", "nope"], "Unknown run 'nope'"),
}


@pytest.mark.parametrize("name", CASES)
def test_bad_input_is_one_clear_line(place, name):
    arguments, expected = CASES[name]
    assert expected in refused(place, *arguments)


def test_a_busy_port_is_one_clear_line(place):
    with socket.socket() as busy:
        busy.bind(("127.0.0.1", 0))
        busy.listen()
        address = f"127.0.0.1:{busy.getsockname()[1]}"
        assert "is in use" in refused(place, "train", "toy", "--workers", "0", "--api", address)
        assert "is in use" in refused_by_the_api(place, "serve", "untrained", "--api", address)
    assert not (place / "runs" / "toy-schema-seed0").exists()


def refused_by_the_api(place, *arguments):
    result = subprocess.run([COMMAND, *arguments], cwd=place, capture_output=True, text=True, timeout=60)
    assert result.returncode == 1
    assert result.stderr.count("\n") == 1
    return result.stderr


def test_an_unknown_option_is_a_usage_error(place):
    result = subprocess.run(
        [COMMAND, "train", "toy", "--rouds", "3"], cwd=place, capture_output=True, text=True, timeout=60
    )
    assert result.returncode == 2
    assert "Traceback" not in result.stderr


def test_debug_shows_where_an_error_comes_from(place):
    result = subprocess.run(
        [COMMAND, "hash", "nope", "--debug"], cwd=place, capture_output=True, text=True, timeout=60
    )
    assert result.returncode == 1
    assert "Traceback" in result.stderr


def test_images_without_a_renderer(place, monkeypatch):
    monkeypatch.setenv("MUJOCO_GL", "glfw")
    message = refused(place, "train", "lateral-lifting", "--observation", "image", "--workers", "1")
    assert "MUJOCO_GL=glfw cannot draw off screen: set it to egl or osmesa" in message


RIVAL = """
import filelock
from taskschema_learner import composition
from taskschema_learner.cli.main import main
from taskschema_learner.runs.run_folder import RunFolder

def rival(options):
    '''Another learner, which comes first.'''
    global lock
    if {has_config}:
        RunFolder.create(options.run_dir, options.config)
    options.run_dir.mkdir(exist_ok=True, parents=True)
    lock = filelock.FileLock(options.run_dir / "learner.lock")
    lock.acquire()

composition._require_renderer = rival
main()
"""


@pytest.mark.parametrize(
    ("has_config", "words"), [(True, "already holds a run"), (False, "Another learner is training")]
)
def test_of_two_trainings_that_begin_at_once_the_second_leaves_the_first_s_folder(place, has_config, words):
    script = RIVAL.format(has_config=has_config)
    result = subprocess.run(
        [sys.executable, "-c", script, "train", "toy", "--run-dir", "runs/both", "--api", "none"],
        cwd=place,
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert result.returncode == 1
    assert result.stderr.startswith("Error: ")
    assert words in result.stderr
    assert (place / "runs" / "both" / "learner.lock").exists()
    assert (place / "runs" / "both" / "config.json").exists() == has_config
