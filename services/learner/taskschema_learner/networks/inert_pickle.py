"""Reads the state dicts that `torch.save` wrote, in both of its formats, without executing anything.

A pickle is a program. Here its instructions are only listed (`pickletools`), and the few of them that a
state dict consists of are followed with plain data: names stay names, and nothing is imported or called.
"""

import io
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from pickletools import genops
from typing import Any, BinaryIO, cast

import numpy as np

from taskschema.arrays import AnyArray
from taskschema.errors import TrunkError

LEGACY_MAGIC = 0x1950A86A20F9469CFC6C
"""First number of the format before PyTorch 1.6, which torchvision's VGG16 is still published in."""
LEGACY_PROTOCOL = 1001
STORAGE_TYPES = {"FloatStorage": "<f4", "HalfStorage": "<f2", "DoubleStorage": "<f8", "LongStorage": "<i8"}
MAX_VALUES = 2**28
"""No tensor is larger: VGG16's largest has 103 million values."""


@dataclass(frozen=True)
class _Name:
    """A name that a pickle refers to, such as `collections OrderedDict`; never resolved."""

    text: str


@dataclass(frozen=True)
class _Storage:
    """A run of numbers that lies elsewhere in the file."""

    dtype: str
    key: str


@dataclass(frozen=True)
class _Tensor:
    storage: _Storage
    offset: int
    shape: tuple[int, ...]
    strides: tuple[int, ...]


def read_state_dict(data: bytes) -> dict[str, AnyArray]:
    """Return the arrays of a state dict by name.

    Raises:
        TrunkError: if it is none, is damaged, or asks for anything that a state dict does not need.
    """
    try:
        if data[:4] == b"PK\x03\x04":
            return _read_zip(data)
        return _read_legacy(io.BytesIO(data))
    except (ValueError, KeyError, IndexError, TypeError, AttributeError, OverflowError) as error:
        raise TrunkError(f"it is no state dict of torch ({error})") from None
    except (zipfile.BadZipFile, RuntimeError, NotImplementedError) as error:
        raise TrunkError(f"it is a damaged zip file ({error})") from None


