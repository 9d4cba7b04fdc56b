"""The Kubernetes manifests: their structure, and that they say the same as the compose file.

They were never applied to a cluster by these tests.
"""

import copy
import json
import re
import shutil
import subprocess
from functools import cache
from pathlib import Path
from typing import Any

import kubernetes_validate
import pytest
import yaml
from compose_file import ROOT, raw, services, settings, variables
from kuberay_fields import SPECS, wrong_fields

FOLDER = ROOT / "deploy/kubernetes"
KUBERNETES = "1.34"
PARTS = {"": FOLDER, "robot": FOLDER / "robot", "monitoring": FOLDER / "monitoring"}
"""Folders that are applied one by one: what compose always starts, and its profiles."""
LEFT_OUT = {"tools"}
"""Services of compose that the manifests have not, and docs/deploy.md says so."""
TOGETHER = {"robot": {"robot-twin", "robot"}}
"""Services of compose that are containers of one pod."""
UNITS = {"m": 2**20, "g": 2**30, "Mi": 2**20, "Gi": 2**30}


def kustomization(folder: Path) -> dict[str, Any]:
    loaded: dict[str, Any] = yaml.safe_load((folder / "kustomization.yaml").read_text())
    return loaded


@cache
def manifests() -> list[dict[str, Any]]:
    return [
        document
        for folder in PARTS.values()
        for name in kustomization(folder)["resources"]
        if (folder / name).is_file()
        for document in yaml.safe_load_all((folder / name).read_text())
    ]


def manifest(kind: str, name: str) -> dict[str, Any]:
    (found,) = [each for each in manifests() if (each["kind"], each["metadata"]["name"]) == (kind, name)]
    return found


def workload(name: str) -> dict[str, Any]:
    """Return the Deployment, StatefulSet or Job of a name."""
    kinds = ("Deployment", "StatefulSet", "Job")
    (found,) = [each for each in manifests() if each["kind"] in kinds and each["metadata"]["name"] == name]
    return found


def pods() -> dict[str, dict[str, Any]]:
    """Return the pod of each service, by the service's name in the compose file."""
    cluster = manifest("RayCluster", "taskschema")["spec"]
    groups = {group["groupName"]: group["template"]["spec"] for group in cluster["workerGroupSpecs"]}
    own = {
        name: workload(name)["spec"]["template"]["spec"]
        for name in ("redis", "api", "robot-learner", "robot", "prometheus", "grafana")
    }
    return {
        **own,
        "robot-twin": own["robot"],
        "head": cluster["headGroupSpec"]["template"]["spec"],
        **groups,
    }


def container(service: str) -> dict[str, Any]:
    """Return the service's container: the pod's only one, or the one of its name."""
    pod = pods()[service]
    found: dict[str, Any]
    if "initContainers" not in pod:
        (found,) = pod["containers"]
        return found
    by_name = {each["name"]: each for each in pod["initContainers"] + pod["containers"]}
    assert set(by_name) in TOGETHER.values()
    found = by_name[service]
    return found


@pytest.mark.parametrize(
    "document", manifests(), ids=lambda each: f"{each['kind']} {each['metadata']['name']}"
)
def test_manifests_are_valid(document):
    if document["kind"] in SPECS:
        assert document["apiVersion"] == "ray.io/v1"
        assert not wrong_fields(document["spec"], SPECS[document["kind"]], document["kind"])
        return  # their pods are checked below
    kubernetes_validate.validate(document, KUBERNETES, strict=True)


def test_a_field_that_kuberay_does_not_know_is_seen():
    spec = copy.deepcopy(manifest("RayCluster", "taskschema")["spec"])
    spec["authOptions"]["mode"] = "tokens"
    spec["workerGroupSpecs"][1]["replica"] = 3
    spec["workerGroupSpecs"][1]["minReplicas"] = "0"
    assert wrong_fields(spec, SPECS["RayCluster"], "RayCluster") == [
        "RayCluster.authOptions.mode: 'tokens'",
        "RayCluster.workerGroupSpecs[1].replica: no such field",
        "RayCluster.workerGroupSpecs[1].minReplicas: '0'",
    ]


