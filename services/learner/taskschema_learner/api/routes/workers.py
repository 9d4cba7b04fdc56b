"""The workers of a run, and how many are wanted."""

from fastapi import APIRouter, Response

from taskschema_learner.api.models import Workers, WorkerTarget
from taskschema_learner.api.routes.answers import CONFLICT, UNKNOWN
from taskschema_learner.api.routes.runs import json_answer
from taskschema_learner.api.source import RunSource
from taskschema_learner.api.state import RunName, State

router = APIRouter(tags=["workers"])


def _workers(source: RunSource, run: str) -> Response:
    live = source.workers(run)
    return json_answer({"run": run, "target": source.worker_target(run), "live": len(live), "workers": live})


@router.get("/workers", response_model=Workers, responses=UNKNOWN)
def workers(state: State, run: RunName) -> Response:
    """Return the workers that are alive, and how many are wanted."""
    return _workers(state.source, run)


@router.put("/workers", response_model=Workers, responses={**UNKNOWN, **CONFLICT})
def set_workers(body: WorkerTarget, state: State, run: RunName) -> Response:
    """Ask for a number of workers; the pool follows within about a second, up to its capacity."""
    state.source.set_worker_target(run, body.target)
    return _workers(state.source, run)
