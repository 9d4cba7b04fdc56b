"""Running the API: in this process until it is told to stop."""

import socket

import uvicorn

from taskschema_learner.api.access import Access
from taskschema_learner.api.app import build_app
from taskschema_learner.api.source import RunSource


def serve(source: RunSource, access: Access, listener: socket.socket, default_run: str | None = None) -> None:
    """Serve until SIGINT or SIGTERM, then let running requests end and return.

    Args:
        source: where runs are kept.
        access: address and token.
        listener: `access.address.listen()`, opened by the caller, who can so tell the port before.
        default_run: the run that is meant where a request names none.
    """
    app = build_app(source, access, default_run)
    config = uvicorn.Config(
        app, log_level="warning", access_log=False, server_header=False, timeout_graceful_shutdown=3
    )
    server = uvicorn.Server(config)
    app.state.api.closing = lambda: server.should_exit
    server.run(sockets=[listener])
