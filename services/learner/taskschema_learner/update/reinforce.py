"""REINFORCE (Williams, 1992), the policy gradient that the paper's section III explains."""

from typing import ClassVar

from torch import Tensor

from taskschema.config import PPOConfig
from taskschema_learner.update.batch import Samples
from taskschema_learner.update.losses import clipped_value_loss


class Reinforce:
    """grad J = E[r(tau) grad log pi(tau)] as it stands in the paper: successes alone move the policy.

    No baseline is taken off: a Gaussian that is pushed away from failures has no bound.
    """

    name: ClassVar[str] = "reinforce"
    epochs: int = 1
    """A second pass would no longer be on the policy that acted."""
    gae_lambda: float = 1.0
    """Whole returns: nothing is bootstrapped."""

    def __init__(self, config: PPOConfig) -> None:
        """Take the config as every algorithm does; REINFORCE has no settings of its own."""

    def policy_loss(self, log_probabilities: Tensor, samples: Samples) -> tuple[Tensor, Tensor]:
        """Return L = -mean(r log pi), r the discounted return from each step on, and dL / d log pi."""
        returns = samples.returns
        return -(returns * log_probabilities).mean(), -returns / len(returns)

    def value_loss(self, values: Tensor, samples: Samples) -> tuple[Tensor, Tensor]:
        """Return half the mean squared error and its gradient; the policy does not use the value."""
        return clipped_value_loss(values, samples.old_values, samples.returns, None)
