"""Every query of the dashboard and of the alerts, against a real Prometheus that scrapes a real training."""

import json
import os
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import httpx
import pytest
import yaml
from bus_setup import wait_until
from role_redis import free_port

from taskschema.bus.connection import connect
from taskschema.bus.keys import RunKeys

ROOT = Path(__file__).parents[2]
COMMAND = str(Path(sys.executable).with_name("taskschema"))
DASHBOARD = json.loads((ROOT / "deploy/grafana/dashboards/taskschema.json").read_text())
QUERIES = [(panel["title"], target["expr"]) for panel in DASHBOARD["panels"] for target in panel["targets"]]
RUN = "watched"
TOKEN = "a-token-for-tests"
PATIENCE_SECONDS = 240.0
"""For what takes seconds on an idle machine."""

pytestmark = pytest.mark.timeout(600)


@pytest.fixture(scope="module")
def prometheus(tmp_path_factory: pytest.TempPathFactory):
    """Yield a client of a Prometheus that has watched a training for some seconds."""
    program = shutil.which("prometheus")
    if program is None:
        pytest.skip("prometheus is not there: `apt-get install prometheus` brings it")
    folder = tmp_path_factory.mktemp("prometheus")
    command = [COMMAND, "train", "toy", "--run-dir", str(folder / RUN), "--workers", "0", "--slots", "10"]
    environment = {**os.environ, "TASKSCHEMA_API_TOKEN": TOKEN, "TASKSCHEMA_API_READ_TOKEN": f"{TOKEN}-2"}
    command += ["--until-success", "0", "--api", "127.0.0.1:0"]
    output = folder / "training.log"
    with (
        output.open("w") as log,
        subprocess.Popen(command, stdout=log, stderr=log, env=environment) as training,
    ):
        try:
            url = api_url(training, output)
            refuse_a_message(folder)
            httpx.put(f"{url}/workers", json={"target": 1}, headers={"Authorization": f"Bearer {TOKEN}"})
            yield from watching(program, folder, url.removeprefix("http://"))
        finally:
            training.terminate()
            training.wait(30)


def api_url(training: subprocess.Popen[bytes], output: Path) -> str:
    def said() -> re.Match[str] | None:
        return re.search(r"API: (http://\S+)\s", output.read_text())

    wait_until(lambda: said() is not None or training.poll() is not None, seconds=PATIENCE_SECONDS)
    match = said()
    assert match is not None, output.read_text()
    return match[1]


def refuse_a_message(folder: Path) -> None:
    """Have the learner refuse a message, so that there is something to count by reason."""
    settings = dict(
        line.split(" ", 1) for line in (folder / RUN / "redis/redis.conf").read_text().splitlines()
    )
    client = connect(f"redis://:{settings['requirepass']}@127.0.0.1:{settings['port']}")
    client.xadd(RunKeys(RUN).trajectories, {"junk": "junk"})


def watching(program: str, folder: Path, target: str):
    """Start Prometheus with the project's configuration, but for the API's place and how often to ask."""
    config = yaml.safe_load((ROOT / "deploy/prometheus/prometheus.yml").read_text())
    (folder / "token").write_text(f"{TOKEN}-2")
    config["global"] = {"scrape_interval": "300ms", "evaluation_interval": "1s"}
    config["rule_files"] = [str(ROOT / "deploy/prometheus/alerts.yml")]
    (scrape,) = config["scrape_configs"]
    scrape["authorization"]["credentials_file"] = str(folder / "token")
    scrape["static_configs"] = [{"targets": [target]}]
    (folder / "prometheus.yml").write_text(yaml.safe_dump(config))
    port = free_port()
    words = [f"--config.file={folder}/prometheus.yml", f"--storage.tsdb.path={folder}/data"]
    with (
        (folder / "prometheus.log").open("w") as log,
        subprocess.Popen(
            [program, *words, f"--web.listen-address=127.0.0.1:{port}"], stdout=log, stderr=log
        ) as process,
        httpx.Client(base_url=f"http://127.0.0.1:{port}/api/v1", timeout=30) as client,
    ):
        try:
            wait_for_rounds(client, process, folder / "prometheus.log")
            refuse_a_message(folder)  # another one than the first that was seen: the alert comes
            wait_until(lambda: bool(ask(client, 'ALERTS{alertstate="firing"}')), seconds=PATIENCE_SECONDS)
            yield client
        finally:
            process.terminate()
            process.wait(20)


