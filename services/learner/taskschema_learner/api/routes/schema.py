"""The task schema."""

from typing import Annotated

from fastapi import APIRouter, Query, Request, Response
from starlette.concurrency import run_in_threadpool

from taskschema_learner.api.models import LARGEST_INTEGER, SchemaAnswer
from taskschema_learner.api.routes.answers import NOT_MODIFIED, UNKNOWN, tagged
from taskschema_learner.api.state import RunName, State, TaggedBytes

router = APIRouter(tags=["schema"])

Version = Annotated[
    int | None, Query(ge=0, le=LARGEST_INTEGER, description="Policy version; left out: the newest.")
]


@router.get("/schema", response_model=SchemaAnswer, responses={**UNKNOWN, **NOT_MODIFIED})
async def schema(request: Request, state: State, run: RunName, version: Version = None) -> Response:
    """Return the task schema: which skill each arm runs at each step, with probabilities and logits.

    The newest one is at most a quarter of a second old, under load 50 ms. Rows after the step at which
    episodes succeed are not trained towards anything: `best` marks them as not used.
    """
    if version is None:
        newest = await state.schemas.get(run)
    else:
        newest = TaggedBytes.of(await run_in_threadpool(state.source.schema, run, version))
    return tagged(request, newest.data, newest.etag, "application/json")
