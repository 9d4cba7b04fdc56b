"""REINFORCE (Williams, 1992), the policy gradient that the paper's section III explains."""

from typing import ClassVar

from torch import Tensor

from taskschema.config import PPOConfig
from taskschema_learner.losses import clipped_value_loss


class Reinforce:
    """-mean(A log pi), once over each batch; the advantages are whole returns less the critic's value."""

    name: ClassVar[str] = "reinforce"
    epochs: int = 1
    """A second pass would no longer be on the policy that acted."""
    gae_lambda: float = 1.0
    """Whole returns: nothing is bootstrapped."""

    def __init__(self, config: PPOConfig) -> None:
        self._config = config

    def policy_loss(self, log_probabilities: Tensor, old: Tensor, advantages: Tensor) -> Tensor:
        """Return the loss whose gradient is that of the likelihood ratio trick; `old` is not read."""
        return -(advantages * log_probabilities).mean()

    def value_loss(self, values: Tensor, old: Tensor, returns: Tensor) -> Tensor:
        """Return half the mean squared error."""
        return clipped_value_loss(values, old, returns, None)
