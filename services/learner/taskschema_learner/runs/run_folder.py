"""A run's folder: its config, checkpoints, metrics and latest schema, none of it ever half-written."""

import csv
import io
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import filelock
import msgspec

from taskschema import __version__
from taskschema.bus.keys import RunKeys
from taskschema.bus.worker_info import AgentKind
from taskschema.config import FORMAT_VERSION, RunConfig
from taskschema.errors import ConfigError, RunFolderError
from taskschema.metrics import RoundMetrics
from taskschema.schema import SchemaDocument

INITIAL_POLICY = "initial_policy.safetensors"
"""File of the policy that a run started from, in its folder."""
TRUNK = "trunk.safetensors"
"""File of the published weights that a run's frozen trunk has, in its folder."""
LOCK = "learner.lock"
"""File that a run's learner holds locked."""
LOCK_PATIENCE = 0.2
"""A learner tries for so long to lock it [s]: who looks whether it is locked holds it for a moment."""


class _ConfigFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    format_version: int
    taskschema_version: str
    config: RunConfig
    agent: AgentKind | None = None
    device: str | None = None


class _AnyVersion(msgspec.Struct, frozen=True):
    format_version: int


class RunFolder:
    """The files of one run; `create` or `open` makes one, `locked` guards it against a second learner."""

    def __init__(self, path: Path, config: RunConfig, agent: AgentKind | None, device: str | None) -> None:
        self.path = path
        self.config = config
        self.agent = agent
        """Who runs the episodes; None: the folder is from before this was written down."""
        self.device = device
        """torch device of the learner; None: the same."""

    @property
    def name(self) -> str:
        """Name of the run: the folder's own, also where the path is `.`."""
        return self.path.resolve().name

    @property
    def checkpoints(self) -> Path:
        """Folder of the checkpoints."""
        return self.path / "checkpoints"

    @classmethod
    def create(
        cls,
        path: Path,
        config: RunConfig,
        initial_policy: bytes | None = None,
        trunk: bytes | None = None,
        agent: AgentKind = "simulation",
        device: str = "cpu",
    ) -> "RunFolder":
        """Make a new run's folder.

        Args:
            path: of the folder.
            config: of the run.
            initial_policy: the snapshot that the config says it starts from.
            trunk: the published weights that the config names, as `run_policies.trunk_to_bytes` makes them.
            agent: who runs the episodes.
            device: torch device of the learner.

        Raises:
            ConfigError: if the folder's name cannot be a run's.
            RunFolderError: if a run is there, or is just being made, or the place cannot be written.
        """
        folder = cls(path, config, agent, device)
        RunKeys(folder.name)  # refuses a name before anything is written
        folder._require_no_run()
        content = _ConfigFile(FORMAT_VERSION, __version__, config, agent, device)
        try:
            path.mkdir(parents=True, exist_ok=True)
            folder.checkpoints.mkdir(exist_ok=True)
        except OSError as error:
            raise RunFolderError(f"The run folder {path} cannot be made: {error.strerror}.") from None
        with folder.locked():
            folder._require_no_run()  # of two that begin at once, one is second
            for name, data in ((INITIAL_POLICY, initial_policy), (TRUNK, trunk)):
                if data is not None:
                    write_atomically(path / name, data)
            write_atomically(
                path / "config.json", msgspec.json.format(msgspec.json.encode(content), indent=2)
            )
        return folder

    def _require_no_run(self) -> None:
        """Return if the folder holds no run.

        Raises:
            RunFolderError: if it does.
        """
        if (self.path / "config.json").exists():
            raise RunFolderError(
                f"{self.path} already holds a run: continue it with --resume, or choose another --run-dir."
            )

    @classmethod
    def open(cls, path: Path) -> "RunFolder":
        """Open a run's folder.

        Raises:
            RunFolderError: if there is no run, its config is damaged, or its format is another version's.
        """
        try:
            data = (path / "config.json").read_bytes()
        except FileNotFoundError:
            raise RunFolderError(f"There is no run in {path}: it has no config.json.") from None
        except OSError as error:
            raise RunFolderError(f"The run in {path} cannot be read: {error.strerror}.") from None
        try:
            version = msgspec.json.decode(data, type=_AnyVersion).format_version
            if version != FORMAT_VERSION:
                raise RunFolderError(
                    f"The run in {path} has format version {version}, this is for {FORMAT_VERSION}: "
                    "use the version of taskschema named in its config.json, or start a new run."
                )
            file = msgspec.json.decode(data, type=_ConfigFile)
        except (msgspec.MsgspecError, ConfigError, UnicodeDecodeError) as error:
            raise RunFolderError(f"The run in {path} has a damaged config.json: {error}.") from None
        return cls(path, file.config, file.agent, file.device)

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Hold the run for one learner.

        Raises:
            RunFolderError: if another learner holds it.
        """
        lock = filelock.FileLock(self.path / LOCK, timeout=LOCK_PATIENCE)
        try:
            with lock:
                yield
        except filelock.Timeout:
            raise RunFolderError(f"Another learner is training {self.path}: stop it first.") from None

    def write_schema(self, document: SchemaDocument) -> None:
        """Replace `schema.json`; the newest checkpoint holds the same."""
        content = msgspec.json.format(msgspec.json.encode(document), indent=1)
        write_atomically(self.path / "schema.json", content, durable=False)

    def read_schema(self) -> SchemaDocument:
        """Return the newest schema.

        Raises:
            RunFolderError: if there is none yet, or it is damaged.
        """
        return read_schema_file(self.path / "schema.json")

    def write_policy(self, data: bytes) -> None:
        """Replace `policy.safetensors`, the newest policy snapshot; the newest checkpoint holds the same."""
        write_atomically(self.path / "policy.safetensors", data, durable=False)

    def read_policy(self) -> bytes:
        """Return the newest policy snapshot.

        Raises:
            RunFolderError: if there is none yet.
        """
        try:
            return (self.path / "policy.safetensors").read_bytes()
        except OSError:
            raise RunFolderError(f"The run in {self.path} has no policy yet: train it first.") from None

    def read_initial_policy(self) -> bytes | None:
        """Return the policy snapshot that the run started from; None: it started from random weights.

        Raises:
            RunFolderError: if it is gone.
        """
        return None if self.config.initial_policy is None else self._read_start(INITIAL_POLICY)

    def read_trunk(self) -> bytes | None:
        """Return the published weights of the frozen trunk; None: the run was made before folders kept them.

        Raises:
            RunFolderError: if they cannot be read.
        """
        return self._read_start(TRUNK) if (self.path / TRUNK).exists() else None

    def _read_start(self, name: str) -> bytes:
        try:
            return (self.path / name).read_bytes()
        except OSError as error:
            raise RunFolderError(
                f"{self.path / name}, which the run started from, cannot be read "
                f"({error.strerror}): restore it from a backup."
            ) from None

    def read_metrics(self) -> list[RoundMetrics]:
        """Return the rows of `metrics.csv`, oldest first; none if there is no such file.

        A line at the end that is not whole is one that is just being written.

        Raises:
            RunFolderError: if the file is damaged.
        """
        try:
            text = (self.path / "metrics.csv").read_bytes().decode()
            whole = io.StringIO(text[: text.rfind("\n") + 1], newline="")
            return [_parse_row(row) for row in csv.DictReader(whole)]
        except FileNotFoundError:
            return []
        except (msgspec.MsgspecError, ValueError, csv.Error) as error:
            raise RunFolderError(f"metrics.csv in {self.path} is damaged: {error}.") from None

    def append_metrics(self, metrics: RoundMetrics) -> None:
        """Add a round's row to `metrics.csv`."""
        path = self.path / "metrics.csv"
        is_new = not path.exists() or path.stat().st_size == 0
        with path.open("a", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            row = _format_row(metrics)
            if is_new:
                writer.writerow(row)
            writer.writerow(row.values())

    def keep_metrics(self, rows: list[RoundMetrics]) -> None:
        """Replace `metrics.csv` by these rows: what a checkpoint covers."""
        buffer = io.StringIO(newline="")
        writer = csv.writer(buffer)
        for number, row in enumerate(map(_format_row, rows)):
            if number == 0:
                writer.writerow(row)
            writer.writerow(row.values())
        write_atomically(self.path / "metrics.csv", buffer.getvalue().encode())


def read_schema_file(path: Path) -> SchemaDocument:
    """Return the schema in a file.

    Raises:
        RunFolderError: if it cannot be read or is no schema.
    """
    try:
        return msgspec.json.decode(path.read_bytes(), type=SchemaDocument)
    except OSError as error:
        raise RunFolderError(f"The schema {path} cannot be read: {error.strerror}.") from None
    except msgspec.MsgspecError as error:
        raise RunFolderError(f"{path} is not a schema: {error}.") from None


def write_atomically(path: Path, data: bytes, *, durable: bool = True) -> None:
    """Write a file so that it is either the old or the new one, also after a crash.

    If not `durable`, a power failure may leave neither: for what can be written again from a checkpoint.

    Raises:
        RunFolderError: if it cannot be written; the old file is then as it was.
    """
    temporary = None
    try:
        with tempfile.NamedTemporaryFile(dir=path.parent, prefix=f".{path.name}.", delete=False) as file:
            temporary = Path(file.name)
            file.write(data)
            if durable:
                file.flush()
                os.fsync(file.fileno())
        temporary.replace(path)
        if durable:
            _synchronise(path.parent)
    except OSError as error:
        if temporary is not None:
            temporary.unlink(missing_ok=True)
        raise RunFolderError(f"{path} cannot be written: {error.strerror}. Nothing was changed.") from None


def _synchronise(folder: Path) -> None:
    """Bring a folder's list of names to the disk."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _format_row(metrics: RoundMetrics) -> dict[str, str]:
    """Flatten a row: tuples are joined by spaces, floats keep every digit."""
    values: dict[str, Any] = msgspec.to_builtins(metrics)
    return {
        name: " ".join(map(repr, value)) if isinstance(value, tuple | list) else str(value)
        for name, value in values.items()
    }


def _parse_row(row: dict[str, str | None]) -> RoundMetrics:
    """Return the row; raise ValueError or msgspec's error if it is not one."""
    values: dict[str, Any] = dict(row)
    for name in ("schema_entropy", "schema_probability"):
        text = row.get(name)
        if text is None:
            raise ValueError(f"a line has no {name}")
        values[name] = [float(item) for item in text.split()]
    return msgspec.convert(values, RoundMetrics, strict=False)
