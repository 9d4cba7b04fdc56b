"""A run is a function of config and seed: whatever the workers, kills and restarts (README, How it works)."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest
from processes import command_line

from taskschema_learner.runs.run_folder import RunFolder

COMMAND = str(Path(sys.executable).with_name("taskschema"))
SLOW = f"{Path(__file__).with_name('slow_toy.py')}:SlowToy"
ROUNDS = 5


def start(run_dir: Path, *options: str) -> subprocess.Popen[str]:
    command = [COMMAND, "train", "--run-dir", str(run_dir), "--rounds", str(ROUNDS), "--until-success", "0"]
    return subprocess.Popen(
        [*command, "--api", "none", *options],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )


def finish(process: subprocess.Popen[str]) -> str:
    try:
        output, _ = process.communicate(timeout=120)
    finally:
        process.kill()
    assert process.returncode == 0, output
    return output


def run_hash(run_dir: Path) -> str:
    done = subprocess.run([COMMAND, "hash", str(run_dir)], capture_output=True, text=True, check=True)
    assert len(done.stdout.strip()) == 64
    return done.stdout.strip()


def wait_for_rounds(run_dir: Path, process: subprocess.Popen[str], count: int) -> None:
    """Return in the middle of a round after `count` rounds."""
    deadline = time.monotonic() + 90
    while time.monotonic() < deadline:
        assert process.poll() is None, process.communicate()[0]
        if (run_dir / "metrics.csv").exists() and len(RunFolder.open(run_dir).read_metrics()) >= count:
            return
        time.sleep(0.05)
    raise AssertionError(f"{count} rounds took longer than 90 s")


def children(process: subprocess.Popen[str], name: str) -> list[psutil.Process]:
    found = psutil.Process(process.pid).children(recursive=True)
    return [child for child in found if name in command_line(child)]


def kill_all(processes: list[psutil.Process]) -> None:
    for process in processes:
        if process.is_running():
            os.kill(process.pid, signal.SIGKILL)
    _, alive = psutil.wait_procs(processes, timeout=10)
    assert not [process for process in alive if process.status() != psutil.STATUS_ZOMBIE]


@pytest.fixture(scope="module")
def expected(tmp_path_factory) -> str:
    """Hash of the run in one process, undisturbed."""
    run_dir = tmp_path_factory.mktemp("runs") / "undisturbed"
    finish(start(run_dir, "toy", "--workers", "0"))
    return run_hash(run_dir)


@pytest.mark.parametrize("workers", [1, 3])
def test_same_hash_with_any_number_of_workers(workers, tmp_path, expected):
    finish(start(tmp_path / "run", "toy", "--workers", str(workers)))
    assert run_hash(tmp_path / "run") == expected


def test_another_seed_gives_another_hash(tmp_path, expected):
    finish(start(tmp_path / "run", "toy", "--workers", "0", "--seed", "1"))
    assert run_hash(tmp_path / "run") != expected


def test_same_hash_after_a_worker_is_killed(tmp_path, expected):
    process = start(tmp_path / "run", "--task-file", SLOW, "--workers", "2")
    wait_for_rounds(tmp_path / "run", process, 1)
    victims = children(process, "ray::RolloutActor")
    assert victims
    kill_all(victims[:1])
    finish(process)
    assert run_hash(tmp_path / "run") == expected


def test_same_hash_after_redis_is_killed(tmp_path, expected):
    process = start(tmp_path / "run", "--task-file", SLOW, "--workers", "0")
    wait_for_rounds(tmp_path / "run", process, 2)
    victims = children(process, "redis-server")
    assert len(victims) == 1
    kill_all(victims)
    finish(process)
    assert run_hash(tmp_path / "run") == expected


def test_same_hash_after_the_learner_is_killed_and_resumed(tmp_path, expected):
    process = start(tmp_path / "run", "--task-file", SLOW, "--workers", "0")
    wait_for_rounds(tmp_path / "run", process, 2)
    redis = children(process, "redis-server")
    process.kill()
    process.communicate(timeout=30)
    psutil.wait_procs(redis, timeout=10)
    assert not any(item.is_running() for item in redis), "the embedded Redis outlived its learner"
    output = finish(start(tmp_path / "run", "--resume", "--workers", "0"))
    assert run_hash(tmp_path / "run") == expected, output
    assert [row.round for row in RunFolder.open(tmp_path / "run").read_metrics()] == list(range(ROUNDS))


def test_same_hash_after_everything_is_killed_at_once(tmp_path, expected):
    process = start(tmp_path / "run", "--task-file", SLOW, "--workers", "2")
    wait_for_rounds(tmp_path / "run", process, 2)
    kill_all([*psutil.Process(process.pid).children(recursive=True), psutil.Process(process.pid)])
    process.communicate(timeout=30)
    finish(start(tmp_path / "run", "--resume", "--workers", "0"))
    assert run_hash(tmp_path / "run") == expected


def test_the_death_of_ray_ends_the_training_with_one_line(tmp_path, expected):
    process = start(tmp_path / "run", "--task-file", SLOW, "--workers", "2")
    wait_for_rounds(tmp_path / "run", process, 1)
    kill_all(children(process, "raylet/raylet") + children(process, "ray::RolloutActor"))
    output, _ = process.communicate(timeout=90)
    assert process.returncode == 1, output
    assert "Ray has died" in output
    finish(start(tmp_path / "run", "--resume", "--workers", "0"))
    assert run_hash(tmp_path / "run") == expected


def test_ctrl_c_stops_cleanly_and_says_how_to_resume(tmp_path, expected):
    process = start(tmp_path / "run", "--task-file", SLOW, "--workers", "2")
    wait_for_rounds(tmp_path / "run", process, 1)
    family = [psutil.Process(process.pid), *psutil.Process(process.pid).children(recursive=True)]
    asked = time.monotonic()
    process.send_signal(signal.SIGINT)
    output, _ = process.communicate(timeout=30)
    assert time.monotonic() - asked < 10  # 5 s on an idle machine
    assert "--resume" in output
    _, alive = psutil.wait_procs(family, timeout=5)
    assert not alive, "a process was left behind"
    finish(start(tmp_path / "run", "--resume", "--workers", "0"))
    assert run_hash(tmp_path / "run") == expected


def test_a_second_learner_is_refused(tmp_path):
    process = start(tmp_path / "run", "--task-file", SLOW, "--workers", "0")
    wait_for_rounds(tmp_path / "run", process, 1)
    second = start(tmp_path / "run", "--resume", "--workers", "0")
    output, _ = second.communicate(timeout=60)
    assert second.returncode == 1
    assert "Another learner" in output
    finish(process)
