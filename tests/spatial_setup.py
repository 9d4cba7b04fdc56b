"""A spatial network on toy frames, for tests."""

from collections import OrderedDict
from functools import cache

import numpy as np
import torch

from taskschema.config import ImageConfig, RunConfig
from taskschema.policies import ImagePolicy, PolicySnapshot
from taskschema.policies.spatial_trunk import TRUNKS
from taskschema.randomness import EpisodeKey, Purpose, generator
from taskschema.skills.pairs import PairSpace
from taskschema.skills.registry import SKILLS
from taskschema.skills.table_space import TableRectangle
from taskschema.tasks.toy import Toy
from taskschema_learner.networks.initial_weights import initial_spatial_weights
from taskschema_learner.networks.vgg_weights import TORCHVISION_LAYERS

TOY = Toy()
FAMILIES = {
    "lateral_lifting": (("top_grasp", "lift", "no_op"), 2, 10),
    "picking": (("top_grasp", "go_to_pose", "lift", "no_op"), 5, 16),
    "opening": (("top_grasp", "side_grasp", "twist", "no_op"), 2, 10),
    "rotating": (("side_grasp", "go_to_pose", "rotate", "no_op"), 5, 16),
}
"""Skills, p and 2 + 4 + 2p of the paper's families."""


def family_pairs(name: str) -> PairSpace:
    return PairSpace([SKILLS[skill] for skill in FAMILIES[name][0]], TableRectangle.around((0.08, 0.06)))


def image_config(trunk: str = "small", **fields) -> RunConfig:
    return RunConfig(task="toy", observation="image", image=ImageConfig(trunk=trunk), **fields)


def some_weights(trunk: str = "small", seed: int = 0) -> dict[str, np.ndarray]:
    """Weights whose maps differ from cell to cell and from frame to frame."""
    rng = np.random.default_rng(seed)
    weights = initial_spatial_weights(rng, image_config(trunk), TOY)
    weights["maps.weight"] = rng.normal(0.0, 1.0, weights["maps.weight"].shape).astype(np.float32)
    weights["maps.bias"] = rng.normal(0.0, 0.3, weights["maps.bias"].shape).astype(np.float32)
    weights["value.weight"] = rng.normal(0.0, 0.05, weights["value.weight"].shape).astype(np.float32)
    weights["log_std"] = rng.uniform(-2.0, -1.0, weights["log_std"].shape).astype(np.float32)
    return weights


@cache
def torchvision_weights() -> OrderedDict[str, torch.Tensor]:
    """Return torchvision's state dict of VGG16 with other numbers; to be left as it is."""
    generator = torch.Generator().manual_seed(0)
    content = OrderedDict()
    for number, layer in zip(TORCHVISION_LAYERS, TRUNKS["vgg16"], strict=True):
        content[f"features.{number}.weight"] = 0.02 * torch.randn(layer.shape, generator=generator)
        content[f"features.{number}.bias"] = 0.02 * torch.randn(layer.outputs, generator=generator)
    content["classifier.6.bias"] = torch.zeros(1000)  # the rest of VGG is there, and unused
    return content


def some_policy(trunk: str = "small", logits: np.ndarray | None = None) -> ImagePolicy:
    rows = np.zeros((3, 9)) if logits is None else logits
    return ImagePolicy(PolicySnapshot(0, some_weights(trunk), rows), TOY, trunk)


def toy_frames(count: int, seed: int = 0) -> np.ndarray:
    environment = TOY.make_environment()
    keys = [EpisodeKey(seed, 0, 0, episode) for episode in range(count)]
    environment.reset([generator(key, Purpose.RESET) for key in keys])
    return environment.frames(np.arange(count))


def streams(count: int, seed: int = 0) -> list[np.random.Generator]:
    return [generator(EpisodeKey(seed, 0, 0, episode), Purpose.ACTION) for episode in range(count)]
