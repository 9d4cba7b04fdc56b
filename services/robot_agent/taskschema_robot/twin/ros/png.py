"""rosbridge's png compression: a frame's text as the pixels of an image."""

import base64
import math

import cv2
import msgspec
import numpy as np

CHANNELS = 3
"""Red, green, blue."""


def png_frame(frame: str) -> str:
    """Return the frame that carries another one as a PNG: about as high as wide, filled up with newlines."""
    data = frame.encode()
    pixels = len(data) / CHANNELS
    width = max(math.floor(math.sqrt(pixels)), 1)
    height = math.ceil(pixels / width)
    padded = data + b"\n" * (width * height * CHANNELS - len(data))
    image = np.frombuffer(padded, dtype=np.uint8).reshape(height, width, CHANNELS)
    encoded = cv2.imencode(".png", np.ascontiguousarray(image[:, :, ::-1]))[1]
    return msgspec.json.encode({"op": "png", "data": base64.b64encode(encoded.tobytes()).decode()}).decode()
