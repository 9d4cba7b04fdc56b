"""The paper's experiment: its order, its budgets, its tables, and that it can be stopped at any time."""

import fcntl
import json
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import msgspec
import pytest

from taskschema.config import RunConfig
from taskschema.tasks.registry import get_task
from taskschema_learner.cli.experiment import experiment
from taskschema_learner.default_config import default_config
from taskschema_learner.evaluation import wilson
from taskschema_learner.experiment.cell import Cell, CellResult
from taskschema_learner.experiment.experiment import without_places
from taskschema_learner.experiment.measurement import CURVE_ROWS, judged, source_commit, thinned_curve
from taskschema_learner.experiment.plan import RELEARNING_BUDGETS, WHOLE, Plan, next_cell
from taskschema_learner.experiment.report import report
from taskschema_learner.experiment.results_folder import ResultsFolder, Summary
from taskschema_learner.runs.run_folder import RunFolder
from taskschema_learner.runs.run_hash import run_hash
from taskschema_learner.runs.verification import verify

ROOT = Path(__file__).parents[2]
COMMAND = Path(sys.executable).with_name("taskschema")
ORACLE = [
    "experiment",
    "paper-sim",
    "--tasks",
    "toy",
    "--policies",
    "oracle",
    "--seeds",
    "1",
    "--workers",
    "0",
]


def result(task, policy, seed, episodes, state="solved", **others):
    facts = {
        "rounds": episodes // 200,
        "budget": 200_000,
        "minutes": 1.0,
        "success_last_100": 0.9,
        "config_hash": default_config(task, policy, seed).config_hash,
        "sha256": "0" * 64,
        "commit": "",
    }
    return CellResult(task=task, policy=policy, seed=seed, episodes=episodes, state=state, **(facts | others))


def by_cell(*results):
    return {item.cell: item for item in results}


def test_three_seeds_of_schema_and_oracle_come_before_the_baseline_and_that_before_the_others():
    cells = Plan(tasks=("lateral-lifting", "opening")).cells()
    assert len(cells) == len(set(cells)) == 2 * 3 * 5
    blocks = [cells[:12], cells[12:18], cells[18:26], cells[26:]]
    assert [{cell.policy for cell in block} for block in blocks] == [{"oracle", "schema"}, {"state"}] * 2
    assert [{cell.seed for cell in block} for block in blocks] == [{0, 1, 2}] * 2 + [{3, 4}] * 2
    assert [cell.task for cell in cells[:4]] == ["lateral-lifting"] * 2 + ["opening"] * 2


def test_the_baseline_may_take_five_times_the_median_on_lifting_and_the_slowest_seed_elsewhere():
    plan = Plan(tasks=("lateral-lifting", "opening"))
    results = by_cell(
        *(result("lateral-lifting", "schema", seed, 1000 * seed) for seed in (1, 2, 9)),
        *(result("opening", "schema", seed, 3000 * seed) for seed in (1, 2)),
        result("opening", "schema", 0, 99_000, "interrupted"),  # not over: does not count
    )
    assert plan.budget_of(Cell("lateral-lifting", "state", 0), results) == 5 * 2000
    assert plan.budget_of(Cell("opening", "state", 0), results) == 6000
    assert plan.budget_of(Cell("opening", "oracle", 0), results) == plan.budget
    raised = Plan(tasks=plan.tasks, baseline_budget=50_000)
    assert raised.budget_of(Cell("opening", "state", 0), results) == 50_000


def test_the_next_cell_is_the_first_that_is_neither_solved_nor_spent():
    plan = Plan(tasks=("toy",), seeds=1, budget=1000)
    oracle, schema, state = plan.cells()
    assert next_cell(plan, {}, []) == (oracle, 1000)
    results = by_cell(result("toy", "oracle", 0, 400), result("toy", "schema", 0, 600, "interrupted"))
    assert next_cell(plan, results, []) == (schema, 1000)
    assert next_cell(plan, results, [schema]) == (state, 1000)
    results |= by_cell(result("toy", "schema", 0, 1000, "not solved"))
    assert next_cell(plan, results, []) == (state, 1000)
    results |= by_cell(result("toy", "state", 0, 1000, "not solved"))
    assert next_cell(plan, results, []) is None
    # A larger budget opens what was given up, and what was solved stays.
    assert next_cell(Plan(tasks=("toy",), seeds=1, budget=2000), results, []) == (schema, 2000)


