"""The sweep: both arms and what they hold, moved together through a motion, in steps of a few millimetres."""

from dataclasses import dataclass

import numpy as np

from taskschema.arrays import BoolArray, FloatArray, IntArray
from taskschema.safety.arm_model import FINGERS, HAND, LINKS, NEIGHBOURS, ArmModel
from taskschema.safety.limits import SafetyLimits
from taskschema.safety.motion import Motion
from taskschema.safety.refusal import Refusal, RefusalKind


@dataclass(frozen=True)
class Leeway:
    """How much nearer shapes may come on their way apart which are too near at the start already."""

    share: float
    """Least share of their distance at the start that they keep."""
    tolerance: float
    """How much nearer than that they may come, and how much deeper if they touch [m]."""


PARTING = Leeway(share=1.0, tolerance=0.0005)
"""Not nearer, but for rounding: arms that ended a motion a little nearer than they may."""
RECOVERY = Leeway(share=0.7, tolerance=0.002)
"""After a fault, which a person has acknowledged: arms that lean on each other have to get loose."""


@dataclass(frozen=True)
class Pair:
    """Two shapes, how near they may come, and what it is called if they come nearer."""

    first: int
    second: int
    clearance: float
    kind: RefusalKind


@dataclass(frozen=True, eq=False)
class PairTable:
    """The pairs that are tested, also as arrays."""

    pairs: list[Pair]
    """[P]"""
    first: IntArray
    """[P]"""
    second: IntArray
    """[P]"""
    need: FloatArray
    """[P] clearances, and what two shapes can come nearer between two tested configurations [m]."""
    on_table: BoolArray
    """[P] whether the second shape is the table."""


