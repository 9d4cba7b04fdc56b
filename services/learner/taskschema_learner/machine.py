"""Which machine a figure was measured on."""

import os
import platform
from pathlib import Path


def machine() -> str:
    """Return cores and kind of this machine."""
    kind = platform.processor() or platform.machine()
    for line in Path("/proc/cpuinfo").read_text().splitlines():
        if line.startswith("model name"):
            kind = line.split(":", 1)[1].strip()
            break
    return f"{os.cpu_count()} cores, {kind}, Python {platform.python_version()}"
