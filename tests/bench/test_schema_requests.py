"""How the clients of the bench of `GET /schema` read answers."""

import socket
import threading
import time

import pytest
from bench.schema_requests import _read_answer


def answered(*pieces: bytes) -> None:
    """Read an answer that arrives in these pieces, one after the other."""
    here, there = socket.socketpair()
    here.settimeout(10)

    def send() -> None:
        with there:
            for piece in pieces:
                there.sendall(piece)
                time.sleep(0.02)

    thread = threading.Thread(target=send)
    thread.start()
    try:
        with here:
            _read_answer(here)
            assert here.recv(1) == b""  # nothing is left of it
    finally:
        thread.join()


@pytest.mark.parametrize("cut", [4, 16, 30, 34, 37, 38, 40, 42])
def test_an_answer_is_read_whole_wherever_it_is_cut(cut):
    answer = b"HTTP/1.1 200 OK\r\nContent-Length: 5\r\n\r\n12345"
    answered(answer[:cut], answer[cut:])


def test_what_is_not_200_is_an_error():
    with pytest.raises(RuntimeError, match="503"):
        answered(b"HTTP/1.1 503 Service Unavailable\r\nContent-Length: 0\r\n\r\n")


@pytest.mark.parametrize("sent", [b"HTTP/1.1 200 OK\r\n", b"HTTP/1.1 200 OK\r\nContent-Length: 5\r\n\r\n12"])
def test_a_connection_that_closes_early_is_an_error(sent):
    with pytest.raises(ConnectionError, match="closed"):
        answered(sent)