@pytest.mark.parametrize("service", pods())
def test_pods_are_valid_and_restricted(service):
    pod = pods()[service]
    kubernetes_validate.validate(
        {"apiVersion": "v1", "kind": "Pod", "metadata": {"name": service}, "spec": pod},
        KUBERNETES,
        strict=True,
    )
    assert pod["automountServiceAccountToken"] is False
    assert pod["securityContext"]["runAsNonRoot"] is True
    assert pod["securityContext"]["seccompProfile"] == {"type": "RuntimeDefault"}
    assert container(service)["securityContext"] == {
        "readOnlyRootFilesystem": True,
        "allowPrivilegeEscalation": False,
        "capabilities": {"drop": ["ALL"]},
    }
    mounted = {
        mount["name"]
        for each in pod.get("initContainers", []) + pod["containers"]
        for mount in each["volumeMounts"]
    }
    assert mounted == {volume["name"] for volume in pod["volumes"]} | claimed(service)


def claimed(service: str) -> set[str]:
    """Return the volumes that a StatefulSet claims for its pod."""
    if not any((each["kind"], each["metadata"]["name"]) == ("StatefulSet", service) for each in manifests()):
        return set()
    return {each["metadata"]["name"] for each in workload(service)["spec"]["volumeClaimTemplates"]}


def test_claims_are_there():
    """A pod's claim is one of the manifests'."""
    for pod in pods().values():
        for volume in pod["volumes"]:
            if "persistentVolumeClaim" in volume:
                manifest("PersistentVolumeClaim", volume["persistentVolumeClaim"]["claimName"])


@pytest.mark.parametrize("service", pods())
def test_what_outlives_a_container_is_what_does_in_compose(service):
    """Volumes of compose are claims (or shared by two containers of one pod), mounted at the same places."""
    there = {
        tuple(volume.split(":")[:2])
        for volume in services()[service].get("volumes", [])
        if not volume.startswith(".")
    }
    lasting = claimed(service) | {
        volume["name"]
        for volume in pods()[service]["volumes"]
        if "persistentVolumeClaim" in volume or volume["name"] == "twin"
    }
    here = {mount["mountPath"] for mount in container(service)["volumeMounts"] if mount["name"] in lasting}
    assert here == {path for _, path in there}
    assert {name for name, _ in there} <= set(raw()["volumes"])


@pytest.mark.parametrize("service", pods())
def test_images_and_users_are_those_of_compose(service):
    tags = {
        image["name"]: image["newTag"]
        for folder in PARTS.values()
        for image in kustomization(folder)["images"]
    }
    name = container(service)["image"]
    assert f"{name}:{tags[name]}" == services()[service]["image"]
    user = pods()[service]["securityContext"]
    assert services()[service]["user"] == f"{user['runAsUser']}:{user['runAsGroup']}"


@pytest.mark.parametrize("service", pods())
def test_memory_limits_are_those_of_compose(service):
    here = in_bytes(container(service)["resources"]["limits"]["memory"])
    there = in_bytes(settings()[re.findall(r"\{(\w+)", services()[service]["mem_limit"])[0]])
    # The head has Ray's dashboard on Kubernetes, which takes the job.
    assert here == (2 * there if service == "head" else there)


def in_bytes(size: str) -> int:
    match = re.fullmatch(r"(\d+)(\w+)", size)
    assert match is not None
    return int(match[1]) * UNITS[match[2]]


@pytest.mark.parametrize("service", ["robot-twin", "robot-learner", "robot"])
def test_commands_are_those_of_compose(service):
    command = [word.replace("$$", "$") for word in services()[service]["command"]]
    assert container(service)["command"] == command


def test_what_is_left_out_is_said_to_be():
    assert set(services()) - set(pods()) == LEFT_OUT
    text = (ROOT / "docs/deploy.md").read_text(encoding="utf-8").partition("## Kubernetes")[2]
    for name in LEFT_OUT:
        assert name in text.partition("left out")[0].rpartition("\n\n")[2], name


