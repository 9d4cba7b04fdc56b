"""The policy of a run, whatever it observes."""

from taskschema.config import RunConfig
from taskschema.policies.image_policy import ImagePolicy
from taskschema.policies.policy import ActingPolicy, Policy
from taskschema.policies.snapshot import PolicySnapshot
from taskschema.tasks.task import Task


def policy_of(config: RunConfig, task: Task, snapshot: PolicySnapshot) -> ActingPolicy:
    """Return a policy version of a run, ready to act on the run's kind of observation."""
    if config.observation == "image":
        return ImagePolicy(snapshot, task, config.image.trunk)
    return Policy(snapshot, task.pairs, task.observation)
