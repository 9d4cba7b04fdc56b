"""What a process that only runs episodes leaves out."""

import os
import subprocess
import sys

import pytest

PROGRAM = """
import sys
from taskschema.config import RunConfig
from taskschema.tasks.registry import get_task
from taskschema_worker.environments import environment_of, spare_graphics

config = RunConfig(task="lateral-lifting", observation=sys.argv[1])
spare_graphics(config)
environment_of(RunConfig(task="lateral-lifting"), get_task("lateral-lifting")).close()
print("glfw" in sys.modules)
"""


@pytest.mark.parametrize(("observation", "draws"), [("state", "False"), ("image", "True")])
def test_workers_on_states_import_nothing_that_draws(observation, draws):
    clean = {name: value for name, value in os.environ.items() if name != "MUJOCO_GL"}
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, observation], env=clean, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout.strip()) == (0, draws), done.stderr
