"""The list of the first day on hardware: what is looked at, then what is moved, one thing at a time."""

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from taskschema.arrays import FloatArray
from taskschema.kinematics.sawyer import rethink_gripper, sawyer
from taskschema.safety.limits import SafetyLimits
from taskschema.safety.motion import Motion
from taskschema.skills.pairs import ARMS
from taskschema_robot.agent.first_day_person import FirstDayPerson
from taskschema_robot.agent.frame_trial import FrameTrial, Offset, judge, markers_near
from taskschema_robot.agent.slow_motion import WRIST, measured_joints, move, slow_motion
from taskschema_robot.agent.stop_trial import StopTrial
from taskschema_robot.clock import Clock
from taskschema_robot.drivers.driver import ArmState
from taskschema_robot.errors import RobotError
from taskschema_robot.finding import Finding
from taskschema_robot.objects.marker import Marker
from taskschema_robot.safety.fault import FaultError
from taskschema_robot.safety.gate import SafetyGate
from taskschema_robot.safety.gated_arms import GatedArms

STATES = 100
"""Joint states that are timed."""
LOOK_SECONDS = 0.05
"""Between two looks for a button [s]."""
NUDGE = 0.05
"""How far one joint of one arm is moved [rad]."""
REST_SHARE = 0.25
"""Of what the gate allows at a hand: a free hand at rest that feels more is not calibrated, or touches."""
BUTTON_SECONDS = 60.0
"""How long a person may take to press or release a button [s]."""

Look = Callable[[], Sequence[Finding]]
"""Looks at something beside the arms: the camera, the run."""
Item = tuple[str, Callable[[], str | None]]
"""What is done, and how; it returns what was found, if more than that it is done."""


