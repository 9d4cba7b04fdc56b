"""Liveness and readiness, and the way to the documentation."""

from fastapi import APIRouter
from starlette.responses import RedirectResponse

from taskschema_learner.api.models import Health
from taskschema_learner.api.state import State

router = APIRouter(tags=["health"])


@router.get("/", include_in_schema=False)
async def root() -> RedirectResponse:
    """Lead to the documentation."""
    return RedirectResponse("/docs")


@router.get("/healthz")
async def healthz() -> Health:
    """Tell that the API runs; needs neither Redis nor a token."""
    return Health(status="ok")


@router.get("/readyz")
def readyz(state: State) -> Health:
    """Tell that the API can read runs; 503 while Redis cannot be reached."""
    state.source.ping()
    return Health(status="ready")
