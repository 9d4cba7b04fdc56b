"""PyRobot's Sawyer, the paper's driver: a thin adapter. Not run on hardware."""
