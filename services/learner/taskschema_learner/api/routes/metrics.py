"""Metrics for Prometheus."""

from fastapi import APIRouter, Response
from prometheus_client import CONTENT_TYPE_LATEST

from taskschema_learner.api.exposition import exposition
from taskschema_learner.api.routes.answers import Responses
from taskschema_learner.api.state import State

router = APIRouter(tags=["health"])

_TEXT: Responses = {200: {"content": {"text/plain": {"schema": {"type": "string"}}}}}


@router.get("/metrics", response_class=Response, responses=_TEXT)
def metrics(state: State) -> Response:
    """Return all runs' metrics in Prometheus' text format."""
    return Response(exposition(state.source), headers={"Content-Type": CONTENT_TYPE_LATEST})
