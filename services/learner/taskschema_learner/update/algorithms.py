"""The policy gradients by name: the method is agnostic to which one trains the network (paper, IV-A)."""

from collections.abc import Callable
from typing import ClassVar, Protocol

from torch import Tensor

from taskschema.config import PPOConfig
from taskschema.errors import UnknownNameError
from taskschema_learner.update.batch import Samples
from taskschema_learner.update.ppo import PPO
from taskschema_learner.update.reinforce import Reinforce


class Algorithm(Protocol):
    """What turns a batch into a loss of the network's policy and value.

    Both losses come with their gradients written out: minibatches are so small that autograd's bookkeeping of
    a dozen operations would cost more than the network itself.
    """

    name: ClassVar[str]
    """Name in `config.ppo.algorithm`."""

    @property
    def epochs(self) -> int:
        """How often an update passes over its batch."""
        ...

    @property
    def gae_lambda(self) -> float:
        """Lambda of the advantages that it takes."""
        ...

    def policy_loss(self, log_probabilities: Tensor, samples: Samples) -> tuple[Tensor, Tensor]:
        """Return the scalar to minimise for the policy and its gradient [B] by the log-probabilities [B]."""
        ...

    def value_loss(self, values: Tensor, samples: Samples) -> tuple[Tensor, Tensor]:
        """Return the scalar to minimise for the critic and its gradient [B] by the values [B]."""
        ...


ALGORITHMS: dict[str, Callable[[PPOConfig], Algorithm]] = {item.name: item for item in (PPO, Reinforce)}
"""All of them; a new one is a file and an entry here."""


def make_algorithm(config: PPOConfig) -> Algorithm:
    """Return the algorithm that the config names.

    Raises:
        UnknownNameError: if there is none of this name.

    """
    if config.algorithm not in ALGORITHMS:
        raise UnknownNameError("algorithm", config.algorithm, ALGORITHMS)
    return ALGORITHMS[config.algorithm](config)
