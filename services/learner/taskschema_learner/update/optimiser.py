"""One round's update of the argument network: the same loop for every policy and algorithm."""

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from taskschema.arrays import AnyArray, FloatArray
from taskschema.config import PPOConfig
from taskschema.errors import ConfigError
from taskschema_learner.networks.argument_network import ArgumentNetwork
from taskschema_learner.networks.spatial_network import SpatialNetwork
from taskschema_learner.update.advantages import generalised_advantages
from taskschema_learner.update.algorithms import make_algorithm
from taskschema_learner.update.batch import Batch, Samples


@dataclass(frozen=True)
class UpdateStatistics:
    """What one update did; see `taskschema.metrics.RoundMetrics` for the meanings."""

    policy_loss: float
    value_loss: float
    argument_entropy: float
    approximate_kl: float
    clip_fraction: float
    gradient_norm: float


class Optimiser:
    """Adam on a network's flat parameter vector, over shuffled minibatches of a batch.

    Pairs enter the loss only where the network itself chooses them (`state` policy): elsewhere the schema's
    logits are constants, which change no gradient (paper, section III).
    """

    def __init__(self, network: ArgumentNetwork | SpatialNetwork, config: PPOConfig) -> None:
        self._network = network
        self._config = config
        self._algorithm = make_algorithm(config)
        self._adam = torch.optim.Adam(
            [network.flat], lr=config.learning_rate, eps=config.adam_epsilon, fused=True
        )

    def update(self, batch: Batch, rng: np.random.Generator) -> UpdateStatistics:
        """Train on a batch that the network's present weights acted in; `rng` shuffles the minibatches.

        Raises:
            ConfigError: if that leads to weights that are not finite.

        """
        samples = self._samples(batch)
        policy_losses, value_losses, norms = [], [], []
        for _ in range(self._algorithm.epochs):
            order = torch.from_numpy(rng.permutation(len(batch.pairs)))
            for minibatch in _split(samples, order.to(samples.inputs.device), self._config.minibatches):
                policy_loss, value_loss, norm = self._step(minibatch)
                policy_losses.append(policy_loss)
                value_losses.append(value_loss)
                norms.append(norm)
        if not self._network.flat.isfinite().all():
            raise ConfigError(
                "This round's update led to weights that are not finite, and is not kept: "
                "start a new run with a lower ppo.learning_rate."
            )
        return self._statistics(samples, [policy_losses, value_losses, norms])

    def _samples(self, batch: Batch) -> Samples:
        like = self._network.flat
        inputs = self._network.inputs(batch.inputs)
        arguments, used = (torch.from_numpy(array).to(like) for array in (batch.arguments, batch.used))
        pairs = torch.from_numpy(batch.pairs).to(like.device)
        with torch.no_grad():
            terms = self._network.terms(inputs, arguments, used)
            old = terms.log_probability(pairs)
        values = terms.value.cpu().numpy().astype(np.float64)
        advantages = generalised_advantages(
            batch.rewards, batch.padded(values), batch.lengths, self._config.gamma, self._algorithm.gae_lambda
        )[batch.inside]
        return Samples(
            inputs=inputs,
            pairs=pairs,
            arguments=arguments,
            used=used,
            old_log_probabilities=old,
            old_values=terms.value,
            advantages=torch.from_numpy(advantages).to(like),
            returns=torch.from_numpy(advantages + values).to(like),
        )

    def _step(self, samples: Samples) -> tuple[Tensor, Tensor, Tensor]:
        """Take one gradient step on one minibatch: policy loss, value loss, gradient norm.

        loss = policy loss - c_entropy mean(entropy) + c_value value loss
        """
        terms = self._network.terms(samples.inputs, samples.arguments, samples.used)
        log_probability, entropy = terms.log_probability(samples.pairs), terms.entropy()
        policy_loss, by_log_probability = self._algorithm.policy_loss(log_probability.detach(), samples)
        value_loss, by_value = self._algorithm.value_loss(terms.value.detach(), samples)
        by_entropy = torch.full_like(entropy, -self._config.entropy_coefficient / len(entropy))
        (gradient,) = torch.autograd.grad(
            (log_probability, entropy, terms.value),
            self._network.flat,
            (by_log_probability, by_entropy, by_value * self._config.value_coefficient),
        )
        norm = torch.linalg.vector_norm(gradient)
        gradient *= (self._config.max_gradient_norm / (norm + 1e-6)).clamp_(max=1.0)
        self._network.flat.grad = gradient
        self._adam.step()
        return policy_loss, value_loss, norm

    def _statistics(self, samples: Samples, series: list[list[Tensor]]) -> UpdateStatistics:
        with torch.no_grad():
            terms = self._network.terms(samples.inputs, samples.arguments, samples.used)
            log_ratio = terms.log_probability(samples.pairs) - samples.old_log_probabilities
            outside = (log_ratio.exp() - 1.0).abs() > self._config.clip
            means = [torch.stack(values).mean() for values in series]
        return UpdateStatistics(
            policy_loss=float(means[0]),
            value_loss=float(means[1]),
            argument_entropy=float(terms.argument_entropy.mean()),
            approximate_kl=float(-log_ratio.mean()),
            clip_fraction=float(outside.double().mean()),
            gradient_norm=float(means[2]),
        )

    def arrays(self) -> dict[str, AnyArray]:
        """Return Adam's moments and step count, for a checkpoint."""
        state = self._adam.state.get(self._network.flat)
        size = self._network.flat.numel()
        if not state:
            return {"first": np.zeros(size), "second": np.zeros(size), "steps": np.zeros(())}
        return {
            "first": state["exp_avg"].cpu().numpy().copy(),
            "second": state["exp_avg_sq"].cpu().numpy().copy(),
            "steps": np.array(float(state["step"])),
        }

    def load(self, arrays: dict[str, AnyArray]) -> None:
        """Take over what `arrays` returned."""
        flat = self._network.flat
        steps = torch.tensor(float(arrays["steps"]), dtype=torch.float32, device=flat.device)
        self._adam.state[flat] = {
            "step": steps,
            "exp_avg": _like(arrays["first"], flat),
            "exp_avg_sq": _like(arrays["second"], flat),
        }


def _like(array: FloatArray, flat: Tensor) -> Tensor:
    if array.shape != tuple(flat.shape):
        raise ValueError(f"Adam's moments have shape {array.shape}, this network has {tuple(flat.shape)}.")
    return torch.from_numpy(array.copy()).to(flat.detach())


def _split(samples: Samples, order: Tensor, parts: int) -> list[Samples]:
    """Return the samples in this order, in so many parts of sizes as equal as they can be; none is empty."""
    parts = min(parts, len(order))
    shuffled = {
        name: value.index_select(0, order).tensor_split(parts) for name, value in vars(samples).items()
    }
    return [Samples(**{name: values[part] for name, values in shuffled.items()}) for part in range(parts)]
