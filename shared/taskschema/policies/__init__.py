"""Policies: the argument network in numpy, actions, and the snapshot that travels."""

from taskschema.policies.policy import Actions, Policy
from taskschema.policies.snapshot import PolicySnapshot

__all__ = ["Actions", "Policy", "PolicySnapshot"]
