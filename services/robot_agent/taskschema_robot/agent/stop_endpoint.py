"""A stop over HTTP, on this machine only: for a button on a screen. Not safety rated."""

import threading
from collections.abc import Callable
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

WORDS = b"Both arms are told to stop. This is not a safety-rated stop: use the emergency stop buttons.\n"
HELP = b"POST /stop stops both arms. It is not a safety-rated stop: use the emergency stop buttons.\n"


class StopEndpoint:
    """Listens on loopback until closed. A context manager.

    Args:
        stop: called for `POST /stop`, in a thread of its own.
        port: to listen on; 0: a free one.

    """

    def __init__(self, stop: Callable[[str], None], port: int) -> None:
        class Handler(BaseHTTPRequestHandler):
            def do_POST(self) -> None:  # noqa: N802 - the library's name
                if self.path != "/stop":
                    self._answer(404, HELP)
                    return
                stop("the stop endpoint")
                self._answer(200, WORDS)

            def do_GET(self) -> None:  # noqa: N802
                self._answer(200 if self.path == "/" else 404, HELP)

            def _answer(self, status: int, body: bytes) -> None:
                self.send_response(status)
                self.send_header("Content-Type", "text/plain")
                self.send_header("Content-Length", str(len(body)))
                self.end_headers()
                self.wfile.write(body)

            def log_message(self, format: str, *args: object) -> None:  # noqa: A002
                """Leave the terminal to the operator."""

        self._server = ThreadingHTTPServer(("127.0.0.1", port), Handler)
        self._thread = threading.Thread(target=self._server.serve_forever, name="stop-endpoint", daemon=True)

    @property
    def url(self) -> str:
        """Where it listens."""
        return f"http://127.0.0.1:{self._server.server_address[1]}/stop"

    def __enter__(self) -> "StopEndpoint":
        self._thread.start()
        return self

    def __exit__(self, *unused: object) -> None:
        self._server.shutdown()
        self._server.server_close()
        self._thread.join(2.0)