def test_curves_are_thinned_to_rounds_that_were_measured(tmp_path):
    class Row(msgspec.Struct):
        episodes: int
        success_last_100: float

    rows = [Row(200 * number, number / 2000) for number in range(1, 2001)]
    curve = thinned_curve(rows)
    assert len(curve) == CURVE_ROWS
    assert curve[0] == (200, 1 / 2000)
    assert curve[-1] == (400_000, 1.0)
    assert all(success == episodes / 400_000 for episodes, success in curve)
    assert thinned_curve(rows[:7]) == [(row.episodes, row.success_last_100) for row in rows[:7]]
    folder = ResultsFolder(tmp_path)
    folder.make()
    folder.write_curve(Cell("toy", "schema", 0), curve)
    assert list(folder.read_curve(Cell("toy", "schema", 0))) == curve


def test_the_page_says_medians_ratios_and_verdicts_as_computed_by_hand():
    pairs = (("reach", "reach"), ("raise", "raise"))
    cells = (
        *(
            result("toy", "schema", seed, episodes, schema=pairs, verdict=verdict)
            for seed, (episodes, verdict) in enumerate(
                [(4000, "equal"), (6000, "equivalent"), (9000, "equal")]
            )
        ),
        result(
            "toy", "state", 0, 30_000, "not solved", budget=30_000, success_last_100=0.02, commit="1a2b3c4+"
        ),
        result("toy", "state", 1, 20_000),
        result("toy", "state", 2, 30_000, "not solved", budget=30_000),
        result("toy", "oracle", 0, 2000),
        result("toy", "oracle", 1, 4000),
        result("toy", "oracle", 2, 800, "interrupted"),
    )
    page = report(Summary(experiment="paper-sim", machines=("2 cores",), cells=cells))
    assert "| toy | schema | 4,000 | 6,000 | 9,000 | 6,000 | 1 |" in page
    # 20,000, then two larger than 30,000, the first of them the median: 30,000 / 6,000 = 5.
    assert "| toy | state | > 30,000 | 20,000 | > 30,000 | > 30,000 | more than 5 |" in page
    assert "| toy | oracle | 2,000 | 4,000 | 800 so far | 3,000 | 0.5 |" in page
    assert "| toy | (reach, reach), (raise, raise) | 3 of 3 | 2 | 1 | 0 | 0 |" in page
    assert "| toy | state | 0 | not solved | 30,000 | - | 30,000 | 1.0 | 2% | - | - | - | 1a2b3c4+ |" in page


def test_the_page_says_what_was_aimed_at_and_whether_it_was_reached():
    pairs = (("top_grasp", "top_grasp"), ("lift", "lift"))
    cells = (
        result("lateral-lifting", "schema", 0, 9000, schema=pairs, verdict="equal"),
        result("lateral-lifting", "schema", 1, 11_000, schema=pairs, verdict="different"),
        result("lateral-lifting", "state", 0, 40_000),
        result("lateral-lifting", "oracle", 0, 5000),
        result("opening", "schema", 0, 6000, schema=pairs, verdict="equivalent"),
        result("opening", "state", 0, 6000, "not solved", budget=6000),
        result("opening", "oracle", 0, 9000),
        result("rotating", "schema", 0, 400, "interrupted"),
    )
    page = report(Summary(experiment="paper-sim", machines=("2 cores",), cells=cells), "**Why**: luck.\n")
    for line in (
        "| lateral-lifting: `schema` solves it with every seed | 2 of 2 | yes |",
        "| lateral-lifting: its schemas are equal or equivalent to the paper's | 1 of 2 | **no** |",
        "| lateral-lifting: `state` takes at least 5 times as many episodes | 4 times | **no** |",
        "| opening: `state` does not solve it with the episodes of the slowest `schema` seed "
        "| 0 of 1 seeds do | yes |",
        "| lateral-lifting: `oracle` takes fewer episodes than `schema` | 0.5 times | yes |",
        "| opening: `oracle` takes fewer episodes than `schema` | 1.5 times | **no** |",
        "**Why**: luck.",
        # What is open of the whole experiment, whatever part of it is at hand.
        "- lateral-lifting, `schema`: seeds 2, 3, 4",
        "- picking, `state`: seeds 0, 1, 2, 3, 4",
        "- rotating, `schema`: seeds 0 (at 400 episodes), 1, 2, 3, 4",
    ):
        assert line in page.splitlines()
    assert "| rotating: " not in page  # nothing can be said of it yet


def test_remarks_beside_the_results_come_onto_the_page(tmp_path):
    folder = ResultsFolder(tmp_path)
    assert folder.remarks() == ""
    (tmp_path / "remarks.md").write_text("Slow on Mondays.\n")
    assert folder.remarks() == "Slow on Mondays.\n"


def test_a_result_names_its_commit_and_whether_other_code_ran():
    known = subprocess.run(
        ["git", "-C", ROOT, "rev-parse", "--short", "HEAD"], capture_output=True, text=True
    )
    assert source_commit().removesuffix("+") == known.stdout.strip()


