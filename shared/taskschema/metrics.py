"""What a run reports after every round: one row of `metrics.csv`, of the curve and of the event stream."""

import msgspec


class RoundMetrics(msgspec.Struct, frozen=True, kw_only=True):
    """Facts about one round and the update made from it."""

    round: int
    """Round, from 0."""
    policy_version: int
    """Version after the round's update: round + 1."""
    episodes: int
    """Episodes of the run so far, this round included."""
    steps: int
    """Skill pairs executed so far."""
    physics_steps: int
    """Physics steps computed in this round."""
    diverged: int
    """Episodes of this round whose simulation broke down."""
    quarantined: int
    """Messages refused so far."""
    success_rate: float
    """Share of successful episodes in this round."""
    success_last_100: float
    """Share of successful episodes among the last 100, in the order of slots (0 while there are fewer)."""
    schema_entropy: tuple[float, ...]
    """Entropy of each schema row [nat]."""
    schema_probability: tuple[float, ...]
    """Probability of each row's most probable pair."""
    policy_loss: float
    value_loss: float
    argument_entropy: float
    """Mean entropy of the chosen arguments' distribution [nat]."""
    approximate_kl: float
    """Mean of log old probability minus log new probability after the update [nat]."""
    clip_fraction: float
    """Share of probability ratios outside the clipping range."""
    gradient_norm: float
    """Mean norm of the gradient before clipping."""
    seconds_collect: float
    """Wall time from opening the round to its last slot [s]."""
    seconds_update: float
    """Wall time of the update [s]."""
    seconds_checkpoint: float = 0.0
    """Wall time of checkpoint and publishing [s]; 0 in the checkpoint itself."""
    sha256: str
    """Hash of the policy after the update."""
    refused: int = 0
    """Steps of this round that a safety gate refused."""
    seconds_publish: float = 0.0
    """Wall time of publishing the round's policy and offering its slots [s], part of `seconds_collect`."""


TIMING_FIELDS = ("seconds_collect", "seconds_update", "seconds_checkpoint", "seconds_publish")
"""Fields that differ between two computations of the same run."""
