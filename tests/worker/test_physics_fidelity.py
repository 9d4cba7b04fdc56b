"""The shipped physics against a fine reference (1 ms, every body collides, tight solver)."""

import pytest
from bench.fidelity import RATE_DIFFERENCE, SAME_OUTCOME, compare_physics, together
from bench.reference_physics import PERTURBATION, TIMESTEP, reference_model

from taskschema.tasks.registry import get_task


@pytest.mark.slow
@pytest.mark.timeout(3600)
@pytest.mark.parametrize("name", PERTURBATION)
def test_outcomes_are_those_of_the_fine_reference(name):
    agreement = together(compare_physics(get_task(name)))
    # Where the expert nearly always or hardly ever succeeds, agreement would say nothing.
    succeed = 0.5 * (agreement.shipped.mean() + agreement.reference.mean())
    if not 0.4 <= succeed <= 0.6:
        pytest.fail(f"{succeed:.0%} of the perturbed expert's episodes succeed: choose another PERTURBATION")
    assert agreement.same_outcome >= SAME_OUTCOME
    assert agreement.rate_difference <= RATE_DIFFERENCE


@pytest.mark.parametrize("name", PERTURBATION)
def test_the_reference_is_finer_and_excludes_nothing_that_moves_apart(name):
    model = reference_model(get_task(name))
    assert model.opt.timestep == TIMESTEP
    assert (model.geom_contype == 1).all()
    assert (model.geom_conaffinity == 1).all()
    # Both arms' first links stand in their bases; nothing else may be excluded.
    assert model.nexclude == 2
