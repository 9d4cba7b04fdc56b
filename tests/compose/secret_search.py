"""Looking for known texts in archives, such as those of images: into layers, compressed or not."""

import gzip
import io
import tarfile
from collections.abc import Iterable
from typing import IO

CHUNK_BYTES = 1 << 22
GZIP_MAGIC = b"\x1f\x8b"


def found_in_archive(archive: IO[bytes], texts: Iterable[str]) -> set[str]:
    """Return which of the texts stand in a file of a tar archive, or in a file of an archive in it.

    An archive inside is searched as it lies there, which finds what its files hold, or unpacked if it is
    compressed by gzip, as layers of an image may be.

    Args:
        archive: read once, from its beginning to its end; need not be seekable.
        texts: of ASCII.

    """
    missing = {text.encode() for text in texts}
    found: set[bytes] = set()
    with tarfile.open(fileobj=archive, mode="r|", bufsize=1 << 20) as members:
        for member in members:
            content = members.extractfile(member) if member.isfile() else None
            if content is not None:
                found |= _found(_unpacked(io.BufferedReader(content)), missing - found)
    while archive.read(CHUNK_BYTES):
        pass  # padding: who writes the archive is not to see its reader go
    return {text.decode() for text in found}


def _unpacked(content: io.BufferedReader) -> IO[bytes]:
    if content.peek(len(GZIP_MAGIC)).startswith(GZIP_MAGIC):
        return gzip.GzipFile(fileobj=content)
    return content


def _found(content: IO[bytes], texts: set[bytes]) -> set[bytes]:
    overlap = max(map(len, texts), default=1) - 1
    found: set[bytes] = set()
    tail = b""
    while chunk := content.read(CHUNK_BYTES):
        window = tail + chunk
        found |= {text for text in texts - found if text in window}
        tail = window[-overlap:] if overlap else b""
    return found
