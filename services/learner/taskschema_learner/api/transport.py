"""TLS of the API."""

import ssl
from dataclasses import dataclass
from pathlib import Path

from taskschema.errors import ConfigError


@dataclass(frozen=True)
class Tls:
    """A certificate, with those between it and its CA, and its key, as PEM files.

    Raises:
        ConfigError: if they cannot be read, or do not belong together.
    """

    certificate: Path
    key: Path

    def __post_init__(self) -> None:
        for path in (self.certificate, self.key):
            try:
                path.read_bytes()
            except OSError as error:
                raise ConfigError(f"{path} cannot be read for TLS: {error.strerror}.") from None
        try:
            # A key that needs a password would make the server ask for it in a terminal.
            ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER).load_cert_chain(
                self.certificate, self.key, password=lambda: b""
            )
        except (ssl.SSLError, ValueError):
            raise ConfigError(
                f"{self.certificate} and {self.key} are no certificate and its key: give both as PEM, "
                "the key without a password."
            ) from None

    @classmethod
    def of(cls, certificate: Path | None, key: Path | None) -> "Tls | None":
        """Return TLS with these files; None for none.

        Raises:
            ConfigError: if only one is given, or they cannot be used.
        """
        if certificate is None and key is None:
            return None
        if certificate is None or key is None:
            raise ConfigError("TLS needs both files: --api-tls-cert and --api-tls-key.")
        return cls(certificate, key)
