"""Fields of KubeRay's RayCluster and RayJob (1.5.1 or newer) that the manifests may use, and their types.

Its own schemas, the CRDs of github.com/ray-project/kuberay (Apache-2.0), hold the whole of Kubernetes' pods
and are some megabytes; pods are checked against Kubernetes' schemas instead. These fields come from
`ray-operator/apis/ray/v1/raycluster_types.go` and `rayjob_types.go`.
"""

from collections.abc import Mapping
from typing import Any

POD_TEMPLATE = "pod template"
"""Checked as a pod elsewhere."""
TEXTS = "texts"
"""A map of texts, whose names are free."""

HEAD_GROUP: Mapping[str, Any] = {"rayStartParams": TEXTS, "serviceType": str, "template": POD_TEMPLATE}
WORKER_GROUP: Mapping[str, Any] = {
    "groupName": str,
    "replicas": int,
    "minReplicas": int,
    "maxReplicas": int,
    "numOfHosts": int,
    "rayStartParams": TEXTS,
    "template": POD_TEMPLATE,
}
SPECS: Mapping[str, Mapping[str, Any]] = {
    "RayCluster": {
        "rayVersion": str,
        "authOptions": {"mode": ("disabled", "token")},
        "suspend": bool,
        "enableInTreeAutoscaling": bool,
        "headServiceAnnotations": TEXTS,
        "headGroupSpec": HEAD_GROUP,
        "workerGroupSpecs": [WORKER_GROUP],
    },
    "RayJob": {
        "clusterSelector": TEXTS,
        "submissionMode": ("K8sJobMode", "HTTPMode", "InteractiveMode"),
        "entrypoint": str,
        "entrypointResources": str,
        "entrypointNumCpus": float,
        "runtimeEnvYAML": str,
        "jobId": str,
        "metadata": TEXTS,
        "backoffLimit": int,
        "activeDeadlineSeconds": int,
        "shutdownAfterJobFinishes": bool,
        "ttlSecondsAfterFinished": int,
        "suspend": bool,
    },
}


def wrong_fields(value: Any, expected: Any, where: str) -> list[str]:
    """Return what does not fit, each as the place and what is there."""
    if expected == POD_TEMPLATE:
        return wrong_fields(value, {"metadata": dict, "spec": dict}, where)
    if expected == TEXTS:
        fits = isinstance(value, dict) and all(isinstance(each, str) for each in value.values())
        return [] if fits else [f"{where}: {value!r}"]
    if isinstance(expected, tuple):
        return [] if value in expected else [f"{where}: {value!r}"]
    if isinstance(expected, type):
        return [] if type(value) is expected else [f"{where}: {value!r}"]
    if isinstance(expected, list):
        return [
            line
            for number, each in enumerate(value)
            for line in wrong_fields(each, expected[0], f"{where}[{number}]")
        ]
    unknown = [f"{where}.{name}: no such field" for name in value if name not in expected]
    known = [name for name in value if name in expected]
    return unknown + [
        line for name in known for line in wrong_fields(value[name], expected[name], f"{where}.{name}")
    ]
