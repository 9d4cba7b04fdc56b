"""What the safety gate allows: one frozen set of numbers, each with its reason."""

from dataclasses import dataclass, fields

import numpy as np

from taskschema.errors import ConfigError


@dataclass(frozen=True)
class Box:
    """An axis-aligned box in the world frame: origin on the table's top, z up."""

    lower: tuple[float, float, float]
    """[m]"""
    upper: tuple[float, float, float]
    """[m]"""

    def __post_init__(self) -> None:
        if not all(low < high for low, high in zip(self.lower, self.upper, strict=True)):
            raise ConfigError(f"Workspace box: lower {self.lower} must be below upper {self.upper}.")


@dataclass(frozen=True)
class SafetyLimits:
    """Limits of the checks before a motion and of the watchdogs during one."""

    period: float = 0.01
    """Time between set-points [s]: 100 Hz, the most that the drivers stream."""
    longest_motion: float = 60.0
    """No motion takes longer [s], whatever the speed ratio: the paper's skills take 11 to 14 s."""
    speed_ratio: float = 1.0
    """Share of the joint velocity limits that a motion may use; its square of the acceleration limits."""
    joint_margin: float = 0.01
    """Distance kept to every joint limit [rad]: more than the arm overshoots a set-point."""
    start_tolerance: float = 0.03
    """Largest distance of a motion's first set-point from the measured angle of any joint [rad]."""
    inverse_residual: float = 0.03
    """Largest distance, level and in height, between where a hand is meant to end and where it would [m]."""
    workspace: Box = Box((-0.9, -0.95, -0.05), (0.9, 0.95, 1.3))
    """Every link stays inside; the bases stand at y = -0.56 and 0.56 m. The table is checked by itself."""
    arm_clearance: float = 0.015
    """Between the two arms [m]; both hands work on one small object, so it cannot be large."""
    self_clearance: float = 0.01
    """Between links of one arm that are not neighbours [m]."""
    table_clearance: float = 0.01
    """Between the table and every link but the fingers [m]."""
    finger_clearance: float = 0.003
    """Between the table and the fingers [m]: skills keep the finger tips 6 mm above it."""
    held_inflation: float = 0.01
    """By how much a held object's box is inflated on every side [m]: it may slip in the fingers."""
    held_sag: float = 0.02
    """How far below its lowest point at the start, or the table, a held object may be moved [m]."""
    sweep_resolution: float = 0.004
    """No point of a link moves further between two tested configurations [m]."""
    state_age: float = 0.1
    """Oldest joint state during a motion [s]; the arms publish at 100 Hz."""
    tracking_error: float = 0.1
    """Largest distance of a measured joint from the set-points of the last `tracking_delay` seconds [rad]."""
    tracking_delay: float = 0.3
    """By how much a position servo may lag behind its set-points [s]."""
    late: float = 0.1
    """Longest stall of the stream of set-points [s]; the arms time out after 0.2 s without one."""
    force: float = 80.0
    """Largest force at a hand [N]: three times what carrying half of the heaviest object takes."""
    torque: float = 15.0
    """Largest torque at a hand [Nm]."""
    camera_age: float = 1.0
    """Oldest camera frame during a motion [s]."""
    link_age: float = 10.0
    """Longest silence of the Redis that carries the episodes [s]."""
    arrival_tolerance: float = 0.04
    """Largest distance of any joint from the end of a motion when it counts as arrived [rad]."""
    arrival_seconds: float = 2.0
    """How long the arms may take to arrive after the last set-point [s]."""
    recovery_speed_ratio: float = 0.1
    """Speed ratio of the return to neutral after a fault."""

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not isinstance(value, Box) and not (np.isfinite(value) and value > 0.0):
                raise ConfigError(f"Safety limit {field.name!r} must be finite and above 0, got {value!r}.")
        if self.speed_ratio > 1.0 or self.recovery_speed_ratio > 1.0:
            raise ConfigError(
                "Speed ratios must be at most 1: the joint velocity limits are the robot's own."
            )
