"""Off-screen rendering for the twin's camera."""

import os

# Before anything imports mujoco's renderer, which reads it once.
os.environ.setdefault("MUJOCO_GL", "egl")
