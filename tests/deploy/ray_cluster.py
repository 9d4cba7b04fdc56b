"""A Ray cluster of several `ray start` processes on loopback, started by deploy/ray/node.sh, with a token."""

import os
import secrets
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

ROOT = Path(__file__).parents[2]
BIN = Path(sys.executable).parent
NODE = ROOT / "deploy/ray/node.sh"


def free_port() -> int:
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return int(listener.getsockname()[1])


class RayCluster:
    """A head and nodes of one core each; `environment` is what a client needs."""

    def __init__(self, folder: Path, redis_url: str) -> None:
        dashboard = f"127.0.0.1:{free_port()}"
        self.folder = folder
        self.jobs = f"http://{dashboard}"
        """Where it takes jobs."""
        # What a job needs comes with it, and no settings of a local Ray that this process has run.
        own = {
            name: value
            for name, value in os.environ.items()
            if name != "PYTHONPATH" and not name.startswith("RAY_")
        }
        self.environment = {
            **own,
            "PATH": f"{BIN}:{os.environ['PATH']}",
            "RAY_AUTH_MODE": "token",
            "RAY_AUTH_TOKEN": secrets.token_hex(32),
            "RAY_HEAD": f"127.0.0.1:{free_port()}",
            "RAY_NODE_ADDRESS": "127.0.0.1",
            "RAY_DASHBOARD": dashboard,
            "RAY_ADDRESS": self.jobs,
            "RAY_TMPDIR": str(folder),
        }
        self._nodes = {**self.environment, "TASKSCHEMA_REDIS_URL": redis_url}
        del self._nodes["RAY_ADDRESS"]

    @contextmanager
    def node(self, role: str) -> Iterator[subprocess.Popen[str]]:
        """Run a node until it is left; it takes part when this returns."""
        words = [str(NODE), role, f"--dashboard-agent-listen-port={free_port()}"]
        if role == "head":
            words += [f"--temp-dir={self.folder}"]
        with (self.folder / f"{role}-{free_port()}.log").open("w+") as log:
            process = subprocess.Popen(
                words, env=self._nodes, stdout=log, stderr=log, text=True, start_new_session=True
            )
            try:
                while "Ray runtime started" not in Path(log.name).read_text():
                    assert process.poll() is None, Path(log.name).read_text()
                    try:
                        process.wait(0.1)
                    except subprocess.TimeoutExpired:
                        continue
                yield process
            finally:
                process.send_signal(signal.SIGTERM)
                process.wait(timeout=60)

    @contextmanager
    def running(self, workers: int) -> Iterator["RayCluster"]:
        """Run a head and so many nodes."""
        with ExitStack() as stack:
            for role in ("head", *["worker"] * workers):
                stack.enter_context(self.node(role))
            yield self

    def ray(self, *words: str, timeout: float = 240) -> subprocess.CompletedProcess[str]:
        """Run the `ray` command as a client, from the repository's root."""
        return subprocess.run(
            [str(BIN / "ray"), *words],
            env=self.environment,
            cwd=ROOT,
            capture_output=True,
            text=True,
            timeout=timeout,
        )
