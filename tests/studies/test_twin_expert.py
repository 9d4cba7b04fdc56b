"""Every object of the catalogue can be handled on the twin, gate and watchdogs included."""

import pytest
from studies.twin_expert import rehearse

from taskschema_robot.objects.catalogue import OBJECTS


@pytest.mark.parametrize("item", OBJECTS.values(), ids=OBJECTS)
def test_an_expert_solves_the_task_of_every_object(item):
    tally = rehearse(item, episodes=3, seed=0)
    assert tally.successes >= 2, f"{tally}: {tally.refused + tally.dropped}"
