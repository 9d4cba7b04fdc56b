"""Running the API: in this process until it is told to stop."""

import socket
from collections.abc import Callable

import uvicorn

from taskschema_learner.api.access import Access
from taskschema_learner.api.app import build_app
from taskschema_learner.api.source import RunSource
from taskschema_learner.api.transport import Tls

MOST_CONNECTIONS = 1_000
"""Connections served at once; more are answered 503."""


def serve(
    source: RunSource,
    access: Access,
    listener: socket.socket,
    default_run: str | None = None,
    tls: Tls | None = None,
    on_start: Callable[[], None] = lambda: None,
) -> None:
    """Serve until SIGINT or SIGTERM, then let running requests end and return.

    Args:
        source: where runs are kept.
        access: address and tokens.
        listener: `access.address.listen()`, opened by the caller, who can so tell the port before.
        default_run: the run that is meant where a request names none.
        tls: certificate and key; None: no TLS.
        on_start: called when requests are answered.

    """
    app = build_app(source, access, default_run)
    config = uvicorn.Config(
        app,
        loop="uvloop",
        http="httptools",
        log_level="warning",
        access_log=False,
        server_header=False,
        proxy_headers=False,  # anybody can claim to be forwarded for somebody else
        limit_concurrency=MOST_CONNECTIONS,
        timeout_graceful_shutdown=3,
        ssl_certfile=None if tls is None else tls.certificate,
        ssl_keyfile=None if tls is None else tls.key,
    )
    server = _Server(config, on_start)
    app.state.api.closing = lambda: server.should_exit
    server.run(sockets=[listener])


class _Server(uvicorn.Server):
    def __init__(self, config: uvicorn.Config, on_start: Callable[[], None]) -> None:
        super().__init__(config)
        self._on_start = on_start

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        await super().startup(sockets)
        self._on_start()
