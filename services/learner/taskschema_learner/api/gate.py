"""Refusing what `Access` does not allow, and what comes too often, before anything else looks at it."""

from limits import RateLimitItem
from limits.aio.storage import MemoryStorage
from limits.aio.strategies import FixedWindowRateLimiter
from starlette.datastructures import Headers
from starlette.responses import JSONResponse
from starlette.types import ASGIApp, Receive, Scope, Send

from taskschema_learner.api.access import Access, bearer_token
from taskschema_learner.api.rates import Rates
from taskschema_learner.api.scopes import Need
from taskschema_learner.api.tokens import TOKEN_VARIABLE

NO_TOKEN = (
    "This needs the API's token: send the header 'Authorization: Bearer TOKEN' "
    f"(it is printed at start, or set in {TOKEN_VARIABLE})."
)
CHALLENGE = {"WWW-Authenticate": 'Bearer realm="taskschema"'}


class Gate:
    """Answers 401 and 403 to requests without the token that they need, 429 to those that come too often."""

    def __init__(self, app: ASGIApp, access: Access, rates: Rates) -> None:
        self._app = app
        self._access = access
        self._rates = rates
        self._limiter = FixedWindowRateLimiter(MemoryStorage())

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on, or refuse it."""
        refusal = await self._refusal(scope) if scope["type"] == "http" else None
        await (refusal or self._app)(scope, receive, send)

    async def _refusal(self, scope: Scope) -> JSONResponse | None:
        client = scope["client"][0] if scope.get("client") else ""
        need = self._access.need(scope["method"], scope["path"])
        if not await self._limiter.hit(self._rates.requests, "requests", client):
            return _too_often(self._rates.requests, "requests")
        if not need:
            return None
        if not await self._limiter.test(self._rates.failures, "failures", client):
            return _too_often(self._rates.failures, "wrong tokens")
        authorization = Headers(scope=scope).get("authorization")
        status = self._access.status(need, authorization)
        if status == 200:
            changes = "read" not in need
            if changes and not await self._limiter.hit(self._rates.changes, "changes", client):
                return _too_often(self._rates.changes, "changes")
            return None
        if status == 401 and bearer_token(authorization):
            await self._limiter.hit(self._rates.failures, "failures", client)
        return _refused(status, need)


def _too_often(limit: RateLimitItem, what: str) -> JSONResponse:
    line = f"This address sent more than {limit.amount} {what} in {limit.get_expiry()} s: wait and try again."
    headers = {"Retry-After": str(limit.get_expiry())}
    return JSONResponse({"detail": line}, status_code=429, headers=headers)


def _refused(status: int, need: Need) -> JSONResponse:
    if status == 401:
        return JSONResponse({"detail": NO_TOKEN}, status_code=401, headers=CHALLENGE)
    scopes = " or ".join(sorted(need))
    line = f"This token may not do that: it needs the scope {scopes}. Make one with `taskschema token`."
    return JSONResponse({"detail": line}, status_code=403)
