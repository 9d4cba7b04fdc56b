"""The alert rules, tested by promtool: each comes when it has to, and not when it must not."""

import shutil
import subprocess
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "deploy/prometheus"


def alerts() -> list[str]:
    groups = yaml.safe_load((FOLDER / "alerts.yml").read_text())["groups"]
    return [rule["alert"] for group in groups for rule in group["rules"]]


def test_the_rules_do_what_they_say() -> None:
    promtool = shutil.which("promtool")
    if promtool is None:
        pytest.skip("promtool is not there: `apt-get install prometheus` brings it")
    for words in (["check", "rules", "alerts.yml"], ["test", "rules", "alerts_test.yml"]):
        done = subprocess.run([promtool, *words], cwd=FOLDER, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr
    done = subprocess.run(
        [promtool, "check", "config", "--syntax-only", "prometheus.yml"], cwd=FOLDER, capture_output=True
    )
    assert done.returncode == 0, done.stdout


@pytest.mark.parametrize("alert", alerts())
def test_each_alert_is_tested_to_come_and_to_stay_away(alert: str) -> None:
    tests = yaml.safe_load((FOLDER / "alerts_test.yml").read_text())["tests"]
    expected = [
        bool(rule["exp_alerts"])
        for test in tests
        for rule in test["alert_rule_test"]
        if rule["alertname"] == alert
    ]
    # Where it is silent once, another series of the same test may be what stays silent.
    assert {True, False} <= set(expected)


@pytest.mark.parametrize("alert", alerts())
def test_each_alert_is_explained(alert: str) -> None:
    text = (ROOT / "docs/operate.md").read_text(encoding="utf-8")
    section = text.partition(f"### {alert}\n")[2].partition("\n### ")[0]
    assert section.strip(), f"docs/operate.md has no section {alert}"


def test_prometheus_needs_its_token() -> None:
    done = subprocess.run(["sh", FOLDER / "start.sh"], env={}, capture_output=True, text=True)
    assert (done.returncode, len(done.stderr.splitlines())) == (1, 1)
    assert "TASKSCHEMA_API_READ_TOKEN" in done.stderr
