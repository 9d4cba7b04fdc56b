"""Rounds and changes of state as they happen (server-sent events)."""

import asyncio
from collections.abc import AsyncIterator
from typing import Annotated

import msgspec
from fastapi import APIRouter, Depends, Header, Query
from fastapi.sse import EventSourceResponse, ServerSentEvent
from starlette.concurrency import run_in_threadpool

from taskschema.bus.records import FIRST_EVENT
from taskschema.bus.run_status import RunStatus
from taskschema.errors import TaskschemaError
from taskschema.metrics import RoundMetrics
from taskschema_learner.api.problems import BusyError
from taskschema_learner.api.routes.answers import UNKNOWN
from taskschema_learner.api.source import RunSource
from taskschema_learner.api.state import RunName, State

router = APIRouter(tags=["events"])

MAX_STREAMS = 64
"""Event streams that are served at the same time."""
INTERVAL = 0.2
"""Time between two looks for news [s]; a round takes seconds."""

EventId = Annotated[
    str | None,
    Header(
        alias="Last-Event-ID",
        pattern=r"^[0-9]{1,15}-[0-9]{1,15}$",
        description="The last event received: the stream goes on after it.",
    ),
]


async def _start(
    state: State,
    run: RunName,
    last_event_id: EventId = None,
    replay: Annotated[bool, Query(description="Send all rounds so far first.")] = False,
) -> str:
    """Return the place after which the stream starts; fails before the stream does."""
    if state.streams >= MAX_STREAMS:
        raise BusyError(f"{MAX_STREAMS} event streams are open already: close one, or poll the curve.")
    last = await run_in_threadpool(state.source.last_event, run)
    if last_event_id is not None:
        return last_event_id
    return FIRST_EVENT if replay else last


@router.get("/events", response_class=EventSourceResponse, responses=UNKNOWN)
async def events(
    state: State, run: RunName, start: Annotated[str, Depends(_start)]
) -> AsyncIterator[ServerSentEvent]:
    """Send `round` events (a row of the curve) and `status` events (whenever the state changes).

    Starts with the present status. A client that reconnects with Last-Event-ID misses no round.
    """
    state.streams += 1
    try:
        async for event in _follow(state, run, start):
            yield event
    except TaskschemaError as error:
        yield ServerSentEvent(event="problem", raw_data=msgspec.json.encode({"detail": str(error)}).decode())
    finally:
        state.streams -= 1


async def _follow(state: State, run: str, after: str) -> AsyncIterator[ServerSentEvent]:
    shown = ""
    while not state.closing():
        status, rounds = await run_in_threadpool(_news, state.source, run, after)
        for place, row in rounds:
            after = place
            yield ServerSentEvent(event="round", id=place, raw_data=_json(row))
        if status.state != shown:
            shown = status.state
            yield ServerSentEvent(event="status", raw_data=_json(status))
        await asyncio.sleep(INTERVAL)


def _news(source: RunSource, run: str, after: str) -> tuple[RunStatus, list[tuple[str, RoundMetrics]]]:
    # The status is read first: when it says "finished", the last round is among the events.
    status = source.status(run)
    return status, list(source.events(run, after))


def _json(struct: msgspec.Struct) -> str:
    return msgspec.json.encode(struct).decode()
