"""What the API answers when it cannot answer: one line that says what to do, and the right status."""

from typing import ClassVar

from taskschema.errors import TaskschemaError


class RequestError(TaskschemaError):
    """A request that cannot be answered as it is; `status` is its HTTP status."""

    status: ClassVar[int] = 422
    """422: the request is well-formed but wrong."""


class NotFoundError(RequestError):
    """Something that does not exist; the message says what does."""

    status = 404


class ConflictError(RequestError):
    """A request that the run's state does not allow."""

    status = 409


class BusyError(RequestError):
    """A limit of the server that is reached for now."""

    status = 503
