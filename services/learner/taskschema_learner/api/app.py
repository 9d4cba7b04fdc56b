"""The FastAPI application: routes, rules of access, and one line for whatever goes wrong."""

import json
import logging
from collections.abc import Sequence
from typing import Any

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi_offline import FastAPIOffline
from starlette.exceptions import HTTPException
from starlette.middleware.trustedhost import TrustedHostMiddleware
from starlette.responses import JSONResponse

from taskschema import __version__
from taskschema.errors import BusError, RunFolderError, TaskschemaError, WireError
from taskschema_learner.api.access import Access
from taskschema_learner.api.description import describe_needs
from taskschema_learner.api.gate import Gate
from taskschema_learner.api.models import Problem
from taskschema_learner.api.newest_schema import NewestSchema
from taskschema_learner.api.problems import RequestError
from taskschema_learner.api.rates import Rates
from taskschema_learner.api.routes import ROUTERS
from taskschema_learner.api.scopes import methods_of
from taskschema_learner.api.source import RunSource
from taskschema_learner.api.state import ApiState

log = logging.getLogger("taskschema.api")

MAX_BODY_BYTES = 288 * 1024
"""Largest request body; a state observation has a few kilobytes."""
RETRY_AFTER = {"Retry-After": "2"}

_DESCRIPTION = """\
The task schema, the policy and the progress of training runs (Chitnis et al., ICRA 2020).

Whatever changes something needs the token that is printed at start, or one made by `taskschema token`: press
*Authorize*. Every error is
`{"detail": "one line that says what to do"}`.
"""
_TAGS = [
    {"name": "schema", "description": "Which skill each arm runs at each step."},
    {"name": "policy", "description": "Weights, what they mean, and acting with them."},
    {"name": "runs", "description": "Training runs, their curves, and requests to them."},
    {"name": "workers", "description": "Who collects episodes, and how many of them."},
    {"name": "events", "description": "Rounds as they happen."},
    {"name": "health", "description": "For probes and Prometheus."},
]


def build_app(
    source: RunSource, access: Access, default_run: str | None = None, rates: Rates | None = None
) -> FastAPI:
    """Return the application for a source.

    Args:
        source: where runs are kept.
        access: address and tokens.
        default_run: the run that is meant where a request names none.
        rates: how often an address may ask; None: what the environment says.

    """
    app = FastAPIOffline(
        title="taskschema",
        version=__version__,
        description=_DESCRIPTION,
        openapi_tags=_TAGS,
        redoc_url=None,
        static_url="/docs/static",
        max_body_size=MAX_BODY_BYTES,
        responses={
            400: {"description": "The body is no JSON, or the Host header is a foreign one."},
            413: {"description": f"The body is larger than {MAX_BODY_BYTES} bytes."},
            422: {"model": Problem, "description": "Something about the request is wrong."},
            503: {"model": Problem, "description": "Redis cannot be reached; try again."},
        },
    )
    app.state.api = ApiState(source, default_run)
    for router in ROUTERS:
        app.include_router(router)
    app.openapi = describe_needs(app, access)  # type: ignore[method-assign]
    app.add_exception_handler(TaskschemaError, _on_taskschema_error)
    app.add_exception_handler(RequestValidationError, _on_invalid_request)
    app.add_exception_handler(HTTPException, _on_http_error)
    app.add_exception_handler(Exception, _on_bug)
    app.add_middleware(NewestSchema, state=app.state.api)
    app.add_middleware(Gate, access=access, rates=rates or Rates.of())
    app.add_middleware(TrustedHostMiddleware, allowed_hosts=access.hosts, www_redirect=False)
    return app


def _problem(status: int, line: str, headers: dict[str, str] | None = None) -> JSONResponse:
    # ASCII only: what a request sent may hold text that UTF-8 cannot encode.
    return AsciiJSONResponse({"detail": " ".join(line.split())}, status_code=status, headers=headers)


class AsciiJSONResponse(JSONResponse):
    """JSON with everything beyond ASCII escaped."""

    def render(self, content: Any) -> bytes:  # noqa: ANN401 - Starlette's signature
        """Encode."""
        return json.dumps(content).encode("ascii")


async def _on_taskschema_error(request: Request, error: Exception) -> JSONResponse:
    if isinstance(error, RequestError):
        return _problem(error.status, str(error), RETRY_AFTER if error.status == 503 else None)
    if isinstance(error, BusError | RunFolderError | WireError):
        return _problem(503, str(error), RETRY_AFTER)
    assert isinstance(error, TaskschemaError)
    return _problem(409, str(error))


async def _on_invalid_request(request: Request, error: Exception) -> JSONResponse:
    assert isinstance(error, RequestValidationError)
    return _problem(422, _first_line(error.errors()))


def _first_line(errors: Sequence[Any]) -> str:
    """Return the first thing that is wrong, with its place; the value itself is not repeated."""
    first = errors[0]
    place = ".".join(str(part)[:60] for part in first["loc"])
    return f"{place}: {first['msg']}."


async def _on_http_error(request: Request, error: Exception) -> JSONResponse:
    assert isinstance(error, HTTPException)
    line = str(error.detail)
    if error.status_code == 404:
        line = f"There is no {request.url.path[:100]} here: GET /docs lists every path."
    elif error.status_code == 400:
        line = "The request's body is no JSON in UTF-8."
    elif error.status_code == 405:
        line = f"{request.method[:20]} is not possible here: GET /docs lists every path and method."
    headers = dict(error.headers) if error.headers else {}
    if error.status_code == 405 and (methods := methods_of(request.url.path)):
        headers["Allow"] = ", ".join(methods)  # all of the path's: the router knows one route's
    return _problem(error.status_code, line, headers)


async def _on_bug(request: Request, error: Exception) -> JSONResponse:
    log.error("%s %s failed", request.method, request.url.path, exc_info=error)
    return _problem(500, "The API failed to answer; its log says why.")
