"""`make compose-test` looks for secrets in images: that it would find one."""

import gzip
import io
import tarfile

import pytest
from tests.compose import secret_search
from tests.compose.secret_search import found_in_archive

SECRET, ABSENT = "5ec2e7" * 8, "0ab5e7" * 8


def archive(name: str, content: bytes) -> bytes:
    stream = io.BytesIO()
    with tarfile.open(fileobj=stream, mode="w") as members:
        folder = tarfile.TarInfo("folder")
        folder.type = tarfile.DIRTYPE
        members.addfile(folder)
        entry = tarfile.TarInfo(name)
        entry.size = len(content)
        members.addfile(entry, io.BytesIO(content))
    return stream.getvalue()


@pytest.mark.parametrize("packed", [False, True], ids=["plain layer", "compressed layer"])
@pytest.mark.parametrize("place", [0, 90, 100, 199])
def test_a_secret_in_a_file_of_a_layer_is_found(monkeypatch, packed: bool, place: int) -> None:
    monkeypatch.setattr(secret_search, "CHUNK_BYTES", 100)  # the secret lies across the borders of some
    layer = archive("etc/settings", b"x" * place + SECRET.encode() + b"y" * 300)
    image = archive("layer.tar", gzip.compress(layer) if packed else layer)
    assert found_in_archive(io.BytesIO(image), [SECRET, ABSENT]) == {SECRET}


def test_nothing_is_found_where_nothing_is() -> None:
    assert found_in_archive(io.BytesIO(archive("file", b"")), [SECRET]) == set()
