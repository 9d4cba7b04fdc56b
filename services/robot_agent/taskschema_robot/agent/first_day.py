"""The list of the first day on hardware: what is looked at, then what is moved, one thing at a time."""

from collections.abc import Callable, Sequence

import numpy as np

from taskschema.arrays import FloatArray
from taskschema.kinematics.sawyer import rethink_gripper, sawyer, sawyer_pair
from taskschema.motion.timing import fastest_path
from taskschema.safety.limits import SafetyLimits
from taskschema.safety.motion import Motion
from taskschema.skills.pairs import ARMS
from taskschema_robot.clock import Clock
from taskschema_robot.drivers.driver import ArmState
from taskschema_robot.errors import RobotError
from taskschema_robot.finding import Finding
from taskschema_robot.safety.fault import FaultError
from taskschema_robot.safety.gate import SafetyGate

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
Press = Callable[[int, bool], None]
"""Has the emergency stop of an arm (0 left, 1 right) pressed, or released; need not wait for it."""


class FirstDay:
    """Walks through the list. Every line says what was found, and what to do if it is not good.

    Args:
        gate: both arms behind it.
        clock: the agent's.
        limits: the gate's, at a tenth of the arms' speed.
        confirm: asks a person before anything moves.
        say: writes a line.
        press: asks a person for the emergency stop buttons.
        looks: at what is beside the arms.

    """

    def __init__(
        self,
        gate: SafetyGate,
        clock: Clock,
        limits: SafetyLimits,
        confirm: Callable[[str], bool],
        say: Callable[[str], None],
        press: Press,
        looks: Sequence[Look] = (),
    ) -> None:
        self._gate, self._clock, self._limits = gate, clock, limits
        self._confirm, self._say = confirm, say
        self._press, self._looks = press, looks

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
        items: list[tuple[str, Callable[[], None]]] = [
            ("Enable both arms and calibrate both grippers: the fingers move", self._gate.prepare)
        ]
        for arm, name in enumerate(ARMS):
            words = f"Press the {name} robot's emergency stop button, see it, release it"
            items.append((words, lambda arm=arm: self._emergency_stop(arm)))  # type: ignore[misc]
        items.append(("Close and open both grippers, which hold nothing", self._close_and_open))
        for arm, name in enumerate(ARMS):
            items.append((f"Turn the {name} wrist by 3 degrees and back", lambda arm=arm: self._nudge(arm)))  # type: ignore[misc]
        items.append(("Stop both arms by software, then acknowledge", self._stop_and_acknowledge))
        for words, action in items:
            if not self._confirm(f"{words}?"):
                return self._note(False, words, "not done")
            try:
                action()
            except RobotError as error:
                return self._note(False, words, str(error))
            self._note(True, words, "done")
        return True

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
        joints = np.stack([state.positions for state in self._gate.states()])
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
            self._press(arm, pressed)
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
        joints = np.stack([state.positions for state in self._gate.states()])
        gripper = rethink_gripper()
        for opening in (gripper.closed, gripper.open):
            refusal = self._gate.execute(self._still(joints, opening))
            if refusal is not None:
                raise RobotError(f"refused: {refusal.reason}.")

    def _nudge(self, arm: int) -> None:
        """Turn one wrist a little and back."""
        start = np.stack([state.positions for state in self._gate.states()])
        there = start.copy()
        there[arm, 6] += NUDGE if start[arm, 6] < 0.0 else -NUDGE
        for first, last in ((start, there), (there, start)):
            wide = np.full(1, rethink_gripper().open)
            left, right = (
                fastest_path(kinematics, np.stack([first[row], last[row]])[None], wide)
                for row, kinematics in enumerate(sawyer_pair())
            )
            motion = Motion.of_paths(left, right, self._limits.period, speed_ratio=self._limits.speed_ratio)
            refusal = self._gate.execute(motion)
            if refusal is not None:
                raise RobotError(f"refused: {refusal.reason}.")

    def _stop_and_acknowledge(self) -> None:
        self._gate.stop("first-day check")
        try:
            self._gate.execute(self._still(np.stack([state.positions for state in self._gate.states()])))
        except FaultError:
            self._gate.acknowledge("first-day check")
            return
        raise RobotError("the gate let a motion through after a stop: do not use it.")