def _read_zip(data: bytes) -> dict[str, AnyArray]:
    """Read the format since PyTorch 1.6: a zip of `data.pkl` and a file for every storage."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        names = [name for name in archive.namelist() if name.endswith("/data.pkl")]
        if len(names) != 1:
            raise ValueError("a zip without one data.pkl")
        folder = names[0].removesuffix("data.pkl")
        if f"{folder}byteorder" in archive.namelist() and archive.read(f"{folder}byteorder") != b"little":
            raise ValueError("not in little-endian order")
        content = _follow(io.BytesIO(archive.read(names[0])))
        return _arrays(content, lambda storage: archive.read(f"{folder}data/{storage.key}"))


def _read_legacy(stream: BinaryIO) -> dict[str, AnyArray]:
    """Read the older format: magic number, protocol, facts of the system, state dict, keys, storages."""
    if _follow(stream) != LEGACY_MAGIC or _follow(stream) != LEGACY_PROTOCOL:
        raise ValueError("another format")
    system, content, keys = (_follow(stream) for _ in range(3))
    if system.get("little_endian") is not True:
        raise ValueError("not in little-endian order")
    sizes = {item.storage.key: np.dtype(item.storage.dtype).itemsize for item in _tensors(content).values()}
    storages = {}
    for key in keys:
        length = int.from_bytes(stream.read(8), "little")
        storages[key] = stream.read(length * sizes[key]) if length <= MAX_VALUES else b""
    return _arrays(content, lambda storage: storages[storage.key])


def _tensors(content: Any) -> dict[str, _Tensor]:  # noqa: ANN401 - whatever the file holds
    if not isinstance(content, dict):
        raise TypeError("not a dict")
    found = {str(name): value for name, value in content.items() if isinstance(value, _Tensor)}
    if len(found) != len(content):
        raise TypeError("it holds other things than tensors: a state dict is expected, not a whole model")
    return found


def _arrays(content: Any, read: Callable[[_Storage], bytes]) -> dict[str, AnyArray]:  # noqa: ANN401
    arrays = {}
    for name, tensor in _tensors(content).items():
        strides = np.array(tensor.shape[1:] + (1,))[::-1].cumprod()[::-1] if tensor.shape else np.array([])
        if tuple(strides.tolist()) != tensor.strides:
            raise ValueError(f"tensor {name} is not contiguous")
        count = int(np.prod(tensor.shape))
        if not (0 <= count <= MAX_VALUES and tensor.offset >= 0):
            raise ValueError(f"tensor {name} has shape {tensor.shape}")
        dtype = np.dtype(tensor.storage.dtype)
        values = np.frombuffer(read(tensor.storage), dtype, count, tensor.offset * dtype.itemsize)
        arrays[name] = values.reshape(tensor.shape)
    return arrays


def _follow(stream: BinaryIO) -> Any:  # noqa: ANN401 - plain data of any kind
    """Follow one pickle's instructions as far as plain data and tensors need them."""
    stack: list[Any] = []
    marks: list[int] = []
    memo: dict[int, Any] = {}

    def since_mark() -> list[Any]:
        start = marks.pop()
        items = stack[start:]
        del stack[start:]
        return items

    for opcode, given, _ in genops(stream):
        name, argument = opcode.name, cast(Any, given)
        if name in _CONSTANTS:
            stack.append(_CONSTANTS[name]())
        elif name in _LITERALS:
            stack.append(argument)
        elif name == "MARK":
            marks.append(len(stack))
        elif name in ("TUPLE1", "TUPLE2", "TUPLE3"):
            size = int(name[-1])
            stack[-size:] = [tuple(stack[-size:])]
        elif name == "TUPLE":
            stack.append(tuple(since_mark()))
        elif name in ("BINPUT", "LONG_BINPUT", "PUT", "MEMOIZE"):
            memo[len(memo) if argument is None else int(argument)] = stack[-1]
        elif name in ("BINGET", "LONG_BINGET", "GET"):
            stack.append(memo[int(argument)])
        elif name == "GLOBAL":
            stack.append(_Name(argument))
        elif name == "SETITEM":
            value, key = stack.pop(), stack.pop()
            stack[-1][key] = value
        elif name == "SETITEMS":
            items = since_mark()
            stack[-1].update(zip(items[::2], items[1::2], strict=True))
        elif name in ("APPENDS", "APPEND"):
            items = since_mark() if name == "APPENDS" else [stack.pop()]
            stack[-1].extend(items)
        elif name == "BINPERSID":
            stack.append(_storage(stack.pop()))
        elif name == "REDUCE":
            arguments, made = stack.pop(), stack.pop()
            stack.append(_stand_in(made, arguments))
        elif name == "BUILD":
            stack.pop()  # attributes such as a state dict's `_metadata`: nothing here has any
        elif name == "STOP":
            return stack.pop()
        elif name not in ("PROTO", "FRAME"):
            raise ValueError(f"instruction {name} does not belong into a state dict")
    raise ValueError("it ends early")


_CONSTANTS: dict[str, Callable[[], Any]] = {
    "NONE": lambda: None,
    "NEWTRUE": lambda: True,
    "NEWFALSE": lambda: False,
    "EMPTY_DICT": dict,
    "EMPTY_TUPLE": tuple,
    "EMPTY_LIST": list,
}
_LITERALS = {
    "BINUNICODE",
    "SHORT_BINUNICODE",
    "SHORT_BINSTRING",
    "BINSTRING",
    "BININT",
    "BININT1",
    "BININT2",
    "LONG1",
    "LONG",
    "INT",
}


def _storage(reference: Any) -> _Storage:  # noqa: ANN401 - whatever the file holds
    """Return where a tensor's numbers lie: ('storage', type, key, place, count[, view])."""
    kind, name, key = reference[:3]
    module, _, storage_type = name.text.partition(" ")
    if kind != "storage" or module != "torch" or storage_type not in STORAGE_TYPES:
        raise ValueError(f"numbers of kind {name.text!r}")
    if len(reference) > 5 and reference[5] is not None:
        raise ValueError("a view of another storage")
    return _Storage(STORAGE_TYPES[storage_type], str(key))


def _stand_in(name: Any, arguments: Any) -> Any:  # noqa: ANN401 - whatever the file holds
    """Return plain data for the three things that a state dict is made of."""
    text = name.text if isinstance(name, _Name) else repr(name)[:60]
    if text == "collections OrderedDict" and not arguments:
        return {}
    if text in ("torch._utils _rebuild_tensor_v2", "torch._utils _rebuild_tensor"):
        storage, offset, shape, strides = arguments[:4]
        return _Tensor(storage, int(offset), tuple(shape), tuple(strides))
    if text == "torch._utils _rebuild_parameter":
        return arguments[0]
    raise ValueError(f"it wants to call {text!r}")
