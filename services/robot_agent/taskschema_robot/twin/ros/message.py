"""Messages from clients: checked against their type as rosbridge checks them, and no more than that."""

import base64
import re
from dataclasses import dataclass
from functools import cache
from typing import Any

from taskschema_robot.twin.ros.definitions import DEFINITIONS

Message = dict[str, Any]
"""A message's fields by name; time and duration are `{"secs": ..., "nsecs": ...}`, uint8[] is bytes."""

HEADER = "std_msgs/Header"
BYTES = "uint8"
TIMES = ("time", "duration")
INTEGERS = {
    f"{sign}int{bits}": (0, 2**bits) if sign else (-(2 ** (bits - 1)), 2 ** (bits - 1))
    for bits in (8, 16, 32, 64)
    for sign in ("", "u")
}
"""Range of each integer type: from the first to below the second."""
FLOATS = ("float32", "float64")
DEFAULTS: dict[str, Any] = {"bool": False, "string": "", "float32": 0.0, "float64": 0.0}
ARRAY = re.compile(r"(.+)\[(\d*)\]$")
TYPE_NAME = re.compile(r"[A-Za-z]\w*/[A-Za-z]\w*$")


class MessageError(Exception):
    """A message that rosbridge refuses; the text is what it logs."""


@dataclass(frozen=True)
class Field:
    """One field of a message type."""

    name: str
    kind: str
    """Of the field, or of its elements if it is an array."""
    array: bool
    length: int | None
    """Of an array of fixed length."""

    @property
    def type_name(self) -> str:
        """The type as ROS writes it."""
        return self.kind if not self.array else f"{self.kind}[{self.length or ''}]"


def require_type(name: str) -> None:
    """Check that a message type exists.

    Raises:
        MessageError: if it does not; a type from an unknown package reads otherwise than an unknown type.
    """
    if not TYPE_NAME.match(name):
        raise MessageError(f"{name} is not a valid type string")
    package, kind = name.split("/")
    if name in DEFINITIONS:
        return
    if any(known.startswith(f"{package}/") for known in DEFINITIONS):
        raise MessageError(f"Unable to import msg class {kind} from package {package}.")
    raise MessageError(f"Unable to load the manifest for package {package}.")


@cache
def fields_of(type_name: str) -> tuple[Field, ...]:
    """Return a message type's fields in order."""
    fields = []
    for part in DEFINITIONS[type_name].split(";"):
        if not part.strip():
            continue
        kind, name = part.split()
        match = ARRAY.match(kind)
        length = int(match[2]) if match and match[2] else None
        fields.append(Field(name, match[1] if match else kind, match is not None, length))
    return tuple(fields)


def default_message(type_name: str) -> Message:
    """Return a message whose every field has its default."""
    return {field.name: _default(field) for field in fields_of(type_name)}


def _default(field: Field) -> Any:  # noqa: ANN401 - as many types as ROS has
    if field.array and field.kind == BYTES:
        return b""
    if field.array:
        return [_single_default(field.kind) for _ in range(field.length or 0)]
    return _single_default(field.kind)


def _single_default(kind: str) -> Any:  # noqa: ANN401
    if kind in TIMES:
        return {"secs": 0, "nsecs": 0}
    if kind in INTEGERS:
        return 0
    return DEFAULTS[kind] if kind in DEFAULTS else default_message(kind)


def read_message(type_name: str, values: Any, now: Message) -> Message:  # noqa: ANN401 - a client's JSON
    """Return the message that a client's JSON object stands for, absent fields at their defaults.

    Args:
        type_name: of the message.
        values: what the client sent.
        now: the bridge's time, for `"now"` and for headers that give no stamp.

    Raises:
        MessageError: if a field does not exist or has the wrong JSON type. Numbers out of range and arrays of
            the wrong length pass: they fail later, in `check_serialisable`.
    """
    if not isinstance(values, dict):
        raise MessageError(f"Expected a JSON object for type {type_name} but received a {type(values)}")
    return _read(type_name, type_name, (), values, now)


def _read(root: str, type_name: str, path: tuple[str, ...], values: dict[str, Any], now: Message) -> Message:
    message = default_message(type_name)
    if type_name == HEADER:
        message["stamp"] = dict(now)
    known = {field.name: field for field in fields_of(type_name)}
    for name, value in values.items():
        place = (*path, name)
        if name not in known:
            raise MessageError(f"Message type {root} does not have a field {'.'.join(place)}")
        field = known[name]
        if field.array:
            message[name] = _read_array(root, field, place, value, now)
        else:
            message[name] = _read_value(root, field.kind, place, value, message[name], now)
    return message


def _read_array(root: str, field: Field, path: tuple[str, ...], value: Any, now: Message) -> Any:  # noqa: ANN401
    if field.kind == BYTES and isinstance(value, str):
        return _from_base64(value)
    if not isinstance(value, list):
        raise _mismatch(root, field.type_name, path, value)
    if field.kind in FLOATS and all(type(item) is float for item in value):
        return value
    items = [_read_value(root, field.kind, path, item, _single_default(field.kind), now) for item in value]
    return bytes(items) if field.kind == BYTES and all(0 <= item < 256 for item in items) else items


def _from_base64(text: str) -> Any:  # noqa: ANN401 - text that is no base64 stays text, and fails later
    """Decode as rosbridge does: foreign characters are skipped, missing padding is not noticed here."""
    try:
        return base64.b64decode(text)
    except ValueError:  # wrong length, or characters beyond ASCII
        return text


def _read_value(root: str, kind: str, path: tuple[str, ...], value: Any, default: Any, now: Message) -> Any:  # noqa: ANN401
    if kind in TIMES:
        if value == "now":
            return dict(now)
        given = value if isinstance(value, dict) else {}
        return default | {key: given[key] for key in ("secs", "nsecs") if key in given}
    if kind in DEFINITIONS:
        if not isinstance(value, dict):
            raise _mismatch(root, kind, path, value)
        return _read(root, kind, path, value, now)
    if not _fits(kind, value):
        raise _mismatch(root, kind, path, value)
    return float(value) if kind in FLOATS else value


def _fits(kind: str, value: Any) -> bool:  # noqa: ANN401
    if kind == "bool":
        return isinstance(value, bool)
    if kind == "string":
        return isinstance(value, str)
    if isinstance(value, bool):
        return False
    return isinstance(value, int) or (kind in FLOATS and isinstance(value, float))


def _mismatch(root: str, kind: str, path: tuple[str, ...], value: Any) -> MessageError:  # noqa: ANN401
    return MessageError(
        f"{root} message requires a {kind} for field {'.'.join(path)}, but got a {type(value)}"
    )
