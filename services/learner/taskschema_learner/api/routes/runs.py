"""Runs: which there are, how they do, and requests to them."""

from typing import Annotated, Any

import msgspec
from fastapi import APIRouter, Query, Response

from taskschema.bus.records import Request
from taskschema_learner.api.models import (
    LARGEST_INTEGER,
    Curve,
    RequestAnswer,
    RunAnswer,
    RunList,
    RunSummary,
)
from taskschema_learner.api.routes.answers import CONFLICT, UNKNOWN
from taskschema_learner.api.source import RunSource
from taskschema_learner.api.state import State

router = APIRouter(prefix="/runs", tags=["runs"])


def json_answer(content: Any) -> Response:  # noqa: ANN401 - whatever msgspec encodes
    """Return structures as JSON; numbers that are not finite become null."""
    return Response(msgspec.json.encode(content), media_type="application/json")


def _summary(source: RunSource, run: str) -> RunSummary:
    config, status = source.config(run), source.status(run)
    return RunSummary(
        run=run,
        task=config.task,
        policy=config.policy,
        seed=config.seed,
        state=status.state,
        version=status.version,
        updated_at=status.updated_at,
    )


@router.get("")
def list_runs(state: State) -> RunList:
    """Return all runs with what they are doing."""
    return RunList(runs=[_summary(state.source, run) for run in state.source.runs()])


@router.get("/{run}", response_model=RunAnswer, responses=UNKNOWN)
def run_details(run: str, state: State) -> Response:
    """Return a run's config, status and newest round."""
    source = state.source
    config = source.config(run)
    return json_answer(
        {
            "run": run,
            "config": config,
            "config_hash": config.config_hash,
            "status": source.status(run),
            "latest": source.latest(run),
            "worker_target": source.worker_target(run),
            "workers": len(source.workers(run)),
        }
    )


@router.get("/{run}/curve", response_model=Curve, responses=UNKNOWN)
def curve(
    run: str,
    state: State,
    since: Annotated[int, Query(ge=0, le=LARGEST_INTEGER, description="First round wanted.")] = 0,
) -> Response:
    """Return the learning curve: one row per round, oldest first."""
    return json_answer({"run": run, "rounds": state.source.curve(run, since)})


def _ask(state: State, run: str, request: Request) -> RequestAnswer:
    before = state.source.status(run).state
    state.source.request(run, request)
    return RequestAnswer(run=run, requested=request, state=before)


@router.post("/{run}/pause", status_code=202, responses={**UNKNOWN, **CONFLICT})
def pause(run: str, state: State) -> RequestAnswer:
    """Ask a run to pause after the round it is in."""
    return _ask(state, run, "pause")


@router.post("/{run}/resume", status_code=202, responses={**UNKNOWN, **CONFLICT})
def resume(run: str, state: State) -> RequestAnswer:
    """Ask a paused run to go on."""
    return _ask(state, run, "resume")


@router.post("/{run}/stop", status_code=202, responses={**UNKNOWN, **CONFLICT})
def stop(run: str, state: State) -> RequestAnswer:
    """Ask a run to stop; it stays resumable with `taskschema train --resume`."""
    return _ask(state, run, "stop")