class Sweep:
    """Tests motions against a collision model; what it says about one does not depend on others."""

    def __init__(self, limits: SafetyLimits) -> None:
        self._limits = limits
        self._model = ArmModel()
        self._tables: dict[tuple[bool, ...], PairTable] = {}

    def refuses(self, motion: Motion, measured: FloatArray) -> bool:
        """Return whether `check` has a reason to refuse a motion, without saying which: that is sooner known.

        Most plans that are refused fail at their end, too, which is one configuration of hundreds.
        """
        self._hold(motion)
        end, now = motion.joints[:, -1:], np.zeros(1)
        centres, frames = self._model.poses(end)
        extents = self._model.extents(frames)
        refusal = (
            self._outside(end, now, centres, extents, None)
            or self._too_near(motion, end, now, centres, None)
            or self.check(motion, measured)
        )
        return refusal is not None

    def check(self, motion: Motion, measured: FloatArray, *, leeway: Leeway | None = None) -> Refusal | None:
        """Return why a motion from `measured` [2, 7] must not be made, or None.

        Between two tested configurations no point of a link moves further than `sweep_resolution`; half of
        that is added to every clearance for each of the two shapes that moves, so nothing slips between.

        Args:
            motion: of the right form, within the joint limits.
            measured: where the arms are.
            leeway: for shapes that are too near each other already; None: they may not even part.
        """
        self._hold(motion)
        joints, times = self._dense(motion, measured)
        centres, frames = self._model.poses(joints)
        extents = self._model.extents(frames)
        return (
            self._outside(joints, times, centres, extents, leeway)
            or self._sagging(motion, joints, times, centres, extents)
            or self._too_near(motion, joints, times, centres, leeway)
        )

    def _hold(self, motion: Motion) -> None:
        for arm, held in enumerate(motion.held):
            self._model.hold(arm, held, self._limits.held_inflation)

    def _dense(self, motion: Motion, measured: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return configurations [2, D, 7] and times [D] from where the arms are to the end, both included."""
        joints = np.concatenate([measured[:, None], motion.joints], axis=1)
        travel = self._model.travel(*self._model.poses(joints))
        parts = np.maximum(np.ceil(travel / self._limits.sweep_resolution).astype(np.int64), 1)
        knots = np.concatenate([[0], np.cumsum(parts)])
        fine = np.arange(knots[-1] + 1)
        place = np.interp(fine, knots, np.arange(joints.shape[1]))
        index = np.minimum(place.astype(np.int64), joints.shape[1] - 2)
        share = (place - index)[None, :, None]
        dense = joints[:, index] * (1.0 - share) + joints[:, index + 1] * share
        return dense, np.maximum(place - 1.0, 0.0) * motion.period

    def _outside(
        self,
        joints: FloatArray,
        times: FloatArray,
        centres: FloatArray,
        extents: FloatArray,
        leeway: Leeway | None,
    ) -> Refusal | None:
        """Check every link against the workspace."""
        box = self._limits.workspace
        links = [i for i, shape in enumerate(self._model.shapes) if shape.link in LINKS[1:]]
        low = np.array(box.lower) - (centres - extents)[:, links]
        high = (centres + extents)[:, links] - np.array(box.upper)
        excess = np.maximum(low, high).max(axis=2)
        allowed = 0.0 if leeway is None else np.maximum(excess[0], 0.0)
        step, link = _first(excess > allowed)
        if step is None:
            return None
        name = self._model.shapes[links[link]].name
        reason = f"{name} would leave the workspace by {100 * excess[step, link]:.1f} cm"
        return Refusal(RefusalKind.WORKSPACE, reason, float(times[step]), joints[:, step].copy(), (name,))

    def _sagging(
        self, motion: Motion, joints: FloatArray, times: FloatArray, centres: FloatArray, extents: FloatArray
    ) -> Refusal | None:
        """Check that what is held is not pressed into the table it may stand on."""
        for arm, held in enumerate(motion.held):
            if held is None:
                continue
            geom = self._model.index(arm, "held")
            lowest = (centres - extents)[:, geom, 2]
            floor = min(lowest[0], 0.0) - self._limits.held_sag
            if (lowest < floor).any():
                step = int(np.flatnonzero(lowest < floor)[0])
                name = self._model.shapes[geom].name
                reason = f"{name} would be pressed {100 * (floor - lowest[step]):.1f} cm too deep"
                at = joints[:, step].copy()
                return Refusal(RefusalKind.HELD_OBJECT, reason, float(times[step]), at, (name, "table"))
        return None

    def _too_near(
        self,
        motion: Motion,
        joints: FloatArray,
        times: FloatArray,
        centres: FloatArray,
        leeway: Leeway | None,
    ) -> Refusal | None:
        """Check every pair of shapes whose bounding spheres come near, in the order of time."""
        table = self._table(motion)
        pairs, need = table.pairs, table.need
        near = self._near(table, centres)
        if leeway is not None:
            start = self._distances(joints[:, 0], pairs, need)
            kept = np.where(start > 0.0, leeway.share * start, start) - leeway.tolerance
            need = np.minimum(need, kept)
        for step in np.flatnonzero(near.any(axis=1)):
            self._model.place(joints[:, step])
            for index in np.flatnonzero(near[step]):
                pair = pairs[index]
                distance = self._model.distance(pair.first, pair.second, need[index] + 0.01)
                if distance < need[index]:
                    return self._refusal(pair, distance, float(times[step]), joints[:, step].copy())
        return None

    def _near(self, table: PairTable, centres: FloatArray) -> BoolArray:
        """Return which pairs' bounding spheres come too near [S, P]."""
        radii = self._model.radii
        offset = centres[:, table.first] - centres[:, table.second]
        gap = np.sqrt((offset * offset).sum(axis=2)) - radii[table.first] - radii[table.second]
        lowest = centres[:, table.first, 2] - radii[table.first]
        return np.asarray(np.where(table.on_table, lowest, gap) < table.need)

    def _distances(self, joints: FloatArray, pairs: list[Pair], need: FloatArray) -> FloatArray:
        self._model.place(joints)
        return np.array(
            [
                self._model.distance(pair.first, pair.second, most + 0.01)
                for pair, most in zip(pairs, need, strict=True)
            ]
        )

    def _table(self, motion: Motion) -> PairTable:
        """Return the pairs that are tested with what the hands hold."""
        held = tuple(thing is not None for thing in motion.held)
        if held not in self._tables:
            pairs = self._pairs(motion)
            first = np.array([pair.first for pair in pairs])
            second = np.array([pair.second for pair in pairs])
            on_table = second == self._model.index(None, "table")
            between = 0.5 * self._limits.sweep_resolution * (2.0 - on_table)
            need = np.array([pair.clearance for pair in pairs]) + between
            self._tables[held] = PairTable(pairs, first, second, need, on_table)
        return self._tables[held]

    def _refusal(self, pair: Pair, distance: float, time: float, joints: FloatArray) -> Refusal:
        names = tuple(self._model.shapes[index].name for index in (pair.first, pair.second))
        reason = (
            f"{names[0]} would come within {100 * max(distance, 0.0):.1f} cm of {names[1]}, "
            f"{100 * pair.clearance:.1f} cm is the least"
        )
        return Refusal(pair.kind, reason, time, joints, names)

    def _pairs(self, motion: Motion) -> list[Pair]:
        limits, index = self._limits, self._model.index
        table = index(None, "table")
        pairs = []
        for left in LINKS:
            pairs += [
                Pair(index(0, left), index(1, right), limits.arm_clearance, RefusalKind.ARMS_COLLIDE)
                for right in LINKS
            ]
        for arm in (0, 1):
            for place, link in enumerate(LINKS):
                if place > 0:
                    clearance = limits.finger_clearance if link in FINGERS else limits.table_clearance
                    pairs.append(Pair(index(arm, link), table, clearance, RefusalKind.TABLE))
                pairs += [
                    Pair(
                        index(arm, link), index(arm, other), limits.self_clearance, RefusalKind.SELF_COLLISION
                    )
                    for other in LINKS[place + NEIGHBOURS :]
                    if not (link in HAND and other in HAND)
                ]
            if motion.held[arm] is not None:
                held = index(arm, "held")
                near = [(arm, link) for link in LINKS[:5]] + [
                    (1 - arm, link) for link in LINKS if link not in HAND
                ]
                pairs += [
                    Pair(index(*shape), held, limits.self_clearance, RefusalKind.HELD_OBJECT)
                    for shape in near
                ]
        return pairs


def _first(bad: FloatArray) -> tuple[int | None, int]:
    """Return the first row of [S, K] that holds True, and its first column; None if there is none."""
    rows = np.flatnonzero(bad.any(axis=1))
    if not len(rows):
        return None, 0
    return int(rows[0]), int(np.flatnonzero(bad[rows[0]])[0])
