"""What `taskschema train` is told about the trunk of a network that sees images."""

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from taskschema.config import RunConfig
    from taskschema_learner.vgg_weights import TrunkWeights


def read_trunk(vgg_weights: Path | None) -> "TrunkWeights | None":
    """Return the published weights in a file, if one was named.

    Raises:
        TrunkError: if they do not fit.

    """
    if vgg_weights is None:
        return None
    from taskschema_learner.vgg_weights import read_vgg_weights

    return read_vgg_weights(vgg_weights)


def with_trunk(config: "RunConfig", trunk: str | None, weights: "TrunkWeights | None") -> "RunConfig":
    """Return the config with the trunk that was asked for; published weights imply VGG16.

    Raises:
        TaskschemaError: if there is no such trunk, or states have no use for one.

    """
    import msgspec

    from taskschema.errors import ConfigError, UnknownNameError
    from taskschema.policies.spatial_trunk import TRUNKS

    if trunk is None and weights is None:
        return config
    if config.observation != "image":
        raise ConfigError("--trunk and --vgg-weights are for --observation image.")
    name = trunk or "vgg16"
    if name not in TRUNKS:
        raise UnknownNameError("trunk", name, TRUNKS)
    image = {"trunk": name, "vgg_sha256": weights.sha256 if weights else config.image.vgg_sha256}
    return msgspec.structs.replace(config, image=msgspec.structs.replace(config.image, **image))


def first_weights_sentence(config: "RunConfig", vgg_weights: Path | None) -> str:
    """Say plainly what the trunk starts from."""
    if config.image.vgg_sha256 is not None:
        return f"The VGG16 trunk has the weights of {vgg_weights}, SHA-256 {config.image.vgg_sha256}."
    if config.image.trunk_is_frozen:
        return (
            "The VGG16 trunk has random weights, and they stay so: --vgg-weights FILE loads published ones."
        )
    return "The small trunk starts from random weights and is trained with the rest."
