"""`taskschema tasks` and `taskschema skills`: what there is to learn, and from what."""

from typing import TYPE_CHECKING

import typer

from taskschema_learner.cli.output import Json, print_json

if TYPE_CHECKING:
    from taskschema.skills import Argument, Skill
    from taskschema.tasks.task import Task


def register(app: typer.Typer) -> None:
    """Add the commands."""
    app.command()(tasks)
    app.command()(skills)


def tasks(as_json: Json = False) -> None:
    """List the tasks: their goal, horizon, skills and the paper's schema."""
    from taskschema.tasks.registry import get_task, task_names

    found = [get_task(name) for name in task_names()]
    if as_json:
        print_json([_task_facts(task) for task in found])
        return
    from rich.console import Console
    from rich.table import Table

    from taskschema_learner.schemas.schema_report import schema_words

    table = Table("task", "what it is", "T", "|X|", "A", "D", "paper's schema (left, right)", show_lines=True)
    for task in found:
        sizes = (task.horizon, len(task.pairs), task.pairs.argument_count, task.observation.size)
        table.add_row(task.name, task.summary, *map(str, sizes), schema_words(task.paper_schema))
    console = Console()
    console.print(table)
    console.print("T: most steps, |X|: skill pairs, A: arguments of both arms, D: numbers observed.")


def skills(as_json: Json = False) -> None:
    """List the skills: their arguments with units and search spaces, and where they begin and end."""
    from taskschema.skills.registry import SKILLS
    from taskschema.tasks.registry import get_task, task_names

    found = list(SKILLS.values())
    for name in task_names():  # a task without physics brings skills of its own
        found += [skill for skill in get_task(name).pairs.skills if type(skill) not in map(type, found)]
    if as_json:
        print_json([_skill_facts(skill) for skill in found])
        return
    for skill in found:
        print(f"{skill.name} ({', '.join(skill.families)}): {skill.summary}")
        for argument in skill.arguments:
            print(f"    {_argument_words(argument)}")
        print(f"    starts: {skill.start_state}")
        print(f"    ends:   {skill.end_state}\n")


def _argument_words(argument: "Argument") -> str:
    turn = ", wraps" if argument.periodic else ""
    space = f"{argument.low:g} to {argument.high:g} {argument.unit}{turn}"
    return f"{argument.name}: {space}. {argument.meaning}"


def _task_facts(task: "Task") -> dict[str, object]:
    return {
        "name": task.name,
        "family": task.family,
        "summary": task.summary,
        "horizon": task.horizon,
        "skills": [skill.name for skill in task.pairs.skills],
        "pairs": len(task.pairs),
        "arguments": task.pairs.argument_names,
        "observation": [
            {"name": field.name, "size": field.size, "unit": field.unit, "meaning": field.meaning}
            for field in task.observation.fields
        ],
        "paper_schema": task.paper_schema,
    }


def _skill_facts(skill: "Skill") -> dict[str, object]:
    return {
        "name": skill.name,
        "summary": skill.summary,
        "families": skill.families,
        "arguments": [
            {
                "name": argument.name,
                "unit": argument.unit,
                "low": argument.low,
                "high": argument.high,
                "periodic": argument.periodic,
                "meaning": argument.meaning,
            }
            for argument in skill.arguments
        ],
        "start_state": skill.start_state,
        "end_state": skill.end_state,
    }
