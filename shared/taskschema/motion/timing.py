"""The fastest run along a path of the joints that keeps velocity and acceleration limits.

The path is a cubic spline through waypoints, within the joints' position limits if these are. Its time law is
found on a grid by one pass forwards and one backwards over the squared path speed, as in time-optimal path
parameterisation (Bobrow et al. 1985), with the acceleration that curvature needs taken off the limit.
"""

from dataclasses import dataclass

import numpy as np

from taskschema.arrays import FloatArray
from taskschema.kinematics.arm import ArmKinematics
from taskschema.motion.path import ArmPath

LIMIT_FRACTION = 0.92
"""Share of the velocity and acceleration limits that plans use on the grid; between its points it is more."""
CURVATURE_FRACTION = 0.75
"""Largest share of an acceleration limit that the path's curvature may take."""
SHORTEST_SEGMENT = 1e-6
"""Length below which two waypoints are one."""


@dataclass(frozen=True)
class PathLimits:
    """Limits along the path itself, in the unit that `lengths` are given in."""

    speed: float = np.inf
    acceleration: float = np.inf


def fastest_path(
    arm: ArmKinematics,
    waypoints: FloatArray,
    opening: FloatArray,
    *,
    lengths: FloatArray | None = None,
    limits: PathLimits = PathLimits(),  # noqa: B008 - frozen
    grid: int = 12,
) -> ArmPath:
    """Return the fastest path through waypoints, at rest at both ends.

    Args:
        arm: whose joint velocity and acceleration limits hold.
        waypoints: [N, K, 7] joint angles [rad].
        opening: [N] gripper set-point throughout [m].
        lengths: [N, K - 1] length of each segment, such as metres travelled; joint-space distance if None.
        limits: of speed and acceleration along that length.
        grid: intervals per segment.
    """
    steps = np.diff(waypoints, axis=1)
    if lengths is None:
        squares = steps * steps
        total = squares[..., 0]
        for joint in range(1, squares.shape[-1]):
            total = total + squares[..., joint]
        lengths = np.sqrt(total)
    lengths = np.maximum(lengths, SHORTEST_SEGMENT)
    angles, slopes, bends = _spline(waypoints, _tangents(arm, waypoints, lengths), lengths, grid)
    spacing = np.repeat(lengths / grid, grid, axis=1)
    squared = _squared_speeds(arm, slopes, bends, spacing, limits)
    speed = np.sqrt(squared)
    times = np.zeros_like(squared)
    np.cumsum(2.0 * spacing / (speed[:, :-1] + speed[:, 1:]), axis=1, out=times[:, 1:])
    # Rows whose waypoints coincide do not move and take no time.
    still = np.abs(steps).max(axis=(1, 2)) < SHORTEST_SEGMENT
    times[still] = 0.0
    joints = np.concatenate([_starts(angles), angles[:, -1, -1:]], axis=1)
    velocities = np.concatenate([_starts(slopes), slopes[:, -1, -1:]], axis=1) * speed[:, :, None]
    velocities[still] = 0.0
    stretch = _stretch(arm, times, joints, velocities)
    return ArmPath(
        times=times * stretch[:, None],
        joints=joints,
        velocities=velocities / stretch[:, None, None],
        opening=np.repeat(np.asarray(opening)[:, None], squared.shape[1], axis=1),
    )


def _stretch(arm: ArmKinematics, times: FloatArray, joints: FloatArray, velocities: FloatArray) -> FloatArray:
    """Return by what factor [N], at least 1, a path must take longer for its cubics to keep the limits too.

    A cubic's acceleration is extreme at the ends of its interval; its velocity there or near the middle.
    """
    span = np.diff(times, axis=1)[:, :, None]
    moving = span > 0.0
    span = np.where(moving, span, 1.0)
    mean = np.diff(joints, axis=1) / span
    before, after = velocities[:, :-1], velocities[:, 1:]
    accelerations = np.maximum(
        np.abs(6 * mean - 4 * before - 2 * after), np.abs(2 * before + 4 * after - 6 * mean)
    )
    accelerations = np.where(moving, accelerations / (span * arm.acceleration), 0.0)
    middle = np.where(moving, np.abs(1.5 * mean - 0.25 * (before + after)) / arm.velocity, 0.0)
    fastest = np.maximum(middle.max(axis=(1, 2)), (np.abs(velocities) / arm.velocity).max(axis=(1, 2)))
    return np.asarray(np.maximum(np.maximum(np.sqrt(accelerations.max(axis=(1, 2))), fastest), 1.0))


