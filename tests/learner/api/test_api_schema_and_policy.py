import threading

import httpx
import msgspec
import numpy as np
import pytest
from api_setup import RUN, document, publish, snapshot, trained_run

from taskschema.config import RunConfig
from taskschema.policies import PolicySnapshot
from taskschema.schema import SchemaDocument


def test_schema_is_the_document_that_the_learner_published(served):
    answer = served.http.get("/schema")
    assert answer.status_code == 200
    assert answer.headers["content-type"] == "application/json"
    assert msgspec.json.decode(answer.content, type=SchemaDocument) == document(RUN, 3)
    body = answer.json()
    assert list(body) == [
        "run",
        "task",
        "version",
        "horizon",
        "skills",
        "pairs",
        "logits",
        "probabilities",
        "best",
        "entropy",
        "updated_at",
    ]
    assert body["best"][0]["left"] == "reach"
    assert [row["used"] for row in body["best"]] == [True, True, False]


def test_schema_of_a_version(served):
    assert served.http.get("/schema?version=2").json()["version"] == 2
    assert served.http.get(f"/schema?version=1&run={RUN}").json()["version"] == 1


def test_schema_version_that_is_not_kept_names_the_versions(served):
    answer = served.http.get("/schema?version=17")
    assert answer.status_code == 404
    assert answer.json()["detail"] == f"Run '{RUN}' keeps no schema version 17. Valid: 1 to 3."


def test_a_new_schema_shows_without_delay(served):
    served.http.get("/schema")
    publish(served.records, RUN, 4)
    seen = threading.Event()
    while not seen.wait(0.01):  # the cache is at most 50 ms old; the timeout of the suite bounds this
        if served.http.get("/schema").json()["version"] == 4:
            seen.set()


def test_the_cached_schema_is_answered_like_any_other(served):
    """The first of two requests in a row fills the cache; a named run goes the long way."""
    named = served.http.get(f"/schema?run={RUN}")
    served.http.get("/schema")
    cached = served.http.get("/schema")
    assert cached.content == named.content
    dates = {"date": None}
    assert {**cached.headers, **dates} == {**named.headers, **dates}
    assert served.http.get("/schema", headers={"Host": "evil.example"}).status_code == 400
    assert served.http.head("/schema").status_code == 405
    assert served.http.post("/schema").status_code in (401, 405)


def test_schema_is_not_sent_again(served):
    etag = served.http.get("/schema").headers["etag"]
    again = served.http.get("/schema", headers={"If-None-Match": etag})
    assert (again.status_code, again.content, again.headers["etag"]) == (304, b"", etag)
    assert served.http.get("/schema?version=1", headers={"If-None-Match": etag}).status_code == 200


def test_policy_is_what_was_published_and_its_etag_is_its_hash(served):
    answer = served.http.get("/policy")
    received = PolicySnapshot.from_bytes(answer.content)
    assert received.sha256 == snapshot(3).sha256
    assert np.array_equal(received.logits, snapshot(3).logits)
    assert answer.headers["etag"] == f'"{received.sha256}"'
    assert answer.headers["policy-version"] == "3"


@pytest.mark.parametrize("form", ["{}", "W/{}", '"other", {}', "*"])
def test_policy_is_not_sent_again(served, form):
    etag = served.http.get("/policy").headers["etag"]
    again = served.http.get("/policy", headers={"If-None-Match": form.format(etag)})
    assert (again.status_code, again.content) == (304, b"")


def test_policy_is_sent_again_once_it_changed(served):
    etag = served.http.get("/policy").headers["etag"]
    publish(served.records, RUN, 4)
    while (answer := served.http.get("/policy", headers={"If-None-Match": etag})).status_code == 304:
        threading.Event().wait(0.01)
    assert PolicySnapshot.from_bytes(answer.content).version == 4


def test_policy_meta_describes_the_bytes_and_what_goes_in_and_out(served):
    meta = served.http.get("/policy/meta").json()
    assert (meta["version"], meta["sha256"]) == (3, snapshot(3).sha256)
    assert meta["size"] == len(served.http.get("/policy").content)
    assert {"name": "schema.logits", "dtype": "float64", "shape": [3, 9]} in meta["tensors"]
    assert {"name": "mean.weight", "dtype": "float32", "shape": [6, 8]} in meta["tensors"]
    assert [(field["name"], field["size"]) for field in meta["observation"]] == [
        ("handles", 4),
        ("holding", 2),
        ("timestep", 3),
    ]
    assert meta["arguments"][0] == {
        "name": "left.reach.x",
        "unit": "m",
        "low": -0.1,
        "high": 0.1,
        "periodic": False,
        "meaning": "Offset of the hand from the object's centre, to the right.",
    }
    assert len(meta["pairs"]) == 9


@pytest.mark.parametrize("path", ["/schema", "/policy", "/policy/meta", "/workers", "/events"])
def test_an_unknown_run_names_the_nearest(served, path):
    answer = served.http.get(path, params={"run": "toy-schema-sed0"})
    assert answer.status_code == 404
    assert answer.json()["detail"] == (f"Unknown run 'toy-schema-sed0'. Did you mean '{RUN}'? Valid: {RUN}.")


@pytest.mark.parametrize(("path", "what"), [("/schema", "schema"), ("/policy", "policy")])
def test_a_run_that_has_just_started_has_nothing_to_show_yet(served, path, what):
    served.records.register_run("young", RunConfig(task="toy"))
    answer = served.http.get(path, params={"run": "young"})
    assert answer.status_code == 404
    assert f"has no {what} yet" in answer.json()["detail"]


@pytest.mark.parametrize("version", ["-1", "x", "1.5", "", "9" * 40, "1e3"])
def test_a_wrong_version_is_refused_in_one_line(served, version):
    answer = served.http.get("/schema", params={"version": version})
    assert answer.status_code == 422
    assert answer.json()["detail"].startswith("query.version: ")


def test_without_a_default_run_the_only_one_is_meant(served, redis_url):
    from taskschema_learner.api.process import ApiProcess

    with ApiProcess(redis_url, None, "127.0.0.1:0") as api:
        assert httpx.get(f"{api.url}/schema").json()["run"] == RUN
        trained_run(served.records, "second", versions=1)
        several = httpx.get(f"{api.url}/policy")
        assert several.status_code == 422
        assert several.json()["detail"] == (f"Several runs are served: add ?run=NAME. Valid: second, {RUN}.")
        assert httpx.get(f"{api.url}/schema?run=second").json()["run"] == "second"
        served.records.delete_run(RUN)
        served.records.delete_run("second")
        nothing = httpx.get(f"{api.url}/policy")
        assert nothing.status_code == 404
        assert "taskschema train" in nothing.json()["detail"]
