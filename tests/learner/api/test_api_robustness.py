"""Nothing that is sent makes the API fail: never a 5xx, always one line."""

import json
import warnings

import pytest
from api_setup import RUN
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

FUZZ = settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
NUMBERS = st.one_of(
    st.integers(), st.integers(min_value=10**20, max_value=10**320), st.floats(), st.booleans(), st.none()
)
TEXT = st.text(alphabet=st.characters(exclude_categories=[]), max_size=20)
VALUES = st.recursive(
    NUMBERS | TEXT, lambda inner: st.lists(inner) | st.dictionaries(TEXT, inner), max_leaves=8
)
OBSERVATIONS = st.one_of(
    VALUES,
    st.lists(NUMBERS, min_size=9, max_size=9),
    st.fixed_dictionaries({"handles": VALUES, "holding": VALUES, "timestep": VALUES}),
)
BODIES = st.one_of(
    VALUES,
    st.fixed_dictionaries(
        {"observation": OBSERVATIONS, "step": NUMBERS},
        optional={"mode": st.sampled_from(["mean", "sampled"]) | VALUES, "seed": NUMBERS},
    ),
)
JSON = {"Content-Type": "application/json"}


def check(answer):
    assert answer.status_code < 500, answer.text
    if answer.status_code >= 400 and answer.status_code != 400:
        detail = answer.json()["detail"]
        assert isinstance(detail, str)
        assert len(detail.splitlines()) == 1


@FUZZ
@given(body=BODIES)
def test_any_json_to_act(served, body):
    check(served.http.post("/act", content=json.dumps(body), headers=JSON))


@FUZZ
@given(body=st.binary(max_size=200) | BODIES.map(lambda body: json.dumps(body, ensure_ascii=True).encode()))
def test_any_bytes_with_any_type(served, body):
    for content_type in ("application/json", "text/plain", "application/x-www-form-urlencoded", "nonsense"):
        check(served.http.post("/act", content=body, headers={"Content-Type": content_type}))


@FUZZ
@given(body=VALUES | st.fixed_dictionaries({"target": NUMBERS}))
def test_any_json_to_workers(served, body):
    check(served.owner.put("/workers", content=json.dumps(body), headers=JSON))


@FUZZ
@given(run=st.text(min_size=1, max_size=80), value=st.text(max_size=40))
def test_any_names_and_queries(served, run, value):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for path in ("/schema", "/policy", "/workers"):
            check(served.http.get(path, params={"run": run, "version": value}))
        check(served.http.get(f"/runs/{RUN}/curve", params={"since": value}))


@FUZZ
@given(path=st.binary(min_size=1, max_size=40))
def test_any_path(served, path):
    quoted = "".join(f"%{byte:02x}" for byte in path)
    for prefix in ("/", "/runs/", "/docs/static/"):
        check(served.http.get(prefix + quoted))


@pytest.mark.parametrize("depth", [100, 20_000])
def test_deeply_nested_json(served, depth):
    check(served.http.post("/act", content="[" * depth + "]" * depth, headers=JSON))


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE", "PATCH", "TRACE"])
def test_other_methods(served, method):
    answer = served.owner.request(method, "/schema")
    assert answer.status_code == 405
    check(answer)


def test_what_is_no_method_is_refused_on_one_line(served):
    answer = served.owner.request("NONSENSE", "/schema")
    assert answer.status_code == 400
    assert answer.text == "Invalid HTTP request received."
