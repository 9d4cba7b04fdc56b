"""Every request with every kind of token, as the OpenAPI description lists them."""

import asyncio
from datetime import UTC, datetime, timedelta

import httpx
import pytest
from api_setup import RUN, trained_run

from taskschema.bus.connection import connect
from taskschema.bus.records import RunRecords
from taskschema_learner.api.access import Access
from taskschema_learner.api.address import Address
from taskschema_learner.api.app import build_app
from taskschema_learner.api.rates import DEFAULTS, Rates
from taskschema_learner.api.redis_source import RedisSource
from taskschema_learner.api.routes import events
from taskschema_learner.api.scopes import CONTROL, NEEDS, OPEN, SCOPES, need_of
from taskschema_learner.api.tokens import Tokens, new_token, stored

HELD = {scope: new_token() for scope in SCOPES}
EXPIRED = new_token()
UNKNOWN = new_token()
NO_LIMITS = Rates.of(dict.fromkeys(DEFAULTS, "100000/second"))
PROBES = {("GET", "/healthz"), ("GET", "/readyz")}
BODIES = {
    ("PUT", "/workers"): {"target": 2},
    ("POST", "/act"): {"observation": [0.01, -0.05, 0.02, 0.06, 1, 1, 0, 1, 0], "step": 0},
}


class InProcess:
    """A client of an application in this process."""

    def __init__(self, app) -> None:
        self.app = app
        self._runner = asyncio.Runner()
        transport = httpx.ASGITransport(app, raise_app_exceptions=False)
        self._client = httpx.AsyncClient(transport=transport, base_url="http://127.0.0.1")

    def request(self, *arguments, **options) -> httpx.Response:
        return self._runner.run(self._client.request(*arguments, **options))


def tokens() -> Tokens:
    now = datetime.now(UTC)
    valid = [stored(scope, token, [scope], now + timedelta(hours=1)) for scope, token in HELD.items()]
    return Tokens([*valid, stored("old", EXPIRED, SCOPES, now - timedelta(seconds=1))])


def application(redis_url: str, host: str, accepted: Tokens):
    return build_app(RedisSource.connect(redis_url), Access(Address(host, 80), accepted), RUN, NO_LIMITS)


@pytest.fixture(scope="module")
def beyond(redis_url):
    """The API as it is on an address that others reach."""
    records = RunRecords(connect(redis_url))
    trained_run(records, RUN)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(events, "_follow", nothing_new)  # an event stream would never end
        yield InProcess(application(redis_url, "0.0.0.0", tokens()))


async def nothing_new(*unused):
    for _ in ():
        yield


def described(client) -> list[tuple[str, str]]:
    paths = client.app.openapi()["paths"]
    return sorted((method.upper(), path) for path, methods in paths.items() for method in methods)


def ask(client, method: str, path: str, token: str | None) -> int:
    headers = {} if token is None else {"Authorization": f"Bearer {token}"}
    answer = client.request(
        method,
        path.replace("{run}", RUN),
        headers=headers,
        json=BODIES.get((method, path)),
    )
    if answer.status_code in (401, 403):
        (line,) = answer.json()["detail"].splitlines()
        assert line.startswith("This ")
        assert (answer.headers.get("www-authenticate") is not None) == (answer.status_code == 401)
    return answer.status_code


def test_a_cached_schema_needs_its_token_too(beyond) -> None:
    answers = [ask(beyond, "GET", "/schema", HELD["read"]) for _ in range(3)]
    refused = [ask(beyond, "GET", "/schema", token) for token in (None, UNKNOWN, EXPIRED, HELD["control"])]
    assert answers == [200] * 3
    assert refused == [401, 401, 401, 403]


def test_the_table_and_the_description_list_the_same(beyond) -> None:
    hidden = {("GET", path) for path in ("/", "/docs", "/docs/oauth2-redirect", "/openapi.json")}
    assert set(described(beyond)) | hidden == set(NEEDS)