def wait_for_rounds(client: httpx.Client, process: subprocess.Popen[bytes], log: Path) -> None:
    deadline = time.monotonic() + PATIENCE_SECONDS
    while time.monotonic() < deadline:
        assert process.poll() is None, log.read_text()
        try:
            if value(client, "changes(taskschema_policy_version[1m])") > 3:
                return
        except (httpx.TransportError, LookupError):
            pass
        time.sleep(0.2)
    raise AssertionError(log.read_text())


def ask(client: httpx.Client, query: str) -> list[dict[str, Any]]:
    response = client.get("/query", params={"query": query})
    if response.status_code == 503:  # in words, while it starts
        raise LookupError(response.text)
    answer = response.json()
    assert answer["status"] == "success", (query, answer)
    result: list[dict[str, Any]] = answer["data"]["result"]
    return result


def value(client: httpx.Client, query: str) -> float:
    return float(ask(client, query)[0]["value"][1])


@pytest.mark.parametrize(("title", "query"), QUERIES, ids=[f"{title}: {query}" for title, query in QUERIES])
def test_a_query_of_the_dashboard_finds_something(prometheus, title: str, query: str) -> None:
    found = ask(prometheus, query.replace("$run", RUN).replace("$__rate_interval", "1m"))
    assert found, "no such series"
    for series in found:
        assert series["value"][1] not in ("NaN", "+Inf", "-Inf")
        assert series["metric"].get("run", RUN) == RUN


def test_the_choice_of_runs(prometheus) -> None:
    (variable,) = [item for item in DASHBOARD["templating"]["list"] if item["name"] == "run"]
    name = re.fullmatch(r"label_values\((\w+), run\)", variable["definition"])
    assert name is not None
    labels = prometheus.get("/label/run/values", params={"match[]": name[1]}).json()
    assert labels["data"] == [RUN]


def test_legends_name_labels_that_there_are(prometheus) -> None:
    for panel in DASHBOARD["panels"]:
        for target in panel["targets"]:
            query = target["expr"].replace("$run", RUN).replace("$__rate_interval", "1m")
            labels = set(ask(prometheus, query)[0]["metric"])
            assert set(re.findall(r"{{(\w+)}}", target["legendFormat"])) <= labels, target


def test_alerts_ask_for_metrics_that_there_are(prometheus) -> None:
    names = set(prometheus.get("/label/__name__/values").json()["data"])
    rules = yaml.safe_load((ROOT / "deploy/prometheus/alerts.yml").read_text())["groups"][0]["rules"]
    for rule in rules:
        asked = set(re.findall(r"taskschema_\w+", rule["expr"]))
        assert asked <= names, (rule["alert"], asked - names)
    loaded = prometheus.get("/rules").json()["data"]["groups"][0]["rules"]
    assert {rule["health"] for rule in loaded} <= {"ok", "unknown"}
    assert len(loaded) == len(rules)


def test_an_alert_of_no_run_is_shown_with_any_choice_of_runs() -> None:
    """`ApiDown` and `RedisDown` are about none."""
    ((query,),) = [[target["expr"] for target in panel["targets"]] for panel in DASHBOARD["panels"][:1]]
    match = re.search(r'run=~"([^"]*)"', query)
    assert match is not None
    for chosen in ("watched", "(one|two)", ".*"):
        assert re.fullmatch(match[1].replace("$run", chosen), "")


def test_the_numbers_are_the_runs_own(prometheus) -> None:
    episodes = value(prometheus, f'taskschema_episodes_total{{run="{RUN}"}}')
    assert episodes > 0
    assert episodes % 40 == 0, "10 slots of 4 episodes a round"
    steps = value(prometheus, f'taskschema_skill_steps_total{{run="{RUN}"}}')
    assert episodes <= steps <= 3 * episodes
    rounds = value(prometheus, f'taskschema_round_duration_seconds_count{{run="{RUN}",phase="update"}}')
    assert abs(rounds - episodes / 40) <= 1
    leases = value(prometheus, f'taskschema_lease_duration_seconds_count{{run="{RUN}"}}')
    assert leases >= 10 * (rounds - 1)
    assert value(prometheus, f'taskschema_quarantined_messages_total{{run="{RUN}",reason="malformed"}}') == 2
