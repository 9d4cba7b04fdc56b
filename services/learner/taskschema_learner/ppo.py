"""Proximal policy optimisation (Schulman et al., 2017), as the paper uses it."""

from typing import ClassVar

from torch import Tensor

from taskschema.config import PPOConfig
from taskschema_learner.losses import clipped_policy_loss, clipped_value_loss


class PPO:
    """Clipped surrogate loss and clipped value loss, several epochs over each batch."""

    name: ClassVar[str] = "ppo"

    def __init__(self, config: PPOConfig) -> None:
        self._config = config
        self.epochs = config.epochs
        self.gae_lambda = config.gae_lambda

    def policy_loss(self, log_probabilities: Tensor, old: Tensor, advantages: Tensor) -> Tensor:
        """Return `clipped_policy_loss`."""
        return clipped_policy_loss(log_probabilities - old, advantages, self._config.clip)

    def value_loss(self, values: Tensor, old: Tensor, returns: Tensor) -> Tensor:
        """Return `clipped_value_loss`."""
        return clipped_value_loss(values, old, returns, self._config.value_clip)