def test_a_schema_that_the_audit_missed_is_different_and_counted_as_as_good_by_its_held_out_success():
    pairs = (("reach", "reach"), ("raise", "raise"))
    cells = tuple(
        result("toy", "schema", seed, 4000, state, schema=pairs, verdict="different", held_out=held_out)
        for seed, (state, held_out) in enumerate(
            [
                ("solved", wilson(190, 200)),
                ("solved", wilson(189, 200)),
                ("solved", None),
                ("not solved", None),
            ]
        )
    )
    page = report(Summary(experiment="paper-sim", machines=("2 cores",), cells=cells))
    assert "| toy | (reach, reach), (raise, raise) | 3 of 4 | 0 | 0 | 3 | 1 |" in page


def test_verdicts_are_those_of_the_good_set_of_today():
    stale = result("toy", "schema", 0, 4000, schema=get_task("toy").paper_schema, verdict="different")
    assert judged(stale).verdict == "equal"
    state = result("toy", "state", 0, 4000)
    assert judged(state) == state


def test_from_images_everything_is_compared_with_the_transferred_schema():
    transferred = result("toy", "transferred", 0, 2000)
    page = report(Summary(experiment="images-sim", machines=("2 cores",), cells=(transferred,)))
    assert "times `transferred`" in page
    assert "The schema that" not in page  # nothing has learned one
    relearned = result("toy", "re-learned", 0, 8000, "not solved", budget=8000)
    page = report(Summary(experiment="images-sim", machines=("2 cores",), cells=(transferred, relearned)))
    assert "| toy | re-learned | > 8,000 | > 8,000 | more than 4 |" in page
    assert "| toy: 90 % within the budget, the schema transferred | 1 of 1 seeds | yes |" in page
    assert "The schema that `re-learned` found" in page


@pytest.mark.parametrize(
    ("task", "budget", "state", "reached"),
    [
        ("lateral-lifting", 80_500, "not solved", "yes"),
        ("lateral-lifting", 40_000, "not solved", "not judged: its budget was below the derived one"),
        ("lateral-lifting", 40_000, "solved", "**no**"),
        ("rotating", 40_000, "not solved", "not judged: what learning it should take is not known"),
    ],
)
def test_that_a_schema_is_not_learned_again_is_judged_from_the_derived_budget_on(
    task, budget, state, reached
):
    cell = result(task, "re-learned", 0, budget, state, budget=budget)
    page = report(Summary(experiment="images-sim", machines=("2 cores",), cells=(cell,)))
    solved = int(state == "solved")
    line = f"| {task}: not by then, the schema learned again | {solved} of 1 seeds do | {reached} |"
    assert line in page.splitlines()


def test_on_images_what_is_learned_again_has_the_budget_derived_for_its_task():
    plan = WHOLE["images-sim"]
    budgets = {(cell.task, cell.policy): plan.budget_of(cell, {}) for cell in plan.cells()}
    assert {budgets[task, "transferred"] for task in plan.tasks} == {40_000}
    assert [budgets[task, "re-learned"] for task in plan.tasks] == [80_500, 22_800, 197_200, 40_000]
    page = (ROOT / "results" / "images-sim" / "budget.md").read_text()
    rows = re.findall(r"^\| ([a-z-]+) \| \d.*\| ([0-9,]+|not known) \|$", page, re.MULTILINE)
    known = {task: int(words.replace(",", "")) for task, words in rows if words != "not known"}
    assert (len(rows), known) == (len(plan.tasks), RELEARNING_BUDGETS)


def test_the_page_lists_what_was_given_up_before_the_budget_that_the_command_has():
    cells = tuple(
        result(task, "re-learned", 0, 40_000, "not solved", budget=40_000)
        for task in ("lateral-lifting", "picking")
    )
    page = report(Summary(experiment="images-sim", machines=("2 cores",), cells=cells))
    assert "- lateral-lifting, `re-learned`: seeds 0 (at 40,000 episodes), 1, 2, 3, 4" in page
    assert "- picking, `re-learned`: seeds 1, 2, 3, 4" in page


