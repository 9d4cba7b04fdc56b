"""What a picture is, of any size; those that policies see are `taskschema.frames`."""

import numpy as np
from numpy.typing import NDArray

Frame = NDArray[np.uint8]
"""[H, W, 3] red, green, blue; the first row is the top."""
