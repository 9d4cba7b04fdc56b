"""One agent a folder, however the last one ended."""

import subprocess
import sys

import pytest

from taskschema.errors import ConfigError
from taskschema_robot.agent.folder_lock import only_agent_of

HOLDING = """
import sys
from pathlib import Path
from taskschema_robot.agent.folder_lock import only_agent_of
with only_agent_of(Path(sys.argv[1])):
    print("held", flush=True)
    sys.stdin.read()
"""


def test_a_second_agent_is_refused_until_the_first_is_gone(tmp_path):
    words = [sys.executable, "-c", HOLDING, str(tmp_path)]
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as first:
        assert first.stdout.readline() == b"held\n"
        with pytest.raises(ConfigError, match="stop that one first"), only_agent_of(tmp_path):
            pass
        first.kill()
    with only_agent_of(tmp_path):
        pass
    with only_agent_of(tmp_path):
        pass
