"""Every skill has a page that shows its motion and says what it takes."""

from pathlib import Path

import pytest
from bench.pictures import SHOWN_IN

from taskschema.skills.registry import SKILLS

DOCS = Path(__file__).parents[1] / "docs"


@pytest.mark.parametrize("name", SKILLS)
def test_a_skill_has_a_page_with_its_arguments_states_and_picture(name):
    skill, file_name = SKILLS[name], name.replace("_", "-")
    page = " ".join((DOCS / "skills" / f"{file_name}.md").read_text().split())
    for argument in skill.arguments:
        assert f"| `{argument.name}` | {argument.unit} |" in page
    assert skill.start_state in page
    assert skill.end_state in page
    assert f"../pictures/{file_name}.gif" in page
    assert (DOCS / "pictures" / f"{file_name}.gif").read_bytes().startswith(b"GIF89a")


def test_the_film_of_a_skill_shows_a_step_that_runs_it():
    from taskschema.tasks.registry import get_task

    assert set(SHOWN_IN) == set(SKILLS)
    for name, (task, step) in SHOWN_IN.items():
        assert name in get_task(task).paper_schema[step - 1]
