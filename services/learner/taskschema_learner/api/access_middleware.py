"""Refusing what `Access` does not allow, before anything else looks at the request."""

from starlette.datastructures import Headers
from starlette.responses import JSONResponse
from starlette.types import ASGIApp, Receive, Scope, Send

from taskschema_learner.api.access import TOKEN_VARIABLE, Access


class AccessMiddleware:
    """Answers 401 to requests that need the token and do not carry it."""

    def __init__(self, app: ASGIApp, access: Access) -> None:
        self._app = app
        self._access = access

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on, or refuse it."""
        guarded = scope["type"] == "http" and self._access.needs_token(scope["method"], scope["path"])
        if guarded and not self._access.accepts(Headers(scope=scope).get("authorization")):
            await self._refusal()(scope, receive, send)
        else:
            await self._app(scope, receive, send)

    @staticmethod
    def _refusal() -> JSONResponse:
        line = (
            "This needs the API's token: send the header 'Authorization: Bearer TOKEN' "
            f"(it is printed at start, or set in {TOKEN_VARIABLE})."
        )
        return JSONResponse(
            {"detail": line}, status_code=401, headers={"WWW-Authenticate": 'Bearer realm="taskschema"'}
        )
