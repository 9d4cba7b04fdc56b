"""Refusing what `Access` does not allow, before anything else looks at the request."""

from starlette.datastructures import Headers
from starlette.responses import JSONResponse
from starlette.types import ASGIApp, Receive, Scope, Send

from taskschema_learner.api.access import TOKEN_VARIABLE, Access


class Gate:
    """Answers 401 to requests that need the token and do not carry it."""

    def __init__(self, app: ASGIApp, access: Access) -> None:
        self._app = app
        self._access = access

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on, or refuse it."""
        refusal = self._refusal(scope) if scope["type"] == "http" else None
        await (refusal or self._app)(scope, receive, send)

    def _refusal(self, scope: Scope) -> JSONResponse | None:
        if not self._access.needs_token(scope["method"], scope["path"]):
            return None
        if self._access.accepts(Headers(scope=scope).get("authorization")):
            return None
        line = (
            "This needs the API's token: send the header 'Authorization: Bearer TOKEN' "
            f"(it is printed at start, or set in {TOKEN_VARIABLE})."
        )
        challenge = {"WWW-Authenticate": 'Bearer realm="taskschema"'}
        return JSONResponse({"detail": line}, status_code=401, headers=challenge)
