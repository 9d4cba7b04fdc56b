"""A user's task file that is not fit for a run is refused: one line with file, place and what to do."""

import sys
from pathlib import Path

import pytest

from taskschema.errors import TaskFileError
from taskschema_learner.cli.task_reference import named_task, own_task

ROOT = Path(__file__).parents[2]
TRAY = (ROOT / "docs/examples/tray.py").read_text()
TOY = (ROOT / "shared/taskschema/tasks/toy.py").read_text().replace('name = "toy"', 'name = "own"')
CORNERS = 'return [f"x {x:+d}, y {y:+d}, density {density:+d}" for x, y, density in CORNERS]'
DISTANCE = "return np.asarray(missing + np.maximum(turn / TILT_LIMIT - 1.0, 0.0))"
PAPER_SCHEMA = 'paper_schema = (("top_grasp", "top_grasp"), ("lift", "lift"))'
ARGUMENT = 'Argument("distance", "m", 0.0, 0.5, "How far to raise.")'
STEP_RESULT = "return StepResult(self._observe(episodes), success, no_physics.astype(bool), no_physics)"


@pytest.fixture
def place(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def refused(text, class_name, refuse=own_task):
    Path("mine.py").write_text(text)
    with pytest.raises(TaskFileError) as refusal:
        refuse(f"mine.py:{class_name}")
    message = str(refusal.value)
    assert message.startswith("mine.py")
    assert "\n" not in message
    return message


def changed(text, old, new):
    assert text.count(old) == 1
    return text.replace(old, new)


FILES = {
    "syntax": ("class Tray(:\n", "mine.py:1: SyntaxError: invalid syntax."),
    "raises": ("\nraise ValueError('bro\\nken')\n", "mine.py:2: ValueError: bro ken."),
    "raises without words": ("assert False\n", "mine.py:1: AssertionError."),
    "ends the program": ("import sys\nsys.exit(0)\n", "mine.py:2: SystemExit: 0."),
    "imports a file of its own": (
        "import my_helpers\n",
        "mine.py:1: ModuleNotFoundError: No module named 'my_helpers'. Install it, or",
    ),
    "another class": (
        "from taskschema.tasks.toy import Toy\nclass A(Toy): ...\nclass B(Toy): ...\n",
        "There is no Task class 'Tray'; there is: A, B.",
    ),
    "no class": ("Tray = 1\n", "There is no Task class 'Tray'; there is: none."),
    "lacks methods": (
        "from taskschema.tasks.task import Task\nclass Tray(Task): ...\n",
        "'Tray' is not complete, it lacks: observation, pairs;",
    ),
}


@pytest.mark.parametrize("name", FILES)
def test_a_file_that_does_not_run_or_has_no_such_task(place, name):
    text, words = FILES[name]
    assert words in refused(text, "Tray")


SCENES = {
    "unknown skill": (
        '("top_grasp", "lift", "no_op")',
        '("top_grasp", "lft", "no_op")',
        "mine.py:{line}: Unknown skill 'lft'. Did you mean 'lift'? Valid: go_to_pose, lift, no_op, rotate",
    ),
    "raises when it is made": (
        '    name = "tray"',
        '    name = "tray"\n    def __init__(self):\n        raise ValueError("no")',
        "mine.py:{line}: ValueError: no.",
    ),
    "no name": ('name = "tray"', "", "not complete, it lacks: name;"),
    "no family or summary": (
        'family = "lateral_lifting"  # one of the families that the skills are allowed in\n    summary =',
        "other =",
        "not complete, it lacks: family, summary;",
    ),
    "no pairs": ("return PairSpace([", "return ([", "pairs must be a PairSpace of skills, got [<taskschema"),
    "classes for skills": (
        "[SKILLS[name] for",
        "[type(SKILLS[name]) for",
        "must be of skills such as Lift()",
    ),
    "a skill twice": ('("top_grasp", "lift", "no_op")', '("lift", "lift")', "skills with different names"),
    "a name that is a path": ('name = "tray"', 'name = "../tray"', "name must be without a slash"),
    "a name that is none": ('name = "tray"', "name = 3", "name must be words, but is 3."),
    "a shipped task's name": ('name = "tray"', 'name = "picking"', "name must be one of its own"),
    "no horizon": ('name = "tray"', 'name, horizon = "tray", 2.5', "horizon must be a whole number from 1"),
    "too short a horizon": (
        'name = "tray"',
        'name, horizon = "tray", 1',
        "paper_schema must be a tuple of 1 to 1 pairs",
    ),
    "a schema of one": (
        PAPER_SCHEMA,
        'paper_schema = ("lift", "lift")',
        "pairs (left, right) of skill names",
    ),
    "a schema of another skill": (
        PAPER_SCHEMA,
        'paper_schema = (("twist", "lift"),)',
        "paper_schema must be of the skills top_grasp, lift, no_op, but is 'twist'.",
    ),
    "two lengths": ("return (PLATE[0], PLATE[1], HEIGHT)", "return (1, 2)", "object_size must be 3 finite"),
    "a negative length": (
        "return (PLATE[0],",
        "return (-1.0,",
        "object_size must be 3 finite numbers above 0",
    ),
    "a height that is not finite": (
        "* HANDLE[2]) / HEIGHT - 0.5",
        "/ np.inf) * np.nan",
        "top_grasp_height must",
    ),
    "no text": (
        'return f"""\n        <mujoco>',
        'return 3, f"""\n        <mujoco>',
        "object_mjcf must be text",
    ),
    "no XML": ("</worldbody>", "</world>", "object_mjcf of task 'tray' is no XML: mismatched tag"),
    "no body": (
        '<body name="object">',
        '<body name="tray">',
        "no body called object in its worldbody: it needs",
    ),
    "no joint": ('<freejoint name="object"/>', "", 'needs <freejoint name="object"/>'),
    "an unnamed joint": ("<freejoint name=", "<freejoint class=", "has no free joint called object"),
    "a joint that is not said": (
        "</body>",
        '<body><joint name="hinge"/><geom size="0.01"/></body></body>',
        "object_joints (none), in this order, but are: object, hinge.",
    ),
    "a joint that is not there": (
        'name = "tray"',
        'name, object_joints = "tray", ("hinge",)',
        "object_joints (hinge), in this order, but are: object.",
    ),
    "joints in one word": (
        'name = "tray"',
        'name, object_joints = "tray", "lid"',
        "object_joints must be a tuple",
    ),
    "a section that is left out": ("<worldbody>", "<equality/><worldbody>", "but is 'equality'"),
    "no scene": ('type="box"', 'type="bax"', "object_mjcf of task 'tray' does not compile: XML Error"),
    "a draw that raises": (
        "return self._instance(generator.uniform(-1.0, 1.0, 3))",
        "return self._instance(generator.unform(-1.0, 1.0, 3))",
        "mine.py:{line}: draw_instance: AttributeError: ",
    ),
    "no object drawn": (
        "return self._instance(generator.uniform(-1.0, 1.0, 3))",
        "return generator.uniform(-1.0, 1.0, 3)",
        "what draw_instance returns must be an ObjectInstance, but is an array [3] of float64.",
    ),
    "a place of two numbers": (
        "float(y), 0.5 * HEIGHT)",
        "float(y))",
        "position from draw_instance must be 3",
    ),
    "a density that is not finite": (
        "density=float(",
        "density=np.inf * float(",
        "density from draw_instance",
    ),
    "a turn that is none": ("(1.0, 0.0, 0.0, 0.0)", "(0.0, 0.0, 0.0, 0.0)", "must be of length 1 (w x y z)"),
    "a corner that is not there": (
        CORNERS,
        "return list('abcdefghi')",
        "draw_corner: IndexError: list index",
    ),
    "corners that are no names": (CORNERS, "return CORNERS", "corner_names must be a list of names"),
    "a goal that raises": (DISTANCE, "return missing / np.zeros(2)[2]", "goal_reached: IndexError"),
    "a goal that is not boolean": (
        "np.asarray(self.goal_distance(start, poses) == 0.0)",
        "self.goal_distance(start, poses)",
        "what goal_reached returns must be an array [10, 3] of booleans, but is an array [10, 3] of float64.",
    ),
    "a distance at the end alone": (
        DISTANCE,
        f"{DISTANCE}[:, -1:]",
        "goal_reached returns must be an array [10, 3]",
    ),
    "a distance that is not finite": (
        DISTANCE,
        "return np.log(missing - 1.0)",
        "goal_distance returns must be an array [10, 3] of finite numbers",
    ),
}


@pytest.mark.parametrize("name", SCENES)
def test_a_task_with_physics_that_is_not_fit(place, name):
    old, new, words = SCENES[name]
    text = TRAY.replace(old, new)
    assert text != TRAY
    line = (text.partition(new or words)[0] + new).count("\n") + 1
    assert words.format(line=line) in refused(text, "Tray")


EXPERTS = {
    "raises": ("return arguments", "return argumens", "expert_arguments: NameError: name 'argumens'"),
    "another shape": (
        "return arguments",
        "return arguments[0]",
        "returns must be an array [10, 8] of finite numbers, but is an array [8] of float64.",
    ),
    "not finite": ("return arguments", "return arguments / 0", "not all of them finite"),
    "none": ("def expert_arguments", "def expert", "the task has no expert_arguments"),
}


@pytest.mark.parametrize("name", EXPERTS)
def test_an_expert_that_is_not_fit_is_refused_where_it_would_run(place, name):
    old, new, words = EXPERTS[name]
    text = changed(TRAY, old, new)
    assert words in refused(text, "Tray", lambda reference: named_task(None, reference))
    assert own_task("mine.py:Tray").name == "tray"  # to be trained, a task needs none


WORLDS = {
    "limits the wrong way round": (
        ARGUMENT,
        ARGUMENT.replace("0.5", "-0.5"),
        "low 0.0 must be below high -0.5",
    ),
    "limits that are not finite": (ARGUMENT, ARGUMENT.replace("0.0", "-float('inf')"), "both finite"),
    "limits that are no numbers": (
        ARGUMENT,
        ARGUMENT.replace("0.5", "float('nan')"),
        "low 0.0 must be below",
    ),
    "no environment": ("def make_environment", "def make", "the task has no make_environment: define it, or"),
    "an environment that raises": (
        "return ToyEnvironment(self)",
        "return ToyEnvironment()",
        "make_environment: TypeError: ",
    ),
    "an environment of nothing": ("return ToyEnvironment(self)", "return None", "has no attribute 'reset'"),
    "no fields": ("return ObservationLayout(", "return tuple(", "observation must be an ObservationLayout"),
    "a scale of 0": ("scale=0.1", "scale=0.0", "scale of the observation's field 'handles' must be a finite"),
    "centers of another number": ("scale=0.1", "center=(0.0, 1.0)", "'handles' must be 4 finite numbers"),
    "other observations": (
        'ObservationField("holding", 2',
        'ObservationField("holding", 3',
        "what reset returns must be an array [2, 10] of finite numbers, but is an array [2, 9] of float64.",
    ),
    "a tuple of what happens": (
        STEP_RESULT,
        "return self._observe(episodes), success",
        "must be a StepResult",
    ),
    "no observations": (
        STEP_RESULT,
        STEP_RESULT.replace("self._observe(episodes)", "None"),
        "observations from step must be an array [2, 9], but is None.",
    ),
    "success in numbers": (
        "success: BoolArray = np.logical_and(holding, np.all(raised >= GOAL_HEIGHT, axis=1))",
        "success = np.logical_and(holding, np.all(raised >= GOAL_HEIGHT, axis=1)) * 1",
        "success from step must be an array [2] of booleans",
    ),
    "a step that raises": (
        "slips = (raised",
        "slips = (rased",
        "step: NameError: name 'rased' is not defined.",
    ),
    "a skill of another family": ('("all",)', '("picking",)', "own family 'toy' allows: raise, reach."),
}


@pytest.mark.parametrize("name", WORLDS)
def test_a_task_without_physics_that_is_not_fit(place, name):
    old, new, words = WORLDS[name]
    assert words in refused(changed(TOY, old, new), "Toy")


def test_what_the_workers_alone_have_is_not_looked_for_where_no_episodes_run(place, monkeypatch):
    (place / "mine.py").write_text(
        changed(TOY, "return ToyEnvironment(self)", "import only_workers_have_this")
    )
    assert own_task("mine.py:Toy", runs_here=False).name == "own"
    with pytest.raises(TaskFileError, match="ModuleNotFoundError"):
        own_task("mine.py:Toy")
    monkeypatch.setitem(sys.modules, "mujoco", None)
    (place / "mine.py").write_text(changed(TRAY, 'type="box"', 'type="bax"'))
    assert own_task("mine.py:Tray", runs_here=False).name == "tray"
    (place / "mine.py").write_text(changed(TRAY, '<body name="object">', '<body name="tray">'))
    with pytest.raises(TaskFileError, match="no body called object"):
        own_task("mine.py:Tray", runs_here=False)


def test_a_file_may_have_dataclasses_and_print(place, capsys):
    text = "from __future__ import annotations\nfrom dataclasses import dataclass\nprint('hello')\n"
    text += "@dataclass\nclass Place:\n    x: float\n"
    (place / "mine.py").write_text(text + TRAY.partition('"""\n\n')[2])
    assert own_task("mine.py:Tray").name == "tray"
    assert "hello" in capsys.readouterr().out


@pytest.mark.parametrize(
    "reference",
    [
        "docs/examples/tray.py:Tray",
        "docs/examples/carried.py:Box",
        "shared/taskschema/tasks/toy.py:Toy",
        "shared/taskschema/tasks/rotating.py:Rotating",
        "tests/learner/slow_toy.py:SlowToy",
    ],
)
def test_what_is_fit_passes(reference):
    assert named_task(None, str(ROOT / reference)).pairs
