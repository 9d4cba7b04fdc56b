"""Policies: the argument networks in numpy, actions, and the snapshot that travels."""

from taskschema.policies.image_policy import ImagePolicy
from taskschema.policies.of_run import policy_of
from taskschema.policies.policy import ActingPolicy, Actions, Actor, Policy
from taskschema.policies.snapshot import PolicySnapshot

__all__ = ["ActingPolicy", "Actions", "Actor", "ImagePolicy", "Policy", "PolicySnapshot", "policy_of"]
