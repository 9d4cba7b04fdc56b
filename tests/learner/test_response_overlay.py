"""Response maps over the overhead picture: each cell where it lies on the table."""

import numpy as np
import pytest

from taskschema.tasks.lateral_lifting import LateralLifting
from taskschema_learner.replay.response_overlay import COLOURS, STRONGEST, tinted

BAR = LateralLifting()


@pytest.mark.parametrize("width", [400, 640])
def test_a_cell_is_tinted_where_it_lies_and_nothing_else(width):
    maps = np.zeros((2, 8, 8))
    maps[0, 0, 0] = maps[1, 7, 5] = 1.0
    picture = np.full((400, width, 3), 100, dtype=np.uint8)  # 400 rows show 0.8 m: 2 mm a pixel
    found = tinted(picture, maps, BAR)
    # the map covers +-0.18 m, +-90 pixels; a cell has 22.5 pixels
    middle = width // 2
    left, right = (STRONGEST * COLOURS + (1 - STRONGEST) * 100).round().astype(np.uint8)
    assert (found[110:132, middle - 90 : middle - 68] == left).all()
    assert (found[268:290, middle + 23 : middle + 45] == right).all()
    changed = (found != 100).any(axis=2)
    assert changed.sum() == pytest.approx(2 * 22.5**2, rel=0.05)
