"""Errors that a user can act on: every message is one line and says what to do."""

import difflib
from collections.abc import Iterable


class TaskschemaError(Exception):
    """Base of all errors whose message is meant for the user; the commands print it and exit with 1."""


class UnknownNameError(TaskschemaError):
    """A name that is not registered; the message lists the valid ones and the nearest match."""

    def __init__(self, kind: str, name: str, valid: Iterable[str]) -> None:
        choices = sorted(valid)
        near = difflib.get_close_matches(name, choices, n=1)
        hint = f" Did you mean {near[0]!r}?" if near else ""
        super().__init__(f"Unknown {kind} {name!r}.{hint} Valid: {', '.join(choices) or 'none'}.")


class ConfigError(TaskschemaError):
    """A configuration value that cannot be used; the message names the field and what it accepts."""


class TaskFileError(TaskschemaError):
    """A user's task file that cannot be loaded."""


class SchemaMismatchError(TaskschemaError):
    """A schema whose horizon or skill pairs are not those of the task."""


class SignatureError(TaskschemaError):
    """A schema that is not signed by whom it must be, or a key that cannot be used."""


class FrameError(TaskschemaError):
    """A picture that cannot come from a working overhead camera."""


class TrunkError(TaskschemaError):
    """Weights of a network's trunk that do not fit or cannot be read."""


class WireError(TaskschemaError):
    """A message from another process that fails its check; the message is the reason."""

    def __init__(self, reason: str, kind: str = "malformed") -> None:
        super().__init__(reason)
        self.kind = kind
        """One of few words, for counting."""


class RunFolderError(TaskschemaError):
    """A run folder that is missing, locked, corrupt, or of another format version or config."""


class BusError(TaskschemaError):
    """A Redis that cannot be reached, is too old, or refuses."""


class StaleTokenError(BusError):
    """Another learner holds a newer fencing token for this run: this one must stop."""


class RayError(TaskschemaError):
    """A Ray that cannot be started or reached."""


class QuarantineLimitError(TaskschemaError):
    """A slot whose results were refused three times."""


class ExperimentError(TaskschemaError):
    """An experiment whose results are damaged, locked, or of other settings."""


class RenderingError(TaskschemaError):
    """Pictures that cannot be drawn or written: no renderer, or nothing to show."""
