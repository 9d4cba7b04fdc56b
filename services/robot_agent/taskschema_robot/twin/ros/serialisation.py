"""What ROS can put on its own wire."""

import struct
from typing import Any

from taskschema_robot.twin.ros.message import (
    BYTES,
    DEFAULTS,
    INTEGERS,
    TIMES,
    Field,
    Message,
    MessageError,
    fields_of,
)

NANOSECONDS = 10**9


def serialise(type_name: str, message: Message) -> Message:
    """Return the message as its ROS subscriber receives it.

    float32 values are rounded, durations normalised.

    Raises:
        MessageError: if a value passed rosbridge's check but fits no wire format: an integer out of range, an
            array of the wrong fixed length, a lone surrogate. A publisher is broken after that.
    """
    return {field.name: _serialise_field(field, message[field.name]) for field in fields_of(type_name)}


def _serialise_field(field: Field, value: Any) -> Any:  # noqa: ANN401
    if not field.array:
        return _serialise_value(field.name, field.kind, value)
    if field.kind == BYTES and isinstance(value, str):
        raise MessageError(f"a bytes object is required when writing {value!r}")
    if field.length is not None and len(value) != field.length:
        raise MessageError(f"expected {field.length} items for packing (got {len(value)})")
    if isinstance(value, bytes) or field.kind == "float64":
        return value
    return [_serialise_value(f"{field.name}[]", field.kind, item) for item in value]


def _serialise_value(name: str, kind: str, value: Any) -> Any:  # noqa: ANN401
    if kind in TIMES:
        return _serialise_time(kind, value)
    if kind in INTEGERS:
        lowest, end = INTEGERS[kind]
        if not lowest <= value < end:
            raise MessageError(f"field {name} exceeds specified width [{kind}]")
        return value
    if kind == "string":
        try:
            value.encode()
        except UnicodeEncodeError as error:
            raise MessageError(str(error)) from None
        return value
    if kind == "float32":
        return _float32(value)
    return value if kind in DEFAULTS else serialise(kind, value)


def _float32(value: float) -> float:
    try:
        rounded: float = struct.unpack("<f", struct.pack("<f", value))[0]
    except OverflowError:
        raise MessageError("float too large to pack with f format") from None
    return rounded


def _serialise_time(kind: str, value: Message) -> Message:
    seconds, nanoseconds = value["secs"], value["nsecs"]
    if not all(isinstance(part, int) and not isinstance(part, bool) for part in (seconds, nanoseconds)):
        raise MessageError("required argument is not an integer")
    if kind == "duration":
        carry, nanoseconds = divmod(nanoseconds, NANOSECONDS)
        seconds += carry
    if kind == "time" and (seconds < 0 or nanoseconds < 0):
        raise MessageError("argument out of range")
    return {"secs": seconds, "nsecs": nanoseconds}


def ros_time(seconds: float) -> Message:
    """Return a ROS time of seconds since the epoch."""
    whole, rest = divmod(round(seconds * NANOSECONDS), NANOSECONDS)
    return {"secs": whole, "nsecs": rest}
