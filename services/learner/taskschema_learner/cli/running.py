"""Finding a run that trains now, and the Redis that it uses."""

from pathlib import Path

from taskschema.bus.connection import connect
from taskschema.bus.records import RunRecords
from taskschema.errors import BusError, ConfigError, RunFolderError, UnknownNameError
from taskschema_learner.cli.run_reference import find_run, known_runs, run_name


def find_running(run: str | None, redis_url: str | None) -> tuple[RunRecords, str]:
    """Return the records that hold a run, and its name.

    Args:
        run: folder or name; None: the only one that trains.
        redis_url: the Redis that it uses; None: the one inside its folder.

    Raises:
        TaskschemaError: if there is no such run, it does not train, or more than one could be meant.

    """
    if redis_url is not None:
        records = RunRecords(connect(redis_url))
        return records, _only(records.runs() if run is None else [_known(run, records.runs())])
    folders = [find_run(run).path] if run is not None else known_runs()
    servers = {folder.resolve().name: _embedded(folder) for folder in folders}
    found = {name: records for name, records in servers.items() if records is not None}
    name = _only(list(found))
    return found[name], name


def _embedded(folder: Path) -> RunRecords | None:
    """Return the records in a run's own Redis, if that runs."""
    try:
        lines = (folder / "redis" / "redis.conf").read_text(encoding="utf-8").splitlines()
    except FileNotFoundError:
        return None
    except OSError as error:
        raise RunFolderError(f"The Redis of {folder} belongs to another user: {error.strerror}.") from None
    settings = dict(line.split(" ", 1) for line in lines if " " in line)
    try:
        return RunRecords(connect(f"redis://:{settings['requirepass']}@127.0.0.1:{settings['port']}"))
    except (BusError, KeyError):  # left behind by a run that is over
        return None


def _known(run: str, names: list[str]) -> str:
    name = run_name(run)
    if name not in names:
        raise UnknownNameError("run", name, names)
    return name


def _only(names: list[str]) -> str:
    if len(names) == 1:
        return names[0]
    if not names:
        raise ConfigError("No run trains here: start one with `taskschema train`, or name its --redis.")
    raise ConfigError(f"Say which run with --run: {', '.join(names)}.")
