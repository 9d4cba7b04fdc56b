"""Every command of the pages about deployment is typed by a test, or the page says that it was not."""

import re
import subprocess
from pathlib import Path

import pytest
from tests.compose.commands import BACKUP, FAULT, QUESTIONS, RESTORE, SCHEMA, UPGRADE
from tests.compose.documented import ROOT, commands, script

MADE_BY_THE_COMPOSE_TEST = {
    "make env",  # deploy/docker/new-env.sh, which it calls
    "docker compose up -d --scale worker=2",
    "docker compose up -d --scale worker=50",  # tests.compose.many_workers
    "docker compose up -d --scale worker=1",
    "docker compose logs -f learner",  # its end, if something fails
    "docker compose build",
    f"{FAULT} --off",
}
SECRETS = "(umask 077; grep -E '_(PASSWORD|TOKEN)=' .env > deploy/kubernetes/secrets.env)"
IN_TESTS = {
    "deploy.md": {*MADE_BY_THE_COMPOSE_TEST, *QUESTIONS, SCHEMA, FAULT, SECRETS},
    "operate.md": {
        line
        for heading in ("Back up a run", "Restore a run", BACKUP, RESTORE, UPGRADE)
        for line in script("operate.md", heading).splitlines()
    },
}
NOT_RUN = ("kubectl ", "POD=$(kubectl ")
"""On a cluster."""


@pytest.mark.parametrize("page", IN_TESTS)
def test_each_command_is_typed_by_a_test_or_said_not_to_be(page: str) -> None:
    shown = commands(page)
    assert shown
    for command in shown:
        if command.startswith(NOT_RUN):
            text = (ROOT / "docs" / page).read_text(encoding="utf-8")
            before = text.partition(command[:40])[0].rpartition("\n#")[2]
            assert "ot run on a cluster here" in before.replace("\n", " ") or "were run on a" in before, (
                command
            )
        else:
            assert command in IN_TESTS[page], f"docs/{page}: {command}"


def test_the_secrets_of_kubernetes_are_those_of_env_and_for_their_owner_alone(tmp_path: Path) -> None:
    settings = subprocess.run([ROOT / "deploy/docker/new-env.sh"], capture_output=True, text=True, check=True)
    (tmp_path / ".env").write_text(settings.stdout, encoding="utf-8")
    (tmp_path / "deploy/kubernetes").mkdir(parents=True)
    assert SECRETS in commands("deploy.md")
    subprocess.run(["sh", "-c", f"umask 022; {SECRETS}"], cwd=tmp_path, check=True)
    file = tmp_path / "deploy/kubernetes/secrets.env"
    assert file.stat().st_mode & 0o077 == 0
    wanted = re.findall(r"^\w+_(?:PASSWORD|TOKEN)=\w+$", settings.stdout, re.MULTILINE)
    assert file.read_text(encoding="utf-8").splitlines() == wanted
    assert len(wanted) == 9


def test_what_the_compose_test_types_stands_in_the_page() -> None:
    assert {*QUESTIONS, SCHEMA, FAULT, f"{FAULT} --off"} <= set(commands("deploy.md"))


def test_the_readme_shows_the_same_commands() -> None:
    shown = commands("../README.md")
    (submission,) = [line for line in shown if line.startswith("ray job submit")]
    assert submission in commands("cluster.md")
    assert SCHEMA in shown
