"""What the routes share while the API runs, and how they get at it."""

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Annotated

from fastapi import Depends, Query, Request
from starlette.concurrency import run_in_threadpool

from taskschema.bus.records import PublishedPolicy
from taskschema_learner.api.acting import Actors
from taskschema_learner.api.problems import NotFoundError, RequestError
from taskschema_learner.api.recent import Recent
from taskschema_learner.api.source import RunSource

FRESH_SECONDS = 0.05
"""Schema and policy older than this are read again [s]."""
USABLE_SECONDS = 0.25
"""Schema and policy up to this age are answered while newer ones are read [s]."""


@dataclass(frozen=True)
class TaggedBytes:
    """An answer that is ready to be sent, and its entity tag."""

    data: bytes
    etag: str

    @classmethod
    def of(cls, data: bytes) -> "TaggedBytes":
        """Return the bytes with a tag made from their content."""
        return cls(data, f'"{hashlib.sha256(data).hexdigest()[:32]}"')


def _never() -> bool:
    return False


@dataclass
class ApiState:
    """The source, the caches before it, and the run that is meant when none is named."""

    source: RunSource
    default_run: str | None = None
    closing: Callable[[], bool] = _never
    """Whether the server is stopping: event streams then end."""
    streams: int = 0
    """Event streams that are open."""
    schemas: Recent[TaggedBytes] = field(init=False)
    policies: Recent[PublishedPolicy] = field(init=False)
    actors: Actors = field(init=False)

    def __post_init__(self) -> None:
        ages = {"fresh": FRESH_SECONDS, "usable": USABLE_SECONDS}
        self.schemas = Recent(lambda run: TaggedBytes.of(self.source.schema(run)), **ages)
        self.policies = Recent(self.source.policy, **ages)
        self.actors = Actors(self.source.config)


async def _state(request: Request) -> ApiState:
    state: ApiState = request.app.state.api
    return state


State = Annotated[ApiState, Depends(_state)]


async def _run_name(
    state: State,
    run: Annotated[
        str | None, Query(description="Name of the run; needed only where several runs are served.")
    ] = None,
) -> str:
    """Return the run that a request is about; async, because /schema goes through here very often."""
    if run is not None:
        return run
    if state.default_run is not None:
        return state.default_run
    runs = await run_in_threadpool(state.source.runs)
    if not runs:
        raise NotFoundError("There is no run yet: start one with `taskschema train TASK`.")
    if len(runs) > 1:
        raise RequestError(f"Several runs are served: add ?run=NAME. Valid: {', '.join(runs)}.")
    return runs[0]


RunName = Annotated[str, Depends(_run_name)]