@pytest.mark.parametrize("service", pods())
def test_settings_and_secrets_are_those_of_compose(service):
    """Each service reads the same, secrets from the Secret; KubeRay makes Ray's token itself."""
    environment = {item["name"]: item for item in container(service).get("env", [])}
    wanted = services()[service]["environment"]
    names = {name for name in wanted if name.startswith(("REDIS_", "TASKSCHEMA_", "GF_"))}
    assert names <= set(environment)
    defaults = settings()
    for name in names:
        value = wanted[name]
        secrets = [each for each in variables(value) if each.endswith(("_PASSWORD", "_TOKEN"))]
        if name.endswith("REDIS_URL"):
            assert environment[name]["value"] == value.replace("${", "$(").replace("}", ")")
        elif secrets:
            assert environment[name]["valueFrom"]["secretKeyRef"] == {"name": "taskschema", "key": secrets[0]}
        elif name != "TASKSCHEMA_LOG_FORMAT":  # compose's logs are for a person's eyes
            (setting,) = variables(value) or [None]
            assert environment[name]["value"] == (defaults[setting] if setting else value)
    for item in environment.values():
        if "valueFrom" in item:
            assert item["valueFrom"]["secretKeyRef"]["key"] in defaults


def test_the_cluster_asks_for_rays_token():
    assert manifest("RayCluster", "taskschema")["spec"]["authOptions"] == {"mode": "token"}


def test_ports_are_those_of_compose():
    assert container("redis")["ports"] == [{"containerPort": 6379}]
    assert manifest("Service", "redis")["spec"]["ports"][0]["port"] == 6379
    (published,) = services()["api"]["ports"]
    assert published.endswith(f":{container('api')['ports'][0]['containerPort']}")
    assert manifest("Service", "api")["spec"]["ports"][0]["port"] == 8420
    for service, port in (("prometheus", 9090), ("grafana", 3000)):
        assert [each["containerPort"] for each in container(service)["ports"]] == [port]
        assert manifest("Service", service)["spec"]["ports"] == [{"name": "http", "port": port}]
        assert f"127.0.0.1:{port}/" in services()[service]["healthcheck"]["test"][-1]
    assert services()["grafana"]["ports"][0].endswith(":3000")
    head = {port["name"]: port["containerPort"] for port in container("head")["ports"]}
    assert services()["worker"]["environment"]["RAY_HEAD"] == f"head:{head['gcs-server']}"


@pytest.mark.parametrize("service", ["redis", "robot-twin", "robot-learner", "robot"])
def test_checks_by_command_are_those_of_compose(service):
    check = services()[service]["healthcheck"]
    probe = container(service)["startupProbe" if service == "robot-twin" else "readinessProbe"]
    assert probe["exec"]["command"] == ["sh", "-c", check["test"][1].replace("$$", "$")]
    assert f"{probe['periodSeconds']}s" == check["interval"]
    assert f"{probe['timeoutSeconds']}s" == check["timeout"]


@pytest.mark.parametrize("service", ["api", "prometheus", "grafana"])
def test_checks_by_http_are_those_of_compose(service):
    check = services()[service]["healthcheck"]
    probe = container(service)["readinessProbe"]
    (port,) = container(service)["ports"]
    assert probe["httpGet"]["port"] == port["name"]
    assert f"http://127.0.0.1:{port['containerPort']}{probe['httpGet']['path']}" in check["test"][-1]
    assert f"{probe['periodSeconds']}s" == check["interval"]
    assert f"{probe['timeoutSeconds']}s" == check["timeout"]


