"""A fine reference of a task's physics, and the perturbed expert that both physics are compared on."""

import itertools
import xml.etree.ElementTree as ET
from collections.abc import Sequence

import mujoco
import numpy as np

from taskschema.arrays import BoolArray
from taskschema.randomness import EpisodeKey, Purpose, generator
from taskschema.scene import scene_mjcf
from taskschema.tasks.scene_task import SceneTask
from taskschema_worker.audit.episodes import ArgumentSource, run_schema
from taskschema_worker.scene_environment import SceneEnvironment
from taskschema_worker.simulation import Simulation

TIMESTEP = 0.001
"""[s]"""
COARSER_TIMESTEP = 0.002
"""[s] of a second reference: how far the two agree is as far as two good physics can be expected to."""
SOLVER = {"tolerance": "1e-10", "iterations": "200", "ls_iterations": "100"}
PERTURBATION = {"lateral-lifting": 0.25, "picking": 0.23, "opening": 0.1, "rotating": 0.12}
"""Standard deviation of the expert's noise by task, in normalised units (the search space is +-1), at which
about half of the episodes fail."""
SEED = 7


def reference_model(
    task: SceneTask, timestep: float = TIMESTEP, *, every_body: bool = True
) -> mujoco.MjModel:
    """Compile the task's scene with fine steps [s], a tight solver, and all bodies colliding with all others.

    Links whose shapes overlap already at home, as neighbours' do, are left out. Not `every_body`: what may
    touch what is as shipped.
    """
    root = scene_mjcf(task)
    option = root.find("option")
    assert option is not None
    option.attrib |= SOLVER | {"timestep": f"{timestep:g}"}
    if not every_body:
        return _compiled(root)
    for geom in root.iter("geom"):
        geom.attrib |= {"contype": "1", "conaffinity": "1"}
    overlapping = _overlapping_bodies(task, _compiled(root))
    contact = ET.SubElement(root, "contact")
    for first, second in overlapping:
        ET.SubElement(contact, "exclude", {"body1": first, "body2": second})
    return _compiled(root)


def _compiled(root: ET.Element) -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(ET.tostring(root, encoding="unicode"))


def _overlapping_bodies(task: SceneTask, model: mujoco.MjModel) -> set[tuple[str, str]]:
    """Return the names of bodies that are in each other at home, the object aside."""
    simulation = Simulation(task, threads=1, model=model)
    simulation.reset([task.draw_instance(np.random.default_rng(SEED))])
    data = mujoco.MjData(model)
    data.qpos[:] = simulation.positions[0]
    simulation.close()
    mujoco.mj_forward(model, data)
    pairs = [
        tuple(model.body(model.geom(geom).bodyid[0]).name for geom in (contact.geom1, contact.geom2))
        for contact in data.contact
    ]
    return {(first, second) for first, second in pairs if "object" not in (first, second)}


def perturbed_outcomes(
    task: SceneTask, model: mujoco.MjModel | None, episodes: Sequence[int], threads: int
) -> BoolArray:
    """Return which seeded episodes of the perturbed expert succeed; None: the shipped physics."""
    rngs = [generator(EpisodeKey(SEED, 0, 0, episode), Purpose.AUDIT) for episode in episodes]
    instances = [task.draw_instance(rng) for rng in rngs]
    environment = SceneEnvironment(task, threads, model)
    try:
        return run_schema(environment, task, task.paper_schema, instances, _perturbed(task, rngs)).success
    finally:
        environment.close()


def _perturbed(task: SceneTask, rngs: Sequence[np.random.Generator]) -> ArgumentSource:
    space = task.pairs
    shape = (len(task.paper_schema), space.argument_count)
    noise = PERTURBATION[task.name] * np.stack([rng.standard_normal(shape) for rng in rngs])

    def arguments(observations, step, part):
        return space.to_si(space.to_normalised(task.expert_arguments(observations, step)) + noise[part, step])

    return arguments


def blocks(count: int, size: int) -> list[range]:
    """Return the numbers 0 to count - 1 in blocks of `size`."""
    edges = [*range(0, count, size), count]
    return [range(start, stop) for start, stop in itertools.pairwise(edges)]
