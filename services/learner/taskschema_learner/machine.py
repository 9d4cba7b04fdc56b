"""Which machine a figure was measured on, and on which day."""

import os
import platform
from datetime import UTC, datetime
from pathlib import Path


def machine() -> str:
    """Return cores and kind of this machine."""
    kind = platform.processor() or platform.machine()
    for line in Path("/proc/cpuinfo").read_text().splitlines():
        if line.startswith("model name"):
            kind = line.split(":", 1)[1].strip()
            break
    return f"{os.cpu_count()} cores, {kind}, Python {platform.python_version()}"


def today() -> str:
    """Return the day in UTC, such as 2026-01-31."""
    return datetime.now(UTC).date().isoformat()
