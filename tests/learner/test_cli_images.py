"""`taskschema train` on images with the paper's trunk: what it starts from, what it says, what it keeps."""

import hashlib

import numpy as np
import pytest
import torch
from safetensors.numpy import load_file
from spatial_setup import torchvision_weights
from typer.testing import CliRunner

from taskschema.logs import FORMAT_VARIABLE
from taskschema.policies.spatial_trunk import TRUNKS
from taskschema_learner.cli.main import app
from taskschema_learner.networks.vgg_weights import TORCHVISION_LAYERS
from taskschema_learner.runs.run_folder import RunFolder

ONE_EPISODE = ("episodes_per_slot=1", "ppo.epochs=1", "ppo.minibatches=1")


def train(place, *options):
    """Train one round of one episode and return what was printed and the run's folder."""
    settings = [word for setting in ONE_EPISODE for word in ("--set", setting)]
    small = ["--workers", "0", "--slots", "1", "--rounds", "1", "--api", "none", *settings]
    command = ["train", "toy", "--observation", "image", "--run-dir", str(place / "seen"), *small, *options]
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("TASKSCHEMA_SIGNING_KEY", str(place / "signing-key.pem"))
        patch.setenv(FORMAT_VARIABLE, "text")  # the command sets it, for its workers
        result = CliRunner().invoke(app, command)
    assert result.exit_code == 0, result.output
    return result.output, RunFolder.open(place / "seen")


def test_vgg16_without_a_file_says_that_its_weights_are_random(tmp_path):
    output, folder = train(tmp_path, "--trunk", "vgg16")
    assert output.startswith("The VGG16 trunk has random weights, and they stay so: --vgg-weights FILE loads")
    assert "1 rounds are done; 1 episodes" in output
    assert (folder.config.image.trunk, folder.config.image.vgg_sha256) == ("vgg16", None)
    weights = load_file(folder.path / "policy.safetensors")
    assert weights["trunk.9.weight"].shape == (512, 512, 3, 3)
    assert weights["trunk.9.weight"].std() > 0.0


def test_published_weights_are_named_by_their_hash_and_stay_as_they_are(tmp_path):
    published = tmp_path / "vgg16.pth"
    torch.save(torchvision_weights(), published, _use_new_zipfile_serialization=False)
    output, folder = train(tmp_path, "--vgg-weights", str(published))
    sha256 = hashlib.sha256(published.read_bytes()).hexdigest()
    assert output.startswith(f"The VGG16 trunk has the weights of {published}, SHA-256 {sha256}.\n")
    assert (folder.config.image.trunk, folder.config.image.vgg_sha256) == ("vgg16", sha256)
    weights = load_file(folder.path / "policy.safetensors")
    for number, layer in zip(TORCHVISION_LAYERS, TRUNKS["vgg16"], strict=True):
        for part in ("weight", "bias"):
            given = torchvision_weights()[f"features.{number}.{part}"]
            assert np.array_equal(weights[f"{layer.name}.{part}"], given)