def _tangents(arm: ArmKinematics, waypoints: FloatArray, lengths: FloatArray) -> FloatArray:
    """Return the spline's derivatives by length at its waypoints [N, K, 7]: of parabolas through three.

    A joint whose spline could swing past its position limits between waypoints gets monotone ones instead.
    """
    h = lengths[:, :, None]
    secants = np.diff(waypoints, axis=1) / h
    if waypoints.shape[1] == 2:
        return np.repeat(secants, 2, axis=1)
    before, after = h[:, :-1], h[:, 1:]
    inner = (after * secants[:, :-1] + before * secants[:, 1:]) / (before + after)
    tangents = _with_ends(secants, inner)
    # A cubic stays within its control points.
    early, late = waypoints[:, :-1] + tangents[:, :-1] * h / 3.0, waypoints[:, 1:] - tangents[:, 1:] * h / 3.0
    low, high = np.minimum(early, late).min(axis=1), np.maximum(early, late).max(axis=1)
    past = (low < arm.lower) | (high > arm.upper)
    if past.any():
        monotone = _with_ends(secants, _harmonic_mean(secants[:, :-1], secants[:, 1:]))
        tangents = np.where(past[:, None], monotone, tangents)
    return tangents


def _with_ends(secants: FloatArray, inner: FloatArray) -> FloatArray:
    """Return tangents [N, K, 7] from those between the ends: no curvature at both ends."""
    first = 1.5 * secants[:, :1] - 0.5 * inner[:, :1]
    last = 1.5 * secants[:, -1:] - 0.5 * inner[:, -1:]
    return np.concatenate([first, inner, last], axis=1)


def _harmonic_mean(left: FloatArray, right: FloatArray) -> FloatArray:
    """Return the harmonic mean of slopes [...], 0 where they differ in sign (Fritsch and Butland 1984).

    With it as a tangent, a cubic spline stays within the range of the waypoints on both sides.
    """
    product = left * right
    same = product > 0.0
    return np.where(same, 2.0 * product / np.where(same, left + right, 1.0), 0.0)


def _spline(
    waypoints: FloatArray, tangents: FloatArray, lengths: FloatArray, grid: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return angles and two derivatives by length at the segments' grid points [N, K - 1, grid + 1, 7]."""
    u = (np.arange(grid + 1) / grid)[:, None]
    p0, p1 = waypoints[:, :-1, None], waypoints[:, 1:, None]
    m0, m1 = tangents[:, :-1, None], tangents[:, 1:, None]
    length = lengths[:, :, None, None]
    difference = p1 - p0
    square, cube = u * u, u * u * u
    angles = (
        p0
        + (3 * square - 2 * cube) * difference
        + ((cube - 2 * square + u) * m0 + (cube - square) * m1) * length
    )
    slopes = (
        6 * (u - square) * difference / length + (3 * square - 4 * u + 1) * m0 + (3 * square - 2 * u) * m1
    )
    bends = (6 * (1 - 2 * u) * difference / length + (6 * u - 4) * m0 + (6 * u - 2) * m1) / length
    return angles, slopes, bends


def _starts(points: FloatArray) -> FloatArray:
    """Return what stands at the start of each of the I intervals [N, I, ...], of the points of segments."""
    return points[:, :, :-1].reshape(len(points), -1, *points.shape[3:])


def _ends(points: FloatArray) -> FloatArray:
    """Return what stands at the end of each interval; see `_starts`."""
    return points[:, :, 1:].reshape(len(points), -1, *points.shape[3:])


def _squared_speeds(
    arm: ArmKinematics, slopes: FloatArray, bends: FloatArray, spacing: FloatArray, limits: PathLimits
) -> FloatArray:
    """Return the squared path speed [N, I + 1] at the grid's points."""
    velocity, acceleration = LIMIT_FRACTION * arm.velocity, LIMIT_FRACTION * arm.acceleration
    slope, bend = np.maximum(np.abs(slopes), 1e-9), np.maximum(np.abs(bends), 1e-9)
    top = np.minimum(
        ((velocity / slope) ** 2).min(axis=3), (CURVATURE_FRACTION * acceleration / bend).min(axis=3)
    )
    ceiling = np.empty((len(spacing), spacing.shape[1] + 1))
    ceiling[:, 1:-1] = np.minimum(_starts(top)[:, 1:], _ends(top)[:, :-1])
    ceiling[:, 0] = ceiling[:, -1] = 0.0
    ceiling = np.minimum(ceiling, limits.speed**2)
    # What each interval allows at rest, and how much less at speed: [I, 7, N], an interval's values together.
    steepest = np.maximum(_starts(slope), _ends(slope))
    room = np.ascontiguousarray((acceleration / steepest).transpose(1, 2, 0))
    taken = np.ascontiguousarray((np.maximum(_starts(bend), _ends(bend)) / steepest).transpose(1, 2, 0))
    squared, doubled = np.ascontiguousarray(ceiling.T), 2.0 * np.ascontiguousarray(spacing.T)
    intervals = range(len(doubled))
    for passage, start, end in ((intervals, 0, 1), (intervals[::-1], 1, 0)):
        for interval in passage:
            now, reach = squared[interval + start], squared[interval + end]
            change = (room[interval] - taken[interval] * now).min(axis=0)
            change = np.minimum(np.maximum(change, 0.0), limits.acceleration)
            np.minimum(reach, now + doubled[interval] * change, out=reach)
    return squared.T
