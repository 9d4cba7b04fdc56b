"""Budgets from images: what is brought to places on the table stays what it was where that can be."""

import numpy as np
import pytest
from studies.images_budget import Needs, from_table

from taskschema.randomness import EpisodeKey, Purpose, generator
from taskschema.tasks.registry import get_task
from taskschema_learner.evaluation import wilson
from taskschema_worker.scene_environment import SceneEnvironment


@pytest.mark.parametrize("name", ["lateral-lifting", "picking", "opening", "rotating"])
def test_the_expert_s_places_are_kept_and_a_pose_s_height_is_the_skill_s_own(name):
    task = get_task(name)
    environment = SceneEnvironment(task)
    instances = [task.draw_instance(generator(EpisodeKey(0, 0, 0, n), Purpose.AUDIT)) for n in range(4)]
    observations = environment.reset_to(instances)
    environment.close()
    wanted = task.pairs.to_si(task.pairs.to_normalised(task.expert_arguments(observations, 0)))
    brought = from_table(task, wanted, observations)
    heights = [argument.endswith(".z") for argument in task.pairs.argument_names]
    inside = np.abs(brought - wanted) % (2 * np.pi) < 1e-6
    assert inside[:, ~np.array(heights)].mean() > 0.9  # the rest lies outside of the table's rectangle
    own = task.pose_height * task.observation.get(observations, "object.size")[:, 2]
    for column in np.flatnonzero(heights):
        np.testing.assert_allclose(brought[:, column], own, atol=1e-6)


def test_the_budget_by_hand():
    task = get_task("lateral-lifting")
    # 729 / (9 x 0.0025) = 32,400; 1.5 x (32,400 + 10,000) = 63,600.
    row = Needs(task, good=25, hold=9, random=wilson(25, 10_000)).row(slowest=10_000)
    assert row.startswith("| lateral-lifting | 729 | 25 | 9 | 0.250% |")
    assert row.endswith("| 32,400 | 10,000 | 63,600 |")
    assert "not known" in Needs(task, 25, 9, wilson(0, 100)).row(10_000)
