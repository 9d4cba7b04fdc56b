"""What `taskschema train` is told about images: the trunk of the network that sees them, and their looks."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from taskschema.config import RunConfig
    from taskschema_learner.networks.vgg_weights import TrunkWeights


def read_trunk(vgg_weights: Path | None) -> "TrunkWeights | None":
    """Return the published weights in a file, if one was named.

    Raises:
        TrunkError: if they do not fit.

    """
    if vgg_weights is None:
        return None
    from taskschema_learner.networks.vgg_weights import read_vgg_weights

    return read_vgg_weights(vgg_weights)


def with_image_options(
    config: "RunConfig", given: Mapping[str, Any], weights: "TrunkWeights | None"
) -> "RunConfig":
    """Return the config with the trunk and the looks that were asked for; published weights imply VGG16.

    Raises:
        TaskschemaError: if there is no such trunk, or states have no use for one.

    """
    import msgspec

    from taskschema.errors import ConfigError, UnknownNameError
    from taskschema.policies.spatial_trunk import TRUNKS

    changes: dict[str, Any] = {}
    if "randomise_visuals" in given:
        changes["randomise_visuals"] = given["randomise_visuals"]
    if weights is not None:
        changes |= {"trunk": "vgg16", "vgg_sha256": weights.sha256}
    if "trunk" in given:
        changes["trunk"] = given["trunk"]
        if given["trunk"] not in TRUNKS:
            raise UnknownNameError("trunk", given["trunk"], TRUNKS)
    if changes and config.observation != "image":
        raise ConfigError("--trunk, --vgg-weights and --randomise-visuals are for --observation image.")
    return msgspec.structs.replace(config, image=msgspec.structs.replace(config.image, **changes))


def first_weights_sentence(config: "RunConfig", vgg_weights: Path | None) -> str:
    """Say plainly what the trunk starts from."""
    if config.image.vgg_sha256 is not None:
        return f"The VGG16 trunk has the weights of {vgg_weights}, SHA-256 {config.image.vgg_sha256}."
    if config.image.trunk_is_frozen:
        return (
            "The VGG16 trunk has random weights, and they stay so: --vgg-weights FILE loads published ones."
        )
    return "The small trunk starts from random weights and is trained with the rest."
