"""What a user's own task file raises, on one line that says where."""

import traceback
from collections.abc import Iterator
from contextlib import contextmanager

from taskschema.errors import TaskFileError, TaskschemaError


@contextmanager
def user_code(file: str, member: str | None = None) -> Iterator[None]:
    """Run a user's code, and make one line with its place of whatever it raises.

    Args:
        file: name that the task file was compiled under.
        member: of the task, which is used; None: the file runs, or makes its task.

    Raises:
        TaskFileError: for any exception, or an attempt to end the program.
    """
    try:
        yield
    except (Exception, SystemExit) as error:
        subject = "" if member is None else f"{member}: "
        raise TaskFileError(f"{_place(file, error)}: {subject}{_reason(error)}") from error


def _place(file: str, error: BaseException) -> str:
    """Return `FILE:LINE` of the innermost line of the file that takes part, or the file alone."""
    if isinstance(error, SyntaxError) and error.filename == file:
        return f"{file}:{error.lineno}"
    lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == file]
    return f"{file}:{lines[-1]}" if lines else file


def _reason(error: BaseException) -> str:
    """Return what is wrong, as one line that ends with a stop."""
    if isinstance(error, TaskschemaError):
        text = str(error)
    else:
        message = error.msg if isinstance(error, SyntaxError) else str(error)
        text = f"{type(error).__name__}: {message}" if message else type(error).__name__
    line = " ".join(text.split()).rstrip(".") + "."
    if isinstance(error, ModuleNotFoundError):
        line += " Install it, or, if it is a file of yours, put it into the task file, which travels alone."
    return line
