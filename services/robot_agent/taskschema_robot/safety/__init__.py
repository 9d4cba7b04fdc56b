"""The safety gate: the one part that holds the drivers, and what it checks before and during a motion."""
