"""Motions of one arm: what a skill plans from, and the timed path that simulator and robot execute."""

from taskschema.motion.context import PlanningContext
from taskschema.motion.path import ArmPath

__all__ = ["ArmPath", "PlanningContext"]
