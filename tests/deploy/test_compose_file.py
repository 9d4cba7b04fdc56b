"""What the compose file promises, read from the file; `make compose-test` runs it for real."""

import re
import shutil
import subprocess

import pytest
from compose_file import ROOT, raw, services, settings, variables

OWN = ("redis", "head", "worker", "learner", "api", "tools", "robot-twin", "robot-learner", "robot")
"""Services of images that are built here."""
BUILT_BY_ANOTHER = ("worker", "robot")
"""Services of an image that one builds which they depend on."""


def test_every_setting_is_in_the_example_and_every_secret_is_new_each_time():
    text = (ROOT / "docker-compose.yml").read_text()
    first, second = settings(), settings()
    assert variables(text) == set(first)
    secrets = [name for name in first if name.endswith(("_PASSWORD", "_TOKEN"))]
    assert len(secrets) == 9
    for name in secrets:
        assert re.fullmatch(r"[0-9a-f]{48}", first[name])
        assert first[name] != second[name]
    assert len({first[name] for name in secrets}) == 9


@pytest.mark.parametrize("service", services())
def test_containers_can_do_as_little_as_possible(service):
    settings = services()[service]
    assert settings["cap_drop"] == ["ALL"]
    assert settings["read_only"] is True
    assert settings["security_opt"] == ["no-new-privileges:true"]
    assert int(settings["user"].partition(":")[0]) > 0
    assert settings["mem_limit"]
    assert settings["pids_limit"] >= 4096
    assert "privileged" not in settings
    assert settings.get("healthcheck") or service == "tools"


def test_a_crowd_of_workers_on_one_machine_starves_nothing_that_they_wait_for():
    heavier = {name for name, each in services().items() if each.get("cpu_shares", 1024) > 1024}
    assert heavier == {"redis", "head", "learner", "api", "robot-learner", "robot"}


def test_only_api_and_grafana_are_published_and_on_loopback():
    published = {name: each["ports"] for name, each in services().items() if "ports" in each}
    assert published == {
        "api": ["${API_ADDRESS:-127.0.0.1:8420}:8420"],
        "grafana": ["${GRAFANA_ADDRESS:-127.0.0.1:3000}:3000"],
    }
    assert raw()["networks"]["bus"] == {"internal": True}


def test_each_service_gets_only_its_own_secrets():
    expected = {
        "redis": {f"REDIS_{role}_PASSWORD" for role in ("LEARNER", "WORKER", "API", "ROBOT")},
        "head": {"RAY_AUTH_TOKEN"},
        "worker": {"RAY_AUTH_TOKEN"},  # the pool hands actors their Redis user
        "learner": {"RAY_AUTH_TOKEN", "REDIS_LEARNER_PASSWORD", "REDIS_WORKER_PASSWORD"},
        "api": {"REDIS_API_PASSWORD"} | {f"TASKSCHEMA_API_{scope}TOKEN" for scope in ("", "READ_", "ROBOT_")},
        "tools": set(),
        "robot-twin": set(),
        "robot-learner": {"REDIS_LEARNER_PASSWORD"},
        "robot": {"REDIS_ROBOT_PASSWORD"},
        "prometheus": {"TASKSCHEMA_API_READ_TOKEN"},
        "grafana": {"GRAFANA_ADMIN_PASSWORD"},
    }
    found = {
        name: {key for key in variables(str(each)) if key.endswith(("_PASSWORD", "_TOKEN"))}
        for name, each in services().items()
    }
    assert found == expected


def test_images_have_full_tags_and_their_own_dockerfile():
    for name, each in services().items():
        assert re.fullmatch(r"\S+:v?\d+\.\d+\.\d+", each["image"]), name
        if name in BUILT_BY_ANOTHER:
            assert each["image"] in [services()[other]["image"] for other in each["depends_on"]]
        elif name in OWN:
            assert (ROOT / each["build"]["dockerfile"]).exists()


def stages() -> dict[str, list[str]]:
    """Return the instructions of each stage of each Dockerfile, those that it builds on first."""
    found: dict[str, list[str]] = {}
    for path in sorted((ROOT / "deploy/docker").glob("*.Dockerfile")):
        here: dict[str, list[str]] = {}
        text = path.read_text(encoding="utf-8").replace("\\\n", " ")
        for part in re.split(r"^(?=FROM )", text, flags=re.MULTILINE)[1:]:
            lines = [line for line in part.splitlines() if line and not line.startswith("#")]
            match = re.fullmatch(r"FROM (\S+)(?: AS (\S+))?", lines[0])
            assert match is not None, lines[0]
            here[match[2] or "only"] = [*here.get(match[1], [lines[0]]), *lines[1:]]
        found |= {f"{path.name.partition('.')[0]}: {name}": lines for name, lines in here.items()}
    return found


@pytest.mark.parametrize("stage", stages())
def test_stages_have_full_tags_and_install_before_the_source_comes(stage):
    """A change of the code installs nothing again."""
    instructions = stages()[stage]
    assert re.match(r"FROM \w+:\d+\.\d+\.\d+-\S+", instructions[0])
    sources = [i for i, line in enumerate(instructions) if re.match(r"COPY (--from=source|shared/)", line)]
    installing = [i for i, line in enumerate(instructions) if "pip install" in line]
    assert not installing or not sources or max(installing) < min(sources)
    if any(line.startswith("CMD") for line in instructions):
        users = [line for line in instructions if line.startswith("USER")]
        assert users[-1] == "USER 10001:10001"


def test_every_image_of_a_service_is_a_stage_that_starts_something():
    for name, each in services().items():
        if "build" in each:
            file = each["build"]["dockerfile"].rpartition("/")[2].partition(".")[0]
            instructions = stages()[f"{file}: {each['build'].get('target', 'only')}"]
            assert any(line.startswith("CMD") for line in instructions), name


@pytest.mark.parametrize("command", [["docker", "compose"], ["docker-compose"]], ids=" ".join)
def test_compose_accepts_the_file(command, tmp_path):
    if (
        shutil.which(command[0]) is None
        or subprocess.run([*command, "version"], capture_output=True).returncode
    ):
        pytest.skip(f"{' '.join(command)} is not installed here")
    file = tmp_path / "env"
    file.write_text("\n".join(f"{name}={value}" for name, value in settings().items()))
    words = [*command, "--env-file", str(file), "--profile", "monitoring", "--profile", "robot", "config"]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_without_settings_compose_says_what_to_do(tmp_path):
    if shutil.which("docker-compose") is None:
        pytest.skip("docker-compose is not installed here")
    (tmp_path / "env").write_text("")
    words = ["docker-compose", "--env-file", str(tmp_path / "env"), "config"]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode != 0
    assert "copy .env.example to .env" in done.stderr
