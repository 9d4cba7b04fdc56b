"""Every task with a scene has a page; its search space on images is the one that policies act in."""

from pathlib import Path

import pytest

from taskschema.tasks.registry import get_task, task_names
from taskschema.tasks.scene_task import SceneTask

DOCS = Path(__file__).parents[1] / "docs"


@pytest.mark.parametrize("name", [name for name in task_names() if isinstance(get_task(name), SceneTask)])
def test_a_page_says_which_rectangle_of_the_table_policies_on_images_act_in(name):
    task = get_task(name)
    table = {"x": task.table.x, "y": task.table.y}
    located = [argument for argument in task.image_pairs.arguments if argument.name in table]
    assert {argument.name for argument in located} == set(table)
    assert all((argument.low, argument.high) == table[argument.name] for argument in located)
    page = " ".join((DOCS / "tasks" / f"{name}.md").read_text().split())
    words = [f"`{axis}` from {low:.2f} to {high:.2f} m" for axis, (low, high) in table.items()]
    assert f"the response maps cover {' and '.join(words)}." in page
