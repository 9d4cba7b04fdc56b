"""The table of trainings on the twin: what came from simulation says so, beside what did not."""

import argparse
import csv
from pathlib import Path

import msgspec
import pytest
from bus_setup import some_metrics
from studies import robot_twin

from taskschema.config import RunConfig
from taskschema_learner.runs.run_folder import RunFolder
from taskschema_robot.agent.progress import COLUMNS, DROPPED_COLUMNS

CONFIG = RunConfig(task="opening", policy="oracle")
POLICY = "ab" * 32


@pytest.fixture
def place(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def agent_log(name: str, successes: list[bool]) -> None:
    path = robot_twin.RUNS / "agent" / name / "episodes.csv"
    path.parent.mkdir(parents=True)
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(COLUMNS)
        for number, success in enumerate(successes):
            row = dict.fromkeys(COLUMNS, 0) | {"slot": number, "success": int(success), "skills": 3}
            writer.writerow(
                (row | {"refused": 1, "attempt": number % 2, "hours": 0.5, "last_100": 0}).values()
            )


def dropped_log(name: str, count: int) -> None:
    path = robot_twin.RUNS / "agent" / name / "dropped.csv"
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(DROPPED_COLUMNS)
        for number in range(count):
            row = dict.fromkeys(DROPPED_COLUMNS, 0) | {"slot": number, "skills": 2, "reason": "a fault"}
            writer.writerow((row | {"hours": 0.7}).values())


def test_what_dropped_tries_took_is_counted_or_said_to_be_missing(place):
    RunFolder.create(robot_twin.RUNS / "water-bottle", CONFIG)
    agent_log("water-bottle", [False] * 120)  # 60 of them had a try dropped before
    robot_twin.write_results()
    page = Path("results/robot-twin/README.md")
    assert "| water-bottle* |" in page.read_text()
    assert "| 360 | 120 | 60 | 0.5 |" in page.read_text()
    dropped_log("water-bottle", 60)
    robot_twin.write_results()
    assert "| water-bottle | the paper's" in page.read_text()
    assert "| 480 | 120 | 60 | 0.7 |" in page.read_text()  # 120 x 3 + 60 x 2 skills


def test_both_ways_of_an_object_stand_side_by_side(place):
    RunFolder.create(robot_twin.RUNS / "water-bottle", CONFIG)
    config = msgspec.structs.replace(CONFIG, initial_policy=POLICY)
    RunFolder.create(robot_twin.RUNS / "water-bottle-from-simulation", config, b"policy")
    agent_log("water-bottle", [False] * 120)
    agent_log("water-bottle-from-simulation", [False] * 20 + [True] * 180)
    simulated = RunFolder.create(robot_twin.RUNS / "simulated" / "water-bottle", config, b"policy")
    for index, refused in enumerate((300, 30)):
        row = msgspec.structs.replace(
            some_metrics(index), steps=600 * (index + 1), refused=refused, episodes=200 * (index + 1)
        )
        simulated.append_metrics(row)
    robot_twin.write_results()
    text = Path("results/robot-twin/README.md").read_text()
    one, other = (line for line in text.splitlines() if line.startswith("| water-bottle* | the paper's"))
    assert one.split(" | ")[2:7] == ["random", "0.001, 4 x 4", "120", "0", "0"]
    assert one.endswith("| 0% | 0% |")
    assert other.split(" | ")[2:6] == ["simulation's", "0.001, 4 x 4", "200", "180"]
    assert other.endswith("| 80% | 100% |")  # 80 of the first 100, all of the last
    assert "water-bottle from random weights did not reach" in text
    assert "| water-bottle | another run's | 400 | 50.0% | 50% | 50% | 5% |" in text  # 300, 30 of 600


def test_a_report_without_runs_redraws_the_curves_and_leaves_the_page(place):
    robot_twin.OUT.mkdir(parents=True)
    page = robot_twin.OUT / "README.md"
    page.write_text("as it was")
    (robot_twin.OUT / "heavy-bar.csv").write_text("episode,hours,success_last_100\n1,0.5,0.25\n")
    robot_twin.write_results()
    assert page.read_text() == "as it was"
    assert (robot_twin.OUT / "curves.png").stat().st_size > 1000


def test_the_words_about_simulation_are_the_pages():
    page = (Path(robot_twin.__file__).parents[1] / robot_twin.OUT / "README.md").read_text()
    assert robot_twin.SIMULATION in page


@pytest.mark.parametrize("see", ["truth", "camera"])
def test_the_agent_is_told_by_what_to_see(see):
    given = argparse.Namespace(object="water-bottle", see=see)
    command = robot_twin._serve_command(given, Path("somewhere"))
    assert command[command.index("--see") + 1] == see


def test_the_policy_is_handed_to_the_learner(place):
    given = argparse.Namespace(
        task="opening",
        object="water-bottle",
        init_schema=None,
        init_policy="runs/gated",
        rounds=None,
        seed=0,
        set=["ppo.epochs=4"],
    )
    command = robot_twin._train_command(given, Path("somewhere"))
    assert command[command.index("--init-policy") + 1] == "runs/gated"
    assert command[command.index("--set") + 1] == "ppo.epochs=4"
    given.init_policy = None
    assert "--init-policy" not in robot_twin._train_command(given, Path("somewhere"))
