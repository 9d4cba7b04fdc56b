"""Processes that may end while somebody looks at them."""

import contextlib

import psutil


def command_line(process: psutil.Process) -> str:
    """Return a process's command; nothing of one that has ended, whether or not it was waited for."""
    with contextlib.suppress(psutil.NoSuchProcess):  # a zombie is one, too
        return " ".join(process.cmdline())
    return ""
