"""The fastest run along a path of the joints that keeps velocity and acceleration limits.

The path is a cubic spline through waypoints, within the joints' position limits if these are. Its time law is
found on a grid by one pass forwards and one backwards over the squared path speed, as in time-optimal path
parameterisation (Bobrow et al. 1985), with the acceleration that curvature needs taken off the limit.

Inside, the N rows of a batch come last, where NumPy runs fastest: arrays are [..., 7, N], or [..., N] along
the path.
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
    points = np.ascontiguousarray(np.moveaxis(waypoints, 0, 2))
    steps = np.diff(points, axis=0)
    if lengths is None:
        squares = steps * steps
        total = squares[:, 0]
        for joint in range(1, squares.shape[1]):
            total = total + squares[:, joint]
        along = np.sqrt(total)
    else:
        along = np.ascontiguousarray(lengths.T)
    along = np.maximum(along, SHORTEST_SEGMENT)
    angles, slopes, bends = _spline(points, _tangents(arm, points, along), along, grid)
    spacing = np.repeat(along / grid, grid, axis=0)
    squared = _squared_speeds(arm, slopes, bends, spacing, limits)
    speed = np.sqrt(squared)
    times = np.zeros_like(squared)
    np.cumsum(2.0 * spacing / (speed[:-1] + speed[1:]), axis=0, out=times[1:])
    # Rows whose waypoints coincide do not move and take no time.
    still = np.abs(steps).max(axis=(0, 1)) < SHORTEST_SEGMENT
    times[:, still] = 0.0
    joints = np.concatenate([_starts(angles), angles[-1, -1:]])
    velocities = np.concatenate([_starts(slopes), slopes[-1, -1:]]) * speed[:, None]
    velocities[:, :, still] = 0.0
    stretch = _stretch(arm, times, joints, velocities)
    return ArmPath(
        times=np.ascontiguousarray((times * stretch).T),
        joints=np.ascontiguousarray(np.moveaxis(joints, 2, 0)),
        velocities=np.ascontiguousarray(np.moveaxis(velocities / stretch, 2, 0)),
        opening=np.repeat(np.asarray(opening)[:, None], len(squared), axis=1),
    )


def _stretch(arm: ArmKinematics, times: FloatArray, joints: FloatArray, velocities: FloatArray) -> FloatArray:
    """Return by what factor [N], at least 1, a path must take longer for its cubics to keep the limits too.

    A cubic's acceleration is extreme at the ends of its interval; its velocity there or near the middle.
    """
    velocity, acceleration = arm.velocity[:, None], arm.acceleration[:, None]
    span = np.diff(times, axis=0)[:, None]
    moving = span > 0.0
    span = np.where(moving, span, 1.0)
    mean = np.diff(joints, axis=0) / span
    before, after = velocities[:-1], velocities[1:]
    accelerations = np.maximum(
        np.abs(6 * mean - 4 * before - 2 * after), np.abs(2 * before + 4 * after - 6 * mean)
    )
    accelerations = np.where(moving, accelerations / (span * acceleration), 0.0)
    middle = np.where(moving, np.abs(1.5 * mean - 0.25 * (before + after)) / velocity, 0.0)
    fastest = np.maximum(middle.max(axis=(0, 1)), (np.abs(velocities) / velocity).max(axis=(0, 1)))
    return np.asarray(np.maximum(np.maximum(np.sqrt(accelerations.max(axis=(0, 1))), fastest), 1.0))


def _tangents(arm: ArmKinematics, waypoints: FloatArray, lengths: FloatArray) -> FloatArray:
    """Return the spline's derivatives by length at its waypoints [K, 7, N]: of parabolas through three.

    A joint whose spline could swing past its position limits between waypoints gets monotone ones instead.
    """
    h = lengths[:, None]
    secants = np.diff(waypoints, axis=0) / h
    if len(waypoints) == 2:
        return np.repeat(secants, 2, axis=0)
    before, after = h[:-1], h[1:]
    inner = (after * secants[:-1] + before * secants[1:]) / (before + after)
    tangents = _with_ends(secants, inner)
    # A cubic stays within its control points.
    early, late = waypoints[:-1] + tangents[:-1] * h / 3.0, waypoints[1:] - tangents[1:] * h / 3.0
    low, high = np.minimum(early, late).min(axis=0), np.maximum(early, late).max(axis=0)
    past = (low < arm.lower[:, None]) | (high > arm.upper[:, None])
    if past.any():
        monotone = _with_ends(secants, _harmonic_mean(secants[:-1], secants[1:]))
        tangents = np.where(past, monotone, tangents)
    return tangents


def _with_ends(secants: FloatArray, inner: FloatArray) -> FloatArray:
    """Return tangents [K, 7, N] from those between the ends: no curvature at both ends."""
    first = 1.5 * secants[:1] - 0.5 * inner[:1]
    last = 1.5 * secants[-1:] - 0.5 * inner[-1:]
    return np.concatenate([first, inner, last])


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
    """Return angles and two derivatives by length at the segments' grid points [K - 1, grid + 1, 7, N]."""
    u = (np.arange(grid + 1) / grid)[:, None, None]
    p0, p1 = waypoints[:-1, None], waypoints[1:, None]
    m0, m1 = tangents[:-1, None], tangents[1:, None]
    length = lengths[:, None, None]
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
    """Return what stands at the start of each of the I intervals [I, ...], of the points of segments."""
    return points[:, :-1].reshape(-1, *points.shape[2:])


def _ends(points: FloatArray) -> FloatArray:
    """Return what stands at the end of each interval; see `_starts`."""
    return points[:, 1:].reshape(-1, *points.shape[2:])


def _squared_speeds(
    arm: ArmKinematics, slopes: FloatArray, bends: FloatArray, spacing: FloatArray, limits: PathLimits
) -> FloatArray:
    """Return the squared path speed [I + 1, N] at the grid's points."""
    velocity, acceleration = ((LIMIT_FRACTION * limit)[:, None] for limit in (arm.velocity, arm.acceleration))
    slope, bend = np.maximum(np.abs(slopes), 1e-9), np.maximum(np.abs(bends), 1e-9)
    top = np.minimum(
        ((velocity / slope) ** 2).min(axis=2), (CURVATURE_FRACTION * acceleration / bend).min(axis=2)
    )
    squared = np.empty((len(spacing) + 1, spacing.shape[1]))
    squared[1:-1] = np.minimum(_starts(top)[1:], _ends(top)[:-1])
    squared[0] = squared[-1] = 0.0
    np.minimum(squared, limits.speed**2, out=squared)
    # What each interval allows at rest, and how much less at speed [I, 7, N].
    steepest = np.maximum(_starts(slope), _ends(slope))
    room, taken = acceleration / steepest, np.maximum(_starts(bend), _ends(bend)) / steepest
    doubled = 2.0 * spacing
    intervals = range(len(doubled))
    for passage, start, end in ((intervals, 0, 1), (intervals[::-1], 1, 0)):
        for interval in passage:
            now, reach = squared[interval + start], squared[interval + end]
            change = np.minimum.reduce(room[interval] - taken[interval] * now)
            change = np.minimum(np.maximum(change, 0.0), limits.acceleration)
            np.minimum(reach, now + doubled[interval] * change, out=reach)
    return squared