class FirstDay:
    """Walks through the list. Every line says what was found, and what to do if it is not good.

    Args:
        gate: both arms behind it.
        clock: the agent's.
        limits: the gate's, at a tenth of the arms' speed.
        person: is asked before anything moves, and for buttons and keys.
        say: writes a line.
        looks: at what is beside the arms.
        arms: those behind the gate, as the motions are made with; None: the gate itself.

    """

    def __init__(
        self,
        gate: SafetyGate,
        clock: Clock,
        limits: SafetyLimits,
        person: FirstDayPerson,
        say: Callable[[str], None],
        looks: Sequence[Look] = (),
        arms: GatedArms | None = None,
    ) -> None:
        self._gate, self._clock, self._limits = gate, clock, limits
        self._person, self._say, self._looks = person, say, looks
        self._arms = arms or gate
        self._trial = StopTrial(self._arms, clock, limits)
        self._frame = FrameTrial(self._arms, limits)

    def stop(self, reason: str) -> None:
        """Stop both arms: what a stop key, or an endpoint, has to call. From any thread."""
        self._trial.stop(reason)

    def look(self) -> bool:
        """Check everything that can be checked without moving; return whether all is good."""
        self._gate.connect()
        states = self._gate.states()
        good = [self._reported(name, state) for name, state in zip(ARMS, states, strict=True)]
        good.append(self._rates())
        good.append(self._clear())
        for look in self._looks:
            good += [self._note(item.good, item.what, item.words) for item in look()]
        return all(good)

    def move(self) -> bool:
        """Move one thing at a time, each after a person's word; return whether all went well."""
        for words, action in self._items():
            if not self._person.confirm(f"{words}?"):
                return self._note(False, words, "not done")
            try:
                found = action()
            except RobotError as error:
                return self._note(False, words, str(error))
            self._note(True, words, found or "done")
        return self._one_frame()

    def _one_frame(self) -> bool:
        """Have each hand above two of the table's markers measured; return whether all share one frame."""
        good = []
        for arm, name in enumerate(ARMS):
            words, offsets = f"Move the {name} hand to 10 cm above two markers, one after the other", []
            if not self._person.confirm(f"{words}?"):
                return self._note(False, words, "not done")
            try:
                offsets = [self._offset(arm, marker) for marker in markers_near(arm)]
                self._frame.go_home()
            except RobotError as error:
                return self._note(False, words, str(error))
            measured = [item for item in offsets if item is not None]
            if len(measured) < len(offsets):
                self._say(f"left  {name} hand above markers: nobody measured it, see docs/run-a-robot.md")
            if measured:
                found = judge(arm, measured)
                good.append(self._note(found.good, found.what, found.words))
        return all(good)

    def _offset(self, arm: int, marker: Marker) -> Offset | None:
        """Go above a marker and have measured how far beside it the hand is."""
        self._frame.go_above(arm, marker)
        question = (
            f"  How far is the middle between the {ARMS[arm]} finger tips from marker {marker.number}'s "
            "centre, to its right and to its top?"
        )
        measured = self._person.measure(question)
        return None if measured is None else Offset(marker, *measured)

    def _items(self) -> list[Item]:
        buttons: list[Item] = [
            (
                f"Press the {name} robot's emergency stop button, see it, release it",
                partial(self._emergency_stop, arm),
            )
            for arm, name in enumerate(ARMS)
        ]
        wrists: list[Item] = [
            (f"Turn the {name} wrist by 3 degrees and back", partial(self._nudge, arm))
            for arm, name in enumerate(ARMS)
        ]
        return [
            ("Enable both arms and calibrate both grippers: the fingers move", self._gate.prepare),
            *buttons,
            ("Close and open both grippers, which hold nothing", self._close_and_open),
            *wrists,
            ("Press the stop key while the wrists turn", self._stop_key),
            ("Stop both arms by software, then acknowledge", self._stop_and_acknowledge),
        ]

    def _note(self, good: bool, what: str, words: str) -> bool:
        self._say(f"{'good' if good else 'MEND':5} {what}: {words}")
        return good

    def _reported(self, name: str, state: ArmState) -> bool:
        arm = sawyer()
        inside = bool(((state.positions > arm.lower) & (state.positions < arm.upper)).all())
        words = "inside their limits" if inside else f"outside: {np.round(state.positions, 2).tolist()}"
        good = [self._note(inside, f"{name} joints", words)]
        stop = "pressed: release it" if state.emergency_stop else "released"
        good.append(self._note(not state.emergency_stop, f"{name} emergency stop", stop))
        error = "reports an error: see its own screen" if state.error else "reports no error"
        good.append(self._note(not state.error, f"{name} arm", error))
        good.append(self._at_rest(name, state))
        skew = abs(state.stamp - state.time)
        words = f"{skew:.3f} s beside ours" + ("" if skew < 0.1 else ": synchronise both with NTP")
        good.append(self._note(skew < 0.1, f"{name} clock", words))
        return all(good)

    def _at_rest(self, name: str, state: ArmState) -> bool:
        """Check that a hand that touches nothing says so."""
        force, torque = np.sqrt((state.wrench.reshape(2, 3) ** 2).sum(axis=1)).tolist()
        most_force, most_torque = REST_SHARE * self._limits.force, REST_SHARE * self._limits.torque
        good = force < most_force and torque < most_torque
        words = f"{force:.0f} N and {torque:.1f} Nm at rest"
        if not good:
            words += f", {most_force:.0f} N and {most_torque:.1f} Nm are the most: does it touch something?"
        return self._note(good, f"{name} hand", words)

    def _rates(self) -> bool:
        """Time the joint states of both arms."""
        seen: list[set[float]] = [set(), set()]
        begin = self._clock.now()
        while min(len(stamps) for stamps in seen) < STATES and self._clock.now() < begin + 5.0:
            self._clock.sleep_until(self._clock.now() + 0.002)
            for stamps, state in zip(seen, self._gate.states(), strict=True):
                stamps.add(state.stamp)
        seconds = self._clock.now() - begin
        rates = [len(stamps) / seconds for stamps in seen]
        words = ", ".join(f"{name} {rate:.0f} Hz" for name, rate in zip(ARMS, rates, strict=True))
        return self._note(
            min(rates) > 50.0, "joint states", words + ("" if min(rates) > 50.0 else ": network?")
        )

    def _clear(self) -> bool:
        """Check that the arms stand clear, by the gate's own sweep of standing still."""
        joints = measured_joints(self._gate)
        refusal = self._gate.check(self._still(joints))
        return self._note(
            refusal is None, "arms and table", refusal.reason if refusal else "clear of each other"
        )

    def _still(self, joints: FloatArray, opening: float | None = None) -> Motion:
        wide = rethink_gripper().open if opening is None else opening
        return Motion(np.repeat(joints[:, None], 2, axis=1), np.full((2, 2), wide), self._limits.period)

    def _emergency_stop(self, arm: int) -> None:
        """Have a button pressed and released, see both, and enable the arm again."""
        for pressed in (True, False):
            self._person.press_button(arm, pressed=pressed)
            deadline = self._clock.now() + BUTTON_SECONDS
            while self._gate.states()[arm].emergency_stop is not pressed:
                if self._clock.now() > deadline:
                    what = "pressed" if pressed else "released"
                    raise RobotError(f"nobody {what} it, or the robot does not say so: check its cable.")
                self._clock.sleep_until(self._clock.now() + LOOK_SECONDS)
            if pressed and self._gate.states()[arm].ready:
                raise RobotError("the arm says it would still move: do not use it.")
        self._gate.prepare()

    def _close_and_open(self) -> None:
        """Close and open both hands: the gate waits for what they acknowledge and do."""
        joints = measured_joints(self._gate)
        gripper = rethink_gripper()
        for opening in (gripper.closed, gripper.open):
            move(self._arms, self._still(joints, opening))

    def _nudge(self, arm: int) -> None:
        """Turn one wrist a little and back."""
        start = measured_joints(self._gate)
        there = start.copy()
        there[arm, WRIST] += NUDGE if start[arm, WRIST] < 0.0 else -NUDGE
        for first, last in ((start, there), (there, start)):
            move(self._arms, slow_motion(first, last, self._limits))

    def _stop_key(self) -> str:
        """Have the stop key pressed while both wrists turn; return how far the arms ran on."""
        words = self._trial.run(self._person.press_stop_key)
        self._gate.acknowledge("first-day check")
        return words

    def _stop_and_acknowledge(self) -> None:
        self._gate.stop("first-day check")
        try:
            self._gate.execute(self._still(measured_joints(self._gate)))
        except FaultError:
            self._gate.acknowledge("first-day check")
            return
        raise RobotError("the gate let a motion through after a stop: do not use it.")
