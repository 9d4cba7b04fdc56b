"""What an episode's object has of its own reaches the physics, whatever the episodes before it had."""

from dataclasses import replace

import numpy as np
import pytest

from taskschema.tasks.lateral_lifting import LateralLifting
from taskschema_worker.simulation import Simulation

TASK = LateralLifting()
GRAVITY = 9.81
SECONDS = 0.2


@pytest.fixture(scope="module")
def simulation():
    simulation = Simulation(TASK, threads=1)
    yield simulation
    simulation.close()


def pushed_bar_speeds(simulation, frictions, speed=1.5):
    """Slide one bar per friction along its length; return each one's speed loss a second [m/s^2]."""
    bar = TASK.draw_instance(np.random.default_rng(0))
    along_x = replace(bar, quaternion=(1.0, 0.0, 0.0, 0.0))  # where the friction pyramid has its edge
    simulation.reset([replace(along_x, friction=friction) for friction in frictions])
    simulation.velocities[:, -6] = speed
    rest = simulation.positions[:, simulation.indices.arm_positions]
    steps = round(SECONDS / simulation.timestep)
    controls = np.zeros((len(frictions), steps, simulation.control_count))
    controls[:, :, simulation.indices.arm_controls] = rest[:, None]
    simulation.advance(np.arange(len(frictions)), controls)
    return (speed - simulation.velocities[:, -6]) / SECONDS


def test_a_sliding_object_loses_speed_by_its_own_friction(simulation):
    """By hand: friction times gravity; 0.2 takes 1.96 m/s off each second, 0.5 takes 4.9."""
    frictions = np.array([0.2, 0.5, 0.7])
    np.testing.assert_allclose(pushed_bar_speeds(simulation, frictions), frictions * GRAVITY, rtol=0.08)


def test_models_used_again_forget_the_friction_before(simulation):
    first = pushed_bar_speeds(simulation, [None, 0.3])
    again = pushed_bar_speeds(simulation, [0.3, None])
    np.testing.assert_array_equal(again, first[::-1])
