"""Stable-Baselines3's PPO on this project's network and on one of its batches, for comparison."""

from collections.abc import Callable

import gymnasium
import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.distributions import Distribution
from stable_baselines3.common.logger import configure
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.vec_env import DummyVecEnv
from torch import nn

from taskschema.arrays import Float32Array
from taskschema.config import PPOConfig
from taskschema_learner.update.batch import Batch


class _Spaces(gymnasium.Env):
    """Observation and action space, which is all that PPO needs to train on a filled buffer."""

    def __init__(self, observations: int, arguments: int) -> None:
        self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (observations,))
        self.action_space = gymnasium.spaces.Box(-1, 1, (arguments,))


class _SharedTrunk(nn.Module):
    """The paper's trunk in front of both actor and critic."""

    def __init__(self, inputs: int, hidden: tuple[int, ...]) -> None:
        super().__init__()
        layers: list[nn.Module] = []
        for size_in, size_out in zip((inputs, *hidden), hidden, strict=False):
            layers += [nn.Linear(size_in, size_out), nn.ReLU()]
        self.layers = nn.Sequential(*layers)
        self.latent_dim_pi = self.latent_dim_vf = hidden[-1]

    def forward(self, features: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        latent = self.layers(features)
        return latent, latent


class TwinPolicy(ActorCriticPolicy):
    """Stable-Baselines3's policy with this project's network: a shared trunk, variance from the state."""

    HIDDEN = (64, 64, 64, 64)

    def _build_mlp_extractor(self) -> None:
        self.mlp_extractor = _SharedTrunk(self.features_dim, self.HIDDEN)
        self.log_std_net = nn.Linear(self.HIDDEN[-1], self.action_space.shape[0])

    def extract_features(
        self, obs: torch.Tensor, features_extractor: nn.Module | None = None
    ) -> torch.Tensor:
        return obs  # its own would cast to float32

    def _get_action_dist_from_latent(self, latent_pi: torch.Tensor) -> Distribution:
        return self.action_dist.proba_distribution(self.action_net(latent_pi), self.log_std_net(latent_pi))


def _layers(policy: TwinPolicy) -> dict[str, nn.Linear]:
    linear = [layer for layer in policy.mlp_extractor.layers if isinstance(layer, nn.Linear)]
    heads = {"mean": policy.action_net, "log_std": policy.log_std_net, "value": policy.value_net}
    return {f"trunk.{index}": layer for index, layer in enumerate(linear)} | heads


def make_twin(
    weights: dict[str, Float32Array], batch: Batch, config: PPOConfig, *, dtype: torch.dtype = torch.float32
) -> PPO:
    """Return a PPO with these weights whose buffer holds `batch`, ready for `train()`.

    Half the squared error is the value loss here, the whole one there; its clipping differs, so `value_clip`
    must be None. Its buffer goes through the same episodes one after the other.
    """
    assert config.value_clip is None
    count, arguments = batch.arguments.shape
    ppo = PPO(
        TwinPolicy,
        DummyVecEnv([lambda: _Spaces(batch.inputs.shape[1], arguments)]),
        learning_rate=config.learning_rate,
        n_steps=count,
        batch_size=count // config.minibatches,
        n_epochs=config.epochs,
        gamma=config.gamma,
        gae_lambda=config.gae_lambda,
        clip_range=config.clip,
        ent_coef=config.entropy_coefficient,
        vf_coef=config.value_coefficient / 2,
        max_grad_norm=config.max_gradient_norm,
        policy_kwargs={"optimizer_kwargs": {"eps": config.adam_epsilon}},
        device="cpu",
    )
    ppo.policy.to(dtype)
    for name, layer in _layers(ppo.policy).items():
        layer.weight.data.copy_(torch.from_numpy(weights[f"{name}.weight"]))
        layer.bias.data.copy_(torch.from_numpy(weights[f"{name}.bias"]))
    ppo.set_logger(configure(None, []))
    _fill(ppo, batch, dtype)
    return ppo


def _fill(ppo: PPO, batch: Batch, dtype: torch.dtype) -> None:
    buffer, inputs = ppo.rollout_buffer, torch.from_numpy(batch.inputs).to(dtype)
    with torch.no_grad():
        values, log_probs, _ = ppo.policy.evaluate_actions(inputs, torch.from_numpy(batch.arguments))
    starts = np.zeros(len(inputs))
    starts[np.cumsum(batch.lengths)[:-1]] = 1.0
    starts[0] = 1.0
    column = {"values": values.numpy(), "log_probs": log_probs.numpy(), "episode_starts": starts}
    for name, array in (column | {"rewards": batch.rewards[batch.inside]}).items():
        setattr(buffer, name, array.reshape(-1, 1))
    buffer.observations, buffer.actions = inputs.numpy()[:, None], batch.arguments[:, None]
    buffer.advantages = np.zeros((len(inputs), 1), dtype=values.numpy().dtype)
    buffer.full = True
    buffer.compute_returns_and_advantage(torch.zeros(1, dtype=dtype), np.ones(1))


def train_with(ppo: PPO, permutation: Callable[[int], np.ndarray]) -> None:
    """Run `PPO.train()` with these permutations of the minibatches."""
    original = np.random.permutation
    np.random.permutation = permutation
    try:
        ppo.train()
    finally:
        np.random.permutation = original


def weights_of(ppo: PPO) -> dict[str, np.ndarray]:
    """Return the weights under this project's names."""
    result = {}
    for name, layer in _layers(ppo.policy).items():
        result[f"{name}.weight"] = layer.weight.detach().numpy().copy()
        result[f"{name}.bias"] = layer.bias.detach().numpy().copy()
    return result
