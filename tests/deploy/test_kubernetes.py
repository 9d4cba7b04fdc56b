"""The Kubernetes manifests: their structure, and that they say the same as the compose file.

They were never applied to a cluster by these tests.
"""

import copy
import json
import re
import shutil
import subprocess
from typing import Any

import kubernetes_validate
import pytest
import yaml
from compose_file import ROOT, raw, services, settings
from kuberay_fields import SPECS, wrong_fields

FOLDER = ROOT / "deploy/kubernetes"
KUBERNETES = "1.34"
LEFT_OUT = {"tools", "robot-twin", "robot-learner", "robot", "prometheus", "grafana"}
"""Services of compose that the manifests have not, and docs/deploy.md says so."""
UNITS = {"m": 2**20, "g": 2**30, "Mi": 2**20, "Gi": 2**30}


def kustomization() -> dict[str, Any]:
    loaded: dict[str, Any] = yaml.safe_load((FOLDER / "kustomization.yaml").read_text())
    return loaded


def manifests() -> list[dict[str, Any]]:
    return [
        document
        for name in kustomization()["resources"]
        for document in yaml.safe_load_all((FOLDER / name).read_text())
    ]


def manifest(kind: str, name: str) -> dict[str, Any]:
    (found,) = [each for each in manifests() if (each["kind"], each["metadata"]["name"]) == (kind, name)]
    return found


def pods() -> dict[str, dict[str, Any]]:
    """Return the pod of each service, by the service's name in the compose file."""
    cluster = manifest("RayCluster", "taskschema")["spec"]
    groups = {group["groupName"]: group["template"]["spec"] for group in cluster["workerGroupSpecs"]}
    return {
        "redis": manifest("StatefulSet", "redis")["spec"]["template"]["spec"],
        "api": manifest("Deployment", "api")["spec"]["template"]["spec"],
        "head": cluster["headGroupSpec"]["template"]["spec"],
        **groups,
    }


def container(service: str) -> dict[str, Any]:
    (only,) = pods()[service]["containers"]
    found: dict[str, Any] = only
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
    mounted = {mount["name"] for mount in container(service)["volumeMounts"]}
    claimed = {
        each["metadata"]["name"] for each in manifest("StatefulSet", "redis")["spec"]["volumeClaimTemplates"]
    }
    assert mounted - (claimed if service == "redis" else set()) == {
        volume["name"] for volume in pod["volumes"]
    }


@pytest.mark.parametrize("service", pods())
def test_images_and_users_are_those_of_compose(service):
    tags = {image["name"]: image["newTag"] for image in kustomization()["images"]}
    name = container(service)["image"]
    assert f"{name}:{tags[name]}" == services()[service]["image"]
    uid = pods()[service]["securityContext"]["runAsUser"]
    assert services()[service]["user"].split(":")[0] == str(uid)


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


def test_what_is_left_out_is_said_to_be():
    assert set(services()) - set(pods()) == LEFT_OUT
    text = (ROOT / "docs/deploy.md").read_text(encoding="utf-8").partition("## Kubernetes")[2]
    for name in ("Prometheus", "Grafana", "robot", "tools"):
        assert name in text.partition("left out")[0].rpartition("\n\n")[2], name


def test_secrets_are_those_of_compose():
    """Each service reads the same secrets; KubeRay makes Ray's token itself."""
    for service, pod in pods().items():
        environment = {item["name"]: item for item in pod["containers"][0].get("env", [])}
        wanted = services()[service]["environment"]
        names = {
            name
            for name in wanted
            if name.startswith(("REDIS_", "TASKSCHEMA_")) and name != "TASKSCHEMA_OPTIONS"
        }
        assert names <= set(environment), service
        for name, value in wanted.items():
            if name.endswith("REDIS_URL"):
                assert environment[name]["value"] == value.replace("${", "$(").replace("}", ")")
        for name, item in environment.items():
            if "valueFrom" in item:
                assert item["valueFrom"]["secretKeyRef"] == {"name": "taskschema", "key": name}
                assert name in settings()
    assert manifest("RayCluster", "taskschema")["spec"]["authOptions"] == {"mode": "token"}


def test_ports_are_those_of_compose():
    assert container("redis")["ports"] == [{"containerPort": 6379}]
    assert manifest("Service", "redis")["spec"]["ports"][0]["port"] == 6379
    (published,) = services()["api"]["ports"]
    assert published.endswith(f":{container('api')['ports'][0]['containerPort']}")
    assert manifest("Service", "api")["spec"]["ports"][0]["port"] == 8420
    head = {port["name"]: port["containerPort"] for port in container("head")["ports"]}
    assert services()["worker"]["environment"]["RAY_HEAD"] == f"head:{head['gcs-server']}"


def test_health_checks_are_those_of_compose():
    compose = services()
    (_, command) = compose["redis"]["healthcheck"]["test"]
    assert container("redis")["readinessProbe"]["exec"]["command"][-1] == command.replace("$$", "$")
    path = container("api")["readinessProbe"]["httpGet"]["path"]
    assert f"8420{path}'" in compose["api"]["healthcheck"]["test"][-1]
    for service in ("redis", "api"):
        assert (
            f"{container(service)['readinessProbe']['periodSeconds']}s"
            == compose[service]["healthcheck"]["interval"]
        )


def test_the_cluster_has_the_packages_version_of_ray_and_places_the_job():
    cluster, job = manifest("RayCluster", "taskschema"), manifest("RayJob", "train")
    assert f"ray=={cluster['spec']['rayVersion']}\n" in (ROOT / "requirements.lock").read_text()
    assert job["spec"]["clusterSelector"] == {"ray.io/cluster": cluster["metadata"]["name"]}
    groups = {group["groupName"]: group for group in cluster["spec"]["workerGroupSpecs"]}
    offered = json.loads(json.loads(groups["learner"]["rayStartParams"]["resources"]))
    assert json.loads(job["spec"]["entrypointResources"]) == offered
    assert "/opt/taskschema/deploy/train.sh" in job["spec"]["entrypoint"]
    assert "train.sh" in (ROOT / "deploy/docker/learner.Dockerfile").read_text()
    runs = {mount["name"]: mount["mountPath"] for mount in container("learner")["volumeMounts"]}
    assert f"runs:{runs['runs']}" in services()["learner"]["volumes"]
    assert "runs" in raw()["volumes"]


def test_kustomize_builds_them(tmp_path):
    if shutil.which("kubectl") is None:
        pytest.skip("kubectl, whose `kustomize` builds the manifests, is not installed here")
    folder = tmp_path / "kubernetes"
    shutil.copytree(FOLDER, folder)
    lines = [
        f"{name}={value}" for name, value in settings().items() if name.endswith(("_PASSWORD", "_TOKEN"))
    ]
    (folder / "secrets.env").write_text("\n".join(lines))
    done = subprocess.run(["kubectl", "kustomize", str(folder)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    built = list(yaml.safe_load_all(done.stdout))
    assert {each["metadata"].get("namespace", "taskschema") for each in built} == {"taskschema"}
    assert {each["kind"] for each in built} >= {"Secret", "RayCluster", "RayJob", "StatefulSet", "Deployment"}
