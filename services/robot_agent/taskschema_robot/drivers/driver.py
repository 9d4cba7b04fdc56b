"""The interface of an arm: set-points in, state out, gripper, stop."""

from dataclasses import dataclass
from typing import Protocol

from taskschema.arrays import FloatArray


@dataclass(frozen=True)
class GripperState:
    """What the gripper last said of itself."""

    opening: float
    """Distance between the pads [m]."""
    calibrated: bool
    """An electric gripper ignores everything else until it is."""
    moving: bool
    gripping: bool
    """Whether it holds something: it stopped on a force before its set-point."""
    error: bool


@dataclass(frozen=True)
class Source:
    """Something that an arm's state is put together from, beside the joint states."""

    name: str
    """For messages: a topic, say."""
    time: float
    """When it last said something, on the agent's clock [s]."""
    longest: float
    """Silence after which what it said last must not be believed any more [s]."""


@dataclass(frozen=True, eq=False)
class ArmState:
    """What one arm last said of itself, and when."""

    time: float
    """When the newest joint state arrived, on the agent's clock [s]. A state that is repeated with its old
    stamp does not count as new: an age is `clock.now() - time`."""
    stamp: float
    """The same state's time on the robot's clock [s]: `stamp - time` is the clocks' difference."""
    positions: FloatArray
    """[7] measured joint angles [rad]."""
    velocities: FloatArray
    """[7] measured joint velocities [rad/s]."""
    efforts: FloatArray
    """[7] measured joint torques [Nm]."""
    wrench: FloatArray
    """[6] force [N] and torque [Nm] at the end effector, in the robot's base frame."""
    collision: bool
    """Whether the robot's own collision detection has stopped it."""
    enabled: bool
    stopped: bool
    """By a stop of any kind; only `reset` ends it, and the arm is disabled then."""
    error: bool
    emergency_stop: bool
    """Whether the emergency stop button is pressed."""
    gripper: GripperState
    sources: tuple[Source, ...] = ()
    """Where all but the joints comes from: a silent one would say for ever that all is well."""

    @property
    def ready(self) -> bool:
        """Whether the arm would obey a motion command."""
        return self.enabled and not (self.stopped or self.error or self.collision)


class ArmDriver(Protocol):
    """One arm with its gripper.

    Methods that wait take their time from the agent's `Clock` and never wait for ever. None of them queues:
    what cannot be sent now is not sent. `command` and `stop` may be called from any thread.
    """

    name: str
    """`left` or `right`: for messages and logs."""

    def connect(self) -> None:
        """Connect and wait for a complete first state.

        Raises:
            NotConnectedError: if there is no robot, or it sends no state.
        """

    @property
    def connected(self) -> bool:
        """Whether the connection is alive: open, and its last ping was answered."""

    def state(self) -> ArmState:
        """Return the newest state, without waiting; its age is the caller's to judge.

        Raises:
            NotConnectedError: if there has never been one.
        """

    def command(self, positions: FloatArray) -> None:
        """Send one set-point: joint angles [7] in radians. Does not wait.

        Raises:
            NotConnectedError: if the connection is down.
            StaleStateError: if the last state is older than 0.1 s.
            NotReadyError: if the arm is not enabled, or was told to stop.
            SetpointError: if the angles are not finite, outside the joint limits, or farther from the last
                set-point or from the measured angles than the arm's stopping distance.
        """

    def set_speed_ratio(self, ratio: float) -> None:
        """Limit the arm's own speed to a share, 0 to 1, of its joint velocity limits."""

    def set_gripper(self, opening: float) -> None:
        """Send the gripper to `opening` [m] between the pads, or to its nearest end. Does not wait.

        The command is repeated in the background until the gripper acknowledges it; one that replaces it, or
        a stop, ends that. See `gripper_acknowledged`.

        Raises:
            NotConnectedError: if the connection is down.
            NotReadyError: if the gripper is not calibrated or reports an error, or the arm was told to stop.
        """

    @property
    def gripper_acknowledged(self) -> bool:
        """Whether the gripper has acknowledged its newest command."""

    def calibrate_gripper(self) -> None:
        """Calibrate: the fingers move through their whole range. Waits until it has happened.

        Raises:
            NotReadyError: if the arm was told to stop meanwhile.
            EffectTimeoutError: if the gripper does not report it in time.
        """

    def stop(self) -> None:
        """Stop at once: not safety rated. Sends, keeps sending until the state shows it, does not wait.

        No set-point is sent after it, and it waits for none that is being sent. Never raises: a connection
        that is down cannot carry a stop, and the caller sees `connected`.
        """

    def reset(self) -> None:
        """End a stop or an error; the arm is disabled then. Waits for the effect.

        Raises:
            NotReadyError: if the emergency stop button is still pressed.
            EffectTimeoutError: if the state does not show it in time.
        """

    def enable(self) -> None:
        """Switch the motors on; the arm holds its position. Waits for the effect.

        Raises:
            EffectTimeoutError: if the state does not show it in time.
        """

    def disable(self) -> None:
        """Switch the motors off: brakes hold the arm. Waits for the effect.

        Raises:
            EffectTimeoutError: if the state does not show it in time.
        """

    def close(self) -> None:
        """End the connection. The arm stays where it is."""
