"""`taskschema-robot twin` and `fault`, as processes of their own."""

import json
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from taskschema_robot.drivers.rosbridge import RosbridgeAddress, RosbridgeArm
from taskschema_robot.errors import TwinError
from taskschema_robot.twin.client import TwinClient
from taskschema_robot.twin.lock_step import LockStepClock
from taskschema_robot.twin.twin import FINGER_MOUNT

COMMAND = [sys.executable, "-c", "from taskschema_robot.cli.main import main; main()"]
FREE_PORTS = ["--left", "0", "--right", "0", "--control", "0"]


def run(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([*COMMAND, *arguments], capture_output=True, text=True, timeout=120)


@pytest.fixture(params=["ports", "files"])
def twin(request, tmp_path):
    places = FREE_PORTS if request.param == "ports" else ["--sockets", str(tmp_path / "twin")]
    arguments = [*COMMAND, "twin", "--object", "water-bottle", *places, "--lock-step", "--json"]
    process = subprocess.Popen(arguments, stdout=subprocess.PIPE, text=True)
    try:
        yield process, json.loads(process.stdout.readline())
    finally:
        process.kill()
        process.wait()


def test_a_twin_serves_until_it_is_interrupted(twin):
    process, addresses = twin
    client = TwinClient(addresses["control"])
    description = client.describe()
    assert description.name == "water-bottle"
    assert not description.real_time
    clock = LockStepClock(client)
    address = RosbridgeAddress(addresses["right"], FINGER_MOUNT, None)
    arm = RosbridgeArm("right", address, clock, clock.input_output)
    clock.watch(lambda: arm.connection)
    arm.connect()
    result = run("fault", "press-emergency-stop", "--arm", "right", "--twin", addresses["control"])
    assert result.returncode == 0, result.stderr
    assert result.stdout == "press-emergency-stop: on, right\n"
    clock.sleep_until(clock.now() + 0.05)
    assert arm.state().emergency_stop
    arm.close()
    client.close()
    process.send_signal(signal.SIGINT)
    assert process.wait(30) == 0


def test_bad_input_is_one_line_that_says_what_to_do():
    result = run("twin", "--object", "heavy-ba", *FREE_PORTS)
    assert result.returncode == 1
    assert result.stderr.count("\n") == 1
    assert "Did you mean 'heavy-bar'?" in result.stderr
    result = run("fault", "freeze-camera", "--twin", "ws://127.0.0.1:9")
    assert result.returncode == 1
    assert "start one with `taskschema-robot twin`" in result.stderr
    result = run("fault", "freeze-state", "--arm", "middle")
    assert result.returncode == 2
    assert "left or right" in result.stderr


@pytest.mark.parametrize("twin", ["files"], indirect=True)
def test_only_the_owner_connects_to_a_twins_files(twin):
    _, addresses = twin
    modes = {Path(url.removeprefix("unix:")).stat().st_mode & 0o777 for url in addresses.values()}
    assert modes == {0o600}


@pytest.mark.parametrize("twin", ["files"], indirect=True)
def test_a_twin_is_started_again_at_the_files_of_one_that_was_killed(twin):
    process, addresses = twin
    process.kill()
    process.wait()
    with pytest.raises(TwinError, match="start one with"):
        TwinClient(addresses["control"])
    folder = Path(addresses["control"].removeprefix("unix:")).parent
    with subprocess.Popen([*COMMAND, "twin", "--sockets", folder, "--json"], stdout=subprocess.PIPE) as again:
        try:
            assert json.loads(again.stdout.readline()) == addresses
            client = TwinClient(addresses["control"])
            assert client.describe().name == "heavy-bar"
            client.close()
        finally:
            again.kill()


@pytest.mark.parametrize("twin", ["ports"], indirect=True)
def test_a_port_in_use_is_named(twin):
    _, addresses = twin
    port = addresses["left"].rpartition(":")[2]
    result = run("twin", "--left", port, "--right", "0", "--control", "0")
    assert result.returncode == 1
    assert port in result.stderr