def test_an_agent_of_simulated_arms_ends_with_its_run_and_starts_after_its_twin():
    """As compose's `restart: on-failure` and its `depends_on`."""
    for service in ("robot", "robot-learner"):
        assert services()[service]["restart"] == "on-failure"
        assert workload(service)["kind"] == "Job"
        assert pods()[service]["restartPolicy"] == "OnFailure"
    assert pods()["robot"]["hostname"] == services()["robot"]["hostname"]
    (twin,) = pods()["robot"]["initContainers"]
    assert twin["restartPolicy"] == "Always"
    assert services()["robot"]["depends_on"]["robot-twin"] == {"condition": "service_healthy"}
    for service in TOGETHER["robot"]:
        assert {"name": "twin", "mountPath": "/twin"} in container(service)["volumeMounts"]


def test_the_cluster_has_the_packages_version_of_ray_and_places_the_job():
    cluster, job = manifest("RayCluster", "taskschema"), manifest("RayJob", "train")
    assert f"ray=={cluster['spec']['rayVersion']}\n" in (ROOT / "requirements.lock").read_text()
    assert job["spec"]["clusterSelector"] == {"ray.io/cluster": cluster["metadata"]["name"]}
    groups = {group["groupName"]: group for group in cluster["spec"]["workerGroupSpecs"]}
    offered = json.loads(json.loads(groups["learner"]["rayStartParams"]["resources"]))
    assert json.loads(job["spec"]["entrypointResources"]) == offered
    training = "/opt/taskschema/deploy/train.sh $TASKSCHEMA_OPTIONS"
    assert training in job["spec"]["entrypoint"]
    assert training in services()["learner"]["command"][-1].replace("$$", "$")
    assert "train.sh" in (ROOT / "deploy/docker/learner.Dockerfile").read_text()
    runs = {mount["name"]: mount["mountPath"] for mount in container("learner")["volumeMounts"]}
    assert f"runs:{runs['runs']}" in services()["learner"]["volumes"]
    assert "runs" in raw()["volumes"]


def built(folder: Path) -> list[dict[str, Any]]:
    if shutil.which("kubectl") is None:
        pytest.skip("kubectl, whose `kustomize` builds the manifests, is not installed here")
    done = subprocess.run(["kubectl", "kustomize", str(folder)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return list(yaml.safe_load_all(done.stdout))


@pytest.mark.parametrize("part", PARTS)
def test_kustomize_builds_them(tmp_path, part):
    shutil.copytree(ROOT / "deploy", tmp_path / "deploy")
    base = tmp_path / "deploy/kubernetes"
    lines = [
        f"{name}={value}" for name, value in settings().items() if name.endswith(("_PASSWORD", "_TOKEN"))
    ]
    (base / "secrets.env").write_text("\n".join(lines))
    documents = built(base / part)
    assert {each["metadata"].get("namespace", "taskschema") for each in documents} == {"taskschema"}
    for each in documents:
        if each["kind"] not in SPECS:
            kubernetes_validate.validate(each, KUBERNETES, strict=True)
    if part == "":
        kinds = {each["kind"] for each in documents}
        assert kinds >= {"Secret", "RayCluster", "RayJob", "StatefulSet", "Deployment"}


@pytest.mark.parametrize("service", ["prometheus", "grafana"])
def test_what_compose_mounts_from_the_repository_is_in_config_maps_at_the_same_places(service):
    documents = built(PARTS["monitoring"])
    maps = {each["metadata"]["name"]: each["data"] for each in documents if each["kind"] == "ConfigMap"}
    (pod,) = [
        each["spec"]["template"]["spec"]
        for each in documents
        if each["kind"] == "StatefulSet" and each["metadata"]["name"] == service
    ]
    places = {mount["name"]: Path(mount["mountPath"]) for mount in pod["containers"][0]["volumeMounts"]}
    here = {
        places[volume["name"]] / name: text
        for volume in pod["volumes"]
        if "configMap" in volume
        for name, text in maps[volume["configMap"]["name"]].items()
    }
    there = {}
    for mount in services()[service]["volumes"]:
        source, target = mount.split(":")[:2]
        if source.startswith("."):
            for file in (ROOT / source).rglob("*"):
                if file.is_file() and file.name not in ("kustomization.yaml", "alerts_test.yml"):
                    there[Path(target) / file.relative_to(ROOT / source)] = file.read_text(encoding="utf-8")
    assert here == there
