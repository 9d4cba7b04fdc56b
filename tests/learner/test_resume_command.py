"""The command that a stopped training prints goes on with everything that was asked for."""

import shlex
from dataclasses import replace

import pytest
from tls import make_certificates
from typer.testing import CliRunner

from taskschema_learner.cli.main import app
from taskschema_learner.cli.train import _resume_command
from taskschema_learner.composition import open_folder


@pytest.fixture
def asked(monkeypatch, tmp_path):
    """Return what `taskschema train` would do."""
    monkeypatch.chdir(tmp_path)
    calls = []
    monkeypatch.setattr("taskschema_learner.cli.train._run", lambda *call: calls.append(call))

    def ask(words):
        result = CliRunner().invoke(app, words)
        assert result.exit_code == 0, result.output
        return calls.pop()

    return ask


CASES = (
    "",
    "--rounds 7 --until-success 0.5 --device cuda --api 127.0.0.1:9000",
    "--until-success 0 --api none --workers 0 --log-format json",
    "--agent robot --redis redis://10.0.0.1:6379 --rounds 3",
    "--redis redis://10.0.0.1:6379 --ray auto --workers 50",
    "--api-tls-cert tls/server.pem --api-tls-key tls/server.key",
)


@pytest.mark.parametrize("words", CASES)
def test_everything_goes_on_as_it_was(asked, tmp_path, words):
    make_certificates(tmp_path / "tls")
    options, log_format = asked(["train", "toy", *words.split()])
    open_folder(options)
    command = _resume_command(options, log_format)
    for word in words.split():
        assert word in command
    assert asked(shlex.split(command)[1:]) == (replace(options, resume=True), log_format)


def test_what_is_the_default_is_not_repeated_and_secrets_neither(asked):
    plain = "taskschema train --resume --run-dir runs/toy-schema-seed0"
    assert _resume_command(*asked(["train", "toy"])) == plain
    with_secret = asked(["train", "toy", "--redis", "redis://learner:secret@10.0.0.1:6379"])
    assert _resume_command(*with_secret) == f"{plain} --redis URL"
