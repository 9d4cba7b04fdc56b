"""Where the API listens."""

import errno
import ipaddress
import socket
from dataclasses import dataclass, replace

from taskschema.errors import ConfigError

DEFAULT_HOST = "127.0.0.1"
DEFAULT_PORT = 8420


@dataclass(frozen=True)
class Address:
    """A host and a TCP port; port 0 stands for any free one."""

    host: str = DEFAULT_HOST
    port: int = DEFAULT_PORT

    @classmethod
    def parse(cls, text: str) -> "Address":
        """Parse `HOST:PORT`, `[IPV6]:PORT` or `:PORT` (loopback).

        Raises:
            ConfigError: if it is none of these.
        """
        host, separator, port = text.rpartition(":")
        bracketed = host.startswith("[") and host.endswith("]")
        plain = host[1:-1] if bracketed else host
        is_port = port.isascii() and port.isdigit() and int(port) <= 65535
        if not separator or not is_port or (":" in plain) != bracketed:
            raise ConfigError(
                f"An address is HOST:PORT with a port from 0 to 65535, such as 127.0.0.1:8420; got {text!r}."
            )
        return cls(plain or DEFAULT_HOST, int(port))

    @property
    def is_loopback(self) -> bool:
        """Whether only this machine can reach it."""
        try:
            return ipaddress.ip_address(self.host).is_loopback
        except ValueError:
            return self.host == "localhost"

    def url(self, *, tls: bool = False) -> str:
        """Return `http://HOST:PORT` or `https://HOST:PORT`, without a slash at the end."""
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"{'https' if tls else 'http'}://{host}:{self.port}"

    @property
    def reachable_host(self) -> str:
        """The host to connect to from this machine: the loopback address where all are listened on."""
        return {"0.0.0.0": "127.0.0.1", "::": "::1"}.get(self.host, self.host)

    def bound_to(self, listener: socket.socket) -> "Address":
        """Return the address with the port that a listener really has."""
        return replace(self, port=listener.getsockname()[1])

    def listen(self) -> socket.socket:
        """Open a listening socket here.

        Raises:
            ConfigError: if the port is taken, or the host is not this machine's.
        """
        family = socket.AF_INET6 if ":" in self.host else socket.AF_INET
        listener = socket.socket(family, socket.SOCK_STREAM)
        try:
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            listener.bind((self.host, self.port))
            listener.listen(128)
        except OSError as error:
            listener.close()
            raise ConfigError(self._explain(error)) from None
        return listener

    def _explain(self, error: OSError) -> str:
        if error.errno == errno.EADDRINUSE:
            return (
                f"Port {self.port} on {self.host} is in use: stop what listens there, "
                "or choose another port (0 takes any free one)."
            )
        if error.errno == errno.EACCES:
            return f"Port {self.port} on {self.host} needs privileges: choose one above 1023."
        return f"The API cannot listen on {self.host}:{self.port}: {error.strerror}. Choose another host."