@pytest.mark.parametrize(
    "token",
    [None, "", UNKNOWN, EXPIRED, HELD["read"] + "x", HELD["control"][:-1]],
    ids=["none", "empty", "unknown", "expired", "longer", "shorter"],
)
def test_no_token_and_bad_and_expired_ones(beyond, token) -> None:
    for method, path in described(beyond):
        status = ask(beyond, method, path, token)
        assert status == 200 if (method, path) in PROBES else status == 401, (method, path, status)


@pytest.mark.parametrize("scope", sorted(SCOPES))
def test_a_token_opens_what_its_scope_says_and_nothing_else(beyond, scope) -> None:
    opened = set()
    for method, path in described(beyond):
        status = ask(beyond, method, path, HELD[scope])
        assert status in (200, 202, 403), (method, path, status)
        if status != 403:
            opened.add((method, path))
    assert opened == {where for where, need in NEEDS.items() if need == OPEN or scope in need} & set(
        described(beyond)
    )


def test_each_scope_opens_something_of_its_own() -> None:
    assert need_of("PUT", "/workers") == CONTROL
    assert "robot" in need_of("POST", "/act")
    assert "robot" not in need_of("GET", "/metrics")


@pytest.mark.parametrize(
    ("method", "path"),
    [
        ("DELETE", "/schema"),
        ("PATCH", "/runs/x"),
        ("POST", "/nothing"),
        ("POST", "/schema"),
        ("POST", f"/runs/{RUN}/pause/"),
        ("POST", f"//runs/{RUN}/stop"),
        ("POST", f"/runs/{RUN}%2Fstop"),
        ("PUT", "/Workers"),
    ],
)
def test_what_is_not_in_the_table_needs_control(beyond, method, path) -> None:
    assert ask(beyond, method, path, None) == 401
    assert ask(beyond, method, path, HELD["read"]) == 403
    assert ask(beyond, method, path, HELD["control"]) in (202, 307, 404, 405)


@pytest.mark.parametrize("path", ["/docs", "/openapi.json", "/docs/static/swagger-ui.css", "/", "/nothing"])
def test_what_is_not_described_needs_a_token_beyond_loopback(beyond, path) -> None:
    assert ask(beyond, "GET", path, None) == 401
    assert ask(beyond, "GET", path, HELD["robot"]) == 403
    assert ask(beyond, "GET", path, HELD["read"]) in (200, 307, 404)


def test_on_loopback_reading_is_open_until_a_token_for_it_is_given(redis_url, beyond) -> None:
    only_control = Tokens.of("a-token-for-tests", {})
    plain = InProcess(application(redis_url, "127.0.0.1", only_control))
    read_given = Tokens.of("a-token-for-tests", {"TASKSCHEMA_API_READ_TOKEN": HELD["read"]})
    guarded = InProcess(application(redis_url, "127.0.0.1", read_given))
    for method, path in described(plain):
        needs_control = NEEDS[method, path] == CONTROL
        assert (ask(plain, method, path, None) == 401) == needs_control, (method, path)
        closed = (method, path) not in PROBES
        assert (ask(guarded, method, path, None) == 401) == closed, (method, path)
    assert ask(guarded, "GET", "/metrics", HELD["read"]) == 200
    assert ask(guarded, "GET", "/metrics", "a-token-for-tests") == 200


@pytest.mark.parametrize("host", ["127.0.0.1", "0.0.0.0"])
def test_the_description_says_what_each_request_needs(redis_url, host) -> None:
    access = Access(Address(host, 80), Tokens.of("a-token-for-tests", {}))
    paths = build_app(RedisSource.connect(redis_url), access, RUN).openapi()["paths"]
    for path, methods in paths.items():
        for method, operation in methods.items():
            guarded = bool(access.need(method.upper(), path))
            assert bool(operation.get("security")) == guarded
            assert ({"401", "403"} <= set(operation["responses"])) == guarded
            assert operation["x-scopes"] == sorted(NEEDS[method.upper(), path])
            assert "429" in operation["responses"]