@pytest.mark.parametrize("name", WHOLE)
def test_the_command_trains_the_whole_experiment_by_default(monkeypatch, name):
    plans = []

    def run(name, plan, *others):
        plans.append(plan)
        return True

    monkeypatch.setattr("taskschema_learner.experiment.experiment.run_experiment", run)
    experiment(name)
    assert (plans[0].cells(), plans[0].budget) == (WHOLE[name].cells(), WHOLE[name].budget)
    assert plans[0].relearning_budgets == WHOLE[name].relearning_budgets
    experiment(name, tasks="rotating, opening", seeds=1, budget=7000)
    cells = plans[1].cells()
    assert [cell.task for cell in cells[:: len(cells) // 2]] == ["rotating", "opening"]
    assert {plans[1].budget_of(cell, {}) for cell in cells} == {7000}


@pytest.mark.parametrize("output", ["--output=here", "--output here", "-o here", "-ohere"])
def test_the_recorded_command_names_no_folder_of_this_machine(output):
    typed = f"taskschema experiment paper-sim --tasks toy --runs-dir /somewhere/else {output} --workers 0"
    assert without_places(typed) == "taskschema experiment paper-sim --tasks toy --workers 0"


def command(place, *arguments):
    return subprocess.Popen(
        [COMMAND, *arguments], cwd=place, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )


def wait_for_rounds(process, metrics, rounds):
    deadline = time.monotonic() + 200
    while not (metrics.exists() and len(metrics.read_text().splitlines()) > rounds):
        assert process.poll() is None, process.stdout.read()
        assert time.monotonic() < deadline
        time.sleep(0.01)


@pytest.mark.timeout(600)
def test_an_experiment_that_is_killed_and_stopped_goes_on_to_the_same_result(tmp_path):
    run = tmp_path / "runs" / "paper-sim" / "toy-oracle-seed0"
    metrics = run / "metrics.csv"
    process = command(tmp_path, *ORACLE)
    wait_for_rounds(process, metrics, 2)
    process.kill()
    process.wait()
    with (run / "learner.lock").open() as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # waits until the cell's training has ended, too

    process = command(tmp_path, *ORACLE)
    wait_for_rounds(process, metrics, 6)
    process.send_signal(signal.SIGTERM)
    output, _ = process.communicate(timeout=200)
    assert process.returncode == 0, output
    assert "Stopped. Continue with: taskschema experiment paper-sim --tasks toy" in output
    assert "Warning" not in output
    results = tmp_path / "results" / "paper-sim"
    stopped = json.loads((results / "summary.json").read_text())["cells"][0]
    assert stopped["state"] == "interrupted"
    assert f"{stopped['episodes']:,} so far" in (results / "README.md").read_text()

    output, _ = command(tmp_path, *ORACLE).communicate(timeout=200)
    assert "Going on after" in output, output
    done = json.loads((results / "summary.json").read_text())["cells"][0]
    assert done["state"] == "solved"
    assert done["episodes"] > stopped["episodes"]
    assert (done["held_out"]["episodes"], done["held_out"]["rate"] > 0.8) == (200, True)
    assert done["sha256"] == run_hash(RunFolder.open(run))
    assert verify(RunFolder.open(run), done["rounds"]).same  # what was never stopped has the same hashes

    output, _ = command(tmp_path, *ORACLE, "--verify").communicate(timeout=200)
    assert "1 of 1 cells end with the same policy as before." in output
    assert "the same policy, to the bit: toy oracle 0." in (results / "README.md").read_text()

    # A third start has nothing to train, not even where the runs are gone; the figure comes from the tables.
    metrics.parent.rename(tmp_path / "gone")
    output, _ = command(tmp_path, *ORACLE).communicate(timeout=200)
    assert "All cells are done" in output
    assert "Training" not in output
    (results / "figure.png").unlink()
    output, _ = command(tmp_path, "plot", "results/paper-sim").communicate(timeout=200)
    assert (results / "figure.png").read_bytes().startswith(b"\x89PNG"), output


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["paper-real"], "Unknown experiment 'paper-real'. .*Valid: images-sim, paper-sim"),
        (["paper-sim", "--tasks", "toy,pickin"], "Unknown task 'pickin'"),
        (["paper-sim", "--policies", "oracel"], "Unknown policy 'oracel'. Did you mean 'oracle'"),
    ],
)
def test_bad_words_are_named_with_the_valid_ones(tmp_path, arguments, words):
    process = command(tmp_path, "experiment", *arguments)
    output, _ = process.communicate(timeout=200)
    assert process.returncode == 1
    assert re.search(words, output), output
    assert list(tmp_path.iterdir()) == []


def test_results_of_other_settings_or_damaged_ones_stop_it_and_stay(tmp_path):
    folder = ResultsFolder(tmp_path / "results" / "paper-sim")
    folder.make()
    other = RunConfig(task="any", episodes_per_slot=1, slots=7)
    folder.write(Summary(experiment="paper-sim", settings=other))
    before = (folder.path / "summary.json").read_bytes()
    output, _ = command(tmp_path, *ORACLE).communicate(timeout=200)
    assert "holds results of other settings" in output
    assert (folder.path / "summary.json").read_bytes() == before
    (folder.path / "summary.json").write_text("{")
    output, _ = command(tmp_path, *ORACLE).communicate(timeout=200)
    assert "summary.json cannot be read" in output
    folder.write(Summary(experiment="paper-sim"))
    RunFolder.create(tmp_path / "runs" / "paper-sim" / "toy-oracle-seed0", RunConfig(task="toy", slots=7))
    output, _ = command(tmp_path, *ORACLE).communicate(timeout=200)
    assert "toy-oracle-seed0 holds a run of other settings" in output
