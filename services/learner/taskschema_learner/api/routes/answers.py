"""Descriptions of answers that several endpoints share."""

from typing import Any

from fastapi import Request, Response

from taskschema_learner.api.models import Problem

Responses = dict[int | str, dict[str, Any]]

UNKNOWN: Responses = {404: {"model": Problem, "description": "No such run, or nothing of it yet."}}
CONFLICT: Responses = {409: {"model": Problem, "description": "The run's state does not allow it."}}
NOT_MODIFIED: Responses = {304: {"description": "Unchanged since the ETag that was sent."}}


def tagged(
    request: Request, data: bytes, etag: str, media_type: str, headers: dict[str, str] | None = None
) -> Response:
    """Return bytes with their entity tag, or 304 if the client holds them already."""
    sent = {"ETag": etag, "Cache-Control": "no-cache", **(headers or {})}
    held = request.headers.get("if-none-match", "")
    if held and (held.strip() == "*" or etag in _tags(held)):
        return Response(status_code=304, headers=sent)
    return Response(data, media_type=media_type, headers=sent)


def _tags(header: str) -> set[str]:
    """Return the tags of an If-None-Match header, weak ones as strong (RFC 9110, section 13.1.2)."""
    return {tag.strip().removeprefix("W/") for tag in header.split(",")}
