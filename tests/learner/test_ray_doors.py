"""Ray asks for a token, here and beyond: without one whoever reaches it runs code on it."""

import os
import subprocess
import sys

import pytest

from taskschema.errors import RayError
from taskschema_learner.workers.ray_runtime import AUTH_MODE, AUTH_TOKEN, RayRuntime

# What every client of Ray does first; ray.init() would try again and again for a minute.
CLIENT = (
    "import sys\n"
    "from ray._raylet import GcsClient\n"
    "print('inside', len(GcsClient(address=sys.argv[1]).get_all_node_info(timeout=10)))\n"
)


def client(address: str, **environment: str) -> str:
    """Ask a cluster for its nodes from another process, and return what that prints."""
    kept = {name: value for name, value in os.environ.items() if name not in (AUTH_MODE, AUTH_TOKEN)}
    done = subprocess.run(
        [sys.executable, "-c", CLIENT, address],
        env={**kept, **environment},
        capture_output=True,
        text=True,
        timeout=120,
    )
    return done.stdout + done.stderr


def test_a_local_ray_asks_for_its_token() -> None:
    runtime = RayRuntime()
    runtime.start()
    try:
        import ray

        address = ray.get_runtime_context().gcs_address
        assert os.environ[AUTH_MODE] == "token"
        token = os.environ[AUTH_TOKEN]
        assert len(token) >= 32
        assert "inside 1" in client(address, **{AUTH_MODE: "token", AUTH_TOKEN: token})
        for wrong in ({AUTH_MODE: "token", AUTH_TOKEN: "0" * 64}, {AUTH_MODE: "disabled"}):
            answer = client(address, **wrong)
            assert "inside" not in answer
            assert "uthenticat" in answer
    finally:
        runtime.stop()


@pytest.mark.parametrize("address", ["192.0.2.1:6379", "ray://192.0.2.1:10001", "head.example:6379"])
def test_a_cluster_beyond_this_machine_without_a_token_is_refused(address, monkeypatch) -> None:
    monkeypatch.setenv(AUTH_MODE, "disabled")
    with pytest.raises(RayError, match=f"asks for no token.*{AUTH_MODE}=token") as caught:
        RayRuntime(address).start()
    assert "\n" not in str(caught.value)


def test_what_ray_prints_while_it_shuts_down_stays_off_standard_error(monkeypatch, capfd) -> None:
    import ray

    monkeypatch.setattr(ray, "shutdown", lambda: os.write(2, b"task_manager.cc:1545: Failed to push error\n"))
    RayRuntime().stop()
    print("a line after it", file=sys.stderr)
    assert capfd.readouterr().err == "a line after it\n"


def test_a_ray_that_takes_too_long_to_start_is_one_line(monkeypatch) -> None:
    import ray

    def too_slow(**settings: object) -> None:
        raise Exception("The current node timed out during startup.")  # as Ray does

    monkeypatch.setattr(ray, "init", too_slow)
    with pytest.raises(RayError, match="timed out during startup") as caught:
        RayRuntime().start()
    assert "\n" not in str(caught.value)
