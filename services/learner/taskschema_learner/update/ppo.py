"""Proximal policy optimisation (Schulman et al., 2017), as the paper uses it."""

from typing import ClassVar

from torch import Tensor

from taskschema.config import PPOConfig
from taskschema_learner.update.batch import Samples
from taskschema_learner.update.losses import clipped_policy_loss, clipped_value_loss, normalise


class PPO:
    """Clipped surrogate loss and clipped value loss, several epochs over each batch."""

    name: ClassVar[str] = "ppo"

    def __init__(self, config: PPOConfig) -> None:
        self._config = config
        self.epochs = config.epochs
        self.gae_lambda = config.gae_lambda

    def policy_loss(self, log_probabilities: Tensor, samples: Samples) -> tuple[Tensor, Tensor]:
        """Return `clipped_policy_loss` with advantages normalised over the minibatch."""
        advantages = normalise(samples.advantages, self._config.advantage_std_floor)
        log_ratio = log_probabilities - samples.old_log_probabilities
        return clipped_policy_loss(log_ratio, advantages, self._config.clip)

    def value_loss(self, values: Tensor, samples: Samples) -> tuple[Tensor, Tensor]:
        """Return `clipped_value_loss`."""
        return clipped_value_loss(values, samples.old_values, samples.returns, self._config.value_clip)
