"""What a picture is, and the size of the one that a policy sees."""

import numpy as np
from numpy.typing import NDArray

Frame = NDArray[np.uint8]
"""[H, W, 3] red, green, blue; the first row is the top."""
FRAME_SIZE = 256
"""Height and width of the overhead camera's frame [pixel] (paper, section IV-C)."""
