"""Which OpenGL draws off screen: EGL on a GPU or in software, OSMesa where there is no EGL."""

import importlib
import os
import subprocess
import sys
from collections.abc import Mapping
from functools import cache
from typing import Protocol

from taskschema.errors import RenderingError

BACKENDS = ("egl", "osmesa")
"""In the order of preference."""
PROBE_SECONDS = 60
ADVICE = (
    "Install a driver with EGL, or Mesa's software renderer: "
    "`apt-get install libegl1 libgl1-mesa-dri libosmesa6`"
)
_PROBE = """
import importlib, sys
from OpenGL import GL
context = importlib.import_module(f"mujoco.{sys.argv[1]}").GLContext(32, 32)
context.make_current()
print(GL.glGetString(GL.GL_RENDERER).decode())
context.free()
"""


class OffscreenContext(Protocol):
    """An OpenGL context that draws into memory."""

    def make_current(self) -> None:
        """Let this thread draw with it."""

    def free(self) -> None:
        """Give back what it holds."""


def probe(backend: str) -> tuple[str | None, str]:
    """Try a backend in a process of its own, since a broken driver may end the process that tries it.

    Returns:
        What draws with it, such as `llvmpipe (LLVM 15.0.6, 256 bits)`, or None; and what went wrong.

    """
    try:
        result = subprocess.run(
            [sys.executable, "-c", _PROBE, backend],
            capture_output=True,
            text=True,
            timeout=PROBE_SECONDS,
            env=environment_for(backend),
        )
    except subprocess.TimeoutExpired:
        return None, f"no answer within {PROBE_SECONDS} s"
    found = result.stdout.strip()
    if found:
        return found.splitlines()[-1], ""
    lines = [line for line in result.stderr.strip().splitlines() if ": " in line]
    return None, lines[-1][:200] if lines else f"ended with status {result.returncode}"


def environment_for(backend: str) -> dict[str, str]:
    """Return the environment of another process that is to draw with a backend, whatever this one uses."""
    return {**os.environ, "MUJOCO_GL": backend, "PYOPENGL_PLATFORM": backend}


def requested(environment: Mapping[str, str] = os.environ) -> tuple[str, ...]:
    """Return the backends that may be used: the one that MUJOCO_GL names, else all.

    Raises:
        RenderingError: if MUJOCO_GL names another one.

    """
    name = environment.get("MUJOCO_GL", "").lower()
    if not name:
        return BACKENDS
    if name not in BACKENDS:
        raise RenderingError(
            f"MUJOCO_GL={name} cannot draw off screen: set it to egl or osmesa, or unset it."
        )
    return (name,)


@cache
def working_backend() -> str:
    """Return the first backend that works here.

    Raises:
        RenderingError: if none does.

    """
    failures = []
    for name in requested():
        found, failure = probe(name)
        if found is not None:
            return name
        failures.append(f"{name}: {failure}")
    raise RenderingError(f"No renderer works here ({'; '.join(failures)}). {ADVICE}.")


def new_context(width: int, height: int) -> OffscreenContext:
    """Return a context, not current yet, for pictures of this size.

    Raises:
        RenderingError: if no backend works.

    """
    context: OffscreenContext = importlib.import_module(f"mujoco.{working_backend()}").GLContext(
        width, height
    )
    return context
