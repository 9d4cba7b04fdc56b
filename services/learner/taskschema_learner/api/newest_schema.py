"""Answering the request that comes most often before routes and dependencies are looked up for it."""

from starlette.requests import Request
from starlette.types import ASGIApp, Receive, Scope, Send

from taskschema_learner.api.routes.answers import tagged
from taskschema_learner.api.state import ApiState


class NewestSchema:
    """Answers `GET /schema` with what the route keeps ready for its next few milliseconds.

    Everything else goes on to the route: another version or run, and a schema that has to be read first.
    It stands behind `Gate`, so tokens and limits hold.
    """

    def __init__(self, app: ASGIApp, state: ApiState) -> None:
        self._app = app
        self._state = state

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer, or pass the request on."""
        run = self._state.default_run
        if run is not None and _asks_for_newest(scope):
            newest = self._state.schemas.fresh(run)
            if newest is not None:
                answer = tagged(Request(scope), newest.data, newest.etag, "application/json")
                await answer(scope, receive, send)
                return
        await self._app(scope, receive, send)


def _asks_for_newest(scope: Scope) -> bool:
    is_get = scope["type"] == "http" and scope["method"] == "GET"
    return is_get and scope["path"] == "/schema" and not scope["query_string"]
