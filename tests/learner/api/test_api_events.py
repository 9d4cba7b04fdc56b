import json
import threading
from contextlib import contextmanager

import httpx
import pytest
from api_setup import RUN, metrics, publish

from taskschema_learner.api.process import ApiProcess


@contextmanager
def listening(client, path="/events", **headers):
    """Yield an iterator over (event, id, data) of a stream."""
    with client.stream("GET", path, headers=headers) as answer:
        assert answer.status_code == 200
        assert answer.headers["content-type"].startswith("text/event-stream")
        yield parse(answer.iter_lines())


def parse(lines):
    event = {}
    for line in lines:
        if line:
            name, _, value = line.partition(": ")
            event[name] = value
        elif event.get("data"):
            yield event["event"], event.get("id"), json.loads(event["data"])
            event = {}


def test_a_round_published_after_connecting_arrives(served):
    with listening(served.http) as events:
        kind, _, status = next(events)
        assert (kind, status["state"]) == ("status", "running")
        publish(served.records, RUN, 4)
        kind, place, row = next(events)
        assert (kind, place, row["round"]) == ("round", "4-0", 3)
        assert row["sha256"] == metrics(4).sha256


def test_a_change_of_state_arrives(served):
    with listening(served.http) as events:
        next(events)
        served.records.set_state(RUN, "finished", "reached 90 %")
        kind, _, status = next(events)
        assert (kind, status["state"], status["message"]) == ("status", "finished", "reached 90 %")


def test_whoever_reconnects_misses_nothing(served):
    with listening(served.http, **{"Last-Event-ID": "1-0"}) as events:
        assert [next(events)[1] for _ in range(2)] == ["2-0", "3-0"]


def test_all_rounds_can_be_replayed(served):
    with listening(served.http, "/events?replay=true") as events:
        assert [next(events)[1] for _ in range(3)] == ["1-0", "2-0", "3-0"]


@pytest.mark.parametrize("place", ["x", "1", "1-", "9" * 30 + "-0", "-1-0"])
def test_a_wrong_place_is_refused(served, place):
    assert served.http.get("/events", headers={"Last-Event-ID": place}).status_code == 422


def test_the_server_stops_although_somebody_listens(served, redis_url):
    with ApiProcess(redis_url, RUN, "127.0.0.1:0") as api:
        client = httpx.Client(base_url=api.url, timeout=10)
        stream = client.stream("GET", "/events")
        events = parse(stream.__enter__().iter_lines())
        next(events)
    assert list(events) == []  # ended properly: a stream that is cut raises instead
    stream.__exit__(None, None, None)
    client.close()


def test_streams_are_limited_and_given_back(redis_url, served):
    from taskschema_learner.api.routes.events import MAX_STREAMS

    limits = httpx.Limits(max_connections=MAX_STREAMS + 5)
    with httpx.Client(base_url=served.http.base_url, timeout=20, limits=limits) as client:
        streams = [client.stream("GET", "/events") for _ in range(MAX_STREAMS)]
        open_streams = [parse(stream.__enter__().iter_lines()) for stream in streams]
        for events in open_streams:
            assert next(events)[0] == "status"
        refused = client.get("/events")
        assert refused.status_code == 503
        assert "event streams are open" in refused.json()["detail"]
        assert client.get("/schema").status_code == 200
        for stream in streams:
            stream.__exit__(None, None, None)
        while client.get("/events", params={"run": "nobody"}).status_code == 503:
            threading.Event().wait(0.02)
