"""The OpenAPI description, with what each request needs from the table of needs."""

from collections.abc import Callable
from typing import Any

from fastapi import FastAPI

from taskschema_learner.api.access import Access
from taskschema_learner.api.scopes import NEEDS

SCHEME = "token"
_PROBLEM = {"application/json": {"schema": {"$ref": "#/components/schemas/Problem"}}}
_REFUSALS = {
    "401": "The token is missing, unknown, or has ended.",
    "403": "The token's scopes do not allow this.",
    "429": "This address asks too often; try again after `Retry-After` seconds.",
}


def describe_needs(app: FastAPI, access: Access) -> Callable[[], dict[str, Any]]:
    """Return what makes an application's description: each operation says which scopes it needs."""
    plain = app.openapi

    def described() -> dict[str, Any]:
        description = plain()
        schemes = description.setdefault("components", {}).setdefault("securitySchemes", {})
        if SCHEME in schemes:
            return description
        schemes[SCHEME] = {
            "type": "http",
            "scheme": "bearer",
            "description": "The API's token, printed at start, or one made by `taskschema token`.",
        }
        for path, operations in description["paths"].items():
            for method, operation in operations.items():
                _mark(operation, method.upper(), path, access)
        return description

    return described


def _mark(operation: dict[str, Any], method: str, path: str, access: Access) -> None:
    operation["x-scopes"] = sorted(NEEDS[method, path])
    statuses = ["429"]
    if access.need(method, path):
        operation["security"] = [{SCHEME: []}]
        statuses += ["401", "403"]
    for status in statuses:
        answer = {"description": _REFUSALS[status], "content": _PROBLEM}
        operation["responses"].setdefault(status, answer)
