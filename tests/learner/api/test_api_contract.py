"""schemathesis: whatever is sent, described or not, is answered as the description says, never by a 5xx."""

import subprocess
import sys
from pathlib import Path

import pytest
from api_setup import TOKEN

COMMAND = str(Path(sys.executable).with_name("schemathesis"))
PHASES = ("Examples", "Coverage", "Fuzzing", "Stateful")


def contract(url: str, folder: Path, examples: int) -> str:
    """Run all phases with the owner's token and return what schemathesis prints."""
    config = str(Path(__file__).with_name("schemathesis.toml"))
    words = [COMMAND, "--config-file", config, "run", f"{url}/openapi.json", "--no-color"]
    words += ["--phases", ",".join(PHASES).lower(), "--max-examples", str(examples), "--seed", "1"]
    # An event stream does not end; test_api_events.py is about it.
    words += ["--exclude-path", "/events", "--header", f"Authorization: Bearer {TOKEN}"]
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_the_api_keeps_its_contract(served, tmp_path: Path) -> None:
    printed = contract(str(served.http.base_url), tmp_path, examples=8)
    for phase in PHASES:
        assert f"✅ {phase}" in printed, printed
    operations = sum(map(len, served.http.get("/openapi.json").json()["paths"].values()))
    assert f"Tested: {operations - 1}" in printed, printed


@pytest.mark.slow
def test_the_api_keeps_its_contract_for_long(served, tmp_path: Path) -> None:
    contract(str(served.http.base_url), tmp_path, examples=200)
