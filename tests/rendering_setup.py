"""What tests that draw pictures need: something that draws."""

import pytest

from taskschema.errors import RenderingError
from taskschema_worker.rendering.backend import working_backend


def renders() -> bool:
    try:
        working_backend()
    except RenderingError:
        return False
    return True


needs_renderer = pytest.mark.skipif(not renders(), reason="no EGL and no OSMesa here: see taskschema doctor")
