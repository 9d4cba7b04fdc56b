"""What the losses need of actions."""

from dataclasses import dataclass

from torch import Tensor

from taskschema_learner.update.losses import pair_entropy, pair_log_probability


@dataclass(frozen=True)
class ActionTerms:
    """What a network says about B actions, as tensors that carry gradients."""

    argument_log_probability: Tensor
    """[B] log-density of the arguments."""
    argument_entropy: Tensor
    """[B, nat] of their distributions."""
    value: Tensor
    """[B] expected return."""
    pair_logits: Tensor | None = None
    """[B, |X|] logits over skill pairs, of the `state` policy only."""

    def log_probability(self, pairs: Tensor) -> Tensor:
        """Return that of the actions [B], with that of their pairs [B] only if the network chose them."""
        if self.pair_logits is None:
            return self.argument_log_probability
        return self.argument_log_probability + pair_log_probability(self.pair_logits, pairs)

    def entropy(self) -> Tensor:
        """Return that of the distributions [B, nat], with the pairs' only if the network chooses them."""
        if self.pair_logits is None:
            return self.argument_entropy
        return self.argument_entropy + pair_entropy(self.pair_logits)
