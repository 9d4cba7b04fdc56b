"""The robot's switches: enabled, stopped, error, emergency stop button."""

from enum import IntEnum

from taskschema_robot.twin.ros.message import Message


class Button(IntEnum):
    """State of the emergency stop button, as intera_core_msgs numbers it."""

    UNPRESSED = 0
    PRESSED = 1
    UNKNOWN = 2
    RELEASED = 3


class Source(IntEnum):
    """What stopped the robot, as intera_core_msgs numbers it."""

    NONE = 0
    USER = 1
    UNKNOWN = 2
    FAULT = 3


class Assembly:
    """Enable, stop and reset; a robot starts disabled."""

    def __init__(self) -> None:
        self.enabled = False
        self.stopped = False
        self.error = False
        self.button = Button.UNPRESSED
        self.source = Source.NONE

    def enable(self, wanted: bool) -> None:
        """Switch the motors; refused without a word while stopped or in error."""
        if wanted and (self.stopped or self.error):
            return
        self.enabled = wanted

    def stop(self) -> None:
        """Stop by software: as if the button had been pressed, though nobody knows by whom."""
        self.enabled, self.stopped = False, True
        if self.source is Source.NONE:
            self.source = Source.UNKNOWN

    def press_button(self) -> None:
        """Stop by the emergency stop button."""
        self.enabled, self.stopped = False, True
        self.button, self.source = Button.PRESSED, Source.USER

    def fail(self) -> None:
        """Stop because a joint reports an error."""
        self.enabled, self.stopped, self.error = False, True, True
        self.source = Source.FAULT

    def release_button(self) -> None:
        """Let the button go: the robot stays stopped."""
        if self.button is Button.PRESSED:
            self.button = Button.RELEASED

    def reset(self) -> None:
        """End a stop; refused without a word if there is none or the button is still pressed."""
        if not (self.stopped or self.error) or self.button is Button.PRESSED:
            return
        self.enabled = self.stopped = self.error = False
        self.button, self.source = Button.UNPRESSED, Source.NONE

    def message(self) -> Message:
        """Return it as intera_core_msgs/RobotAssemblyState."""
        return {
            "homed": True,
            "ready": self.enabled and not self.error,
            "enabled": self.enabled,
            "stopped": self.stopped,
            "error": self.error,
            "lowVoltage": False,
            "estop_button": int(self.button),
            "estop_source": int(self.source),
        }
