"""VGG16's published state dict, in every form it comes in; nothing in a file is executed."""

import hashlib
import os
from collections import OrderedDict

import numpy as np
import pytest
import torch
from safetensors.torch import save_file
from spatial_setup import torchvision_weights

from taskschema.errors import TrunkError
from taskschema_learner.networks.inert_pickle import read_state_dict
from taskschema_learner.networks.vgg_weights import TORCHVISION_LAYERS, read_vgg_weights


def state_dict(changes=None):
    return OrderedDict(torchvision_weights() | (changes or {}))


@pytest.fixture(scope="module")
def published(tmp_path_factory):
    path = tmp_path_factory.mktemp("weights") / "vgg16.pth"
    torch.save(state_dict(), path, _use_new_zipfile_serialization=False)
    return path


def test_torchvisions_layers_are_the_first_ten_convolutions():
    """torchvision's configuration D: 64 64 M 128 128 M 256 256 256 M 512 512 512 M, a ReLU after each."""
    numbers, index = [], 0
    for item in (64, 64, "M", 128, 128, "M", 256, 256, 256, "M", 512, 512, 512, "M"):
        if item == "M":
            index += 1
        else:
            numbers.append(index)
            index += 2
    assert tuple(numbers) == TORCHVISION_LAYERS


def test_the_published_format_is_read(published):
    found = read_vgg_weights(published)
    assert found.sha256 == hashlib.sha256(published.read_bytes()).hexdigest()
    assert len(found.weights) == 20
    expected = state_dict()
    assert np.array_equal(found.weights["trunk.0.weight"], expected["features.0.weight"])
    assert np.array_equal(found.weights["trunk.9.bias"], expected["features.21.bias"])


@pytest.mark.parametrize("form", ["zip", "safetensors"])
def test_newer_formats_are_read(tmp_path, form, published):
    path = tmp_path / f"vgg16.{form}"
    if form == "zip":
        torch.save(state_dict(), path)
    else:
        save_file(dict(state_dict()), path)
    newer, older = read_vgg_weights(path).weights, read_vgg_weights(published).weights
    assert all(np.array_equal(newer[name], older[name]) for name in older)


class Evil:
    def __reduce__(self):
        return (os.system, ("touch executed",))


@pytest.mark.parametrize("zipped", [True, False])
def test_a_program_in_the_file_is_not_run(tmp_path, monkeypatch, zipped):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "evil.pth"
    torch.save({"features.0.weight": Evil()}, path, _use_new_zipfile_serialization=zipped)
    with pytest.raises(TrunkError, match=r"wants to call|does not belong"):
        read_vgg_weights(path)
    assert not (tmp_path / "executed").exists()


CASES = {
    "empty": (lambda whole: b"", "no state dict"),
    "text": (lambda whole: b"hello, world " * 9, "no state dict"),
    "cut off": (lambda whole: whole[: len(whole) // 2], "no state dict"),
    "cut off in its head": (lambda whole: whole[:200], "no state dict"),
    "a broken zip": (lambda whole: b"PK\x03\x04" + whole[:999], "damaged zip"),
    "broken safetensors": (lambda whole: b"\x10\0\0\0\0\0\0\0{" + whole[:999], "no safetensors"),
}


@pytest.mark.parametrize("name", CASES)
def test_damaged_files_are_refused(tmp_path, published, name):
    change, reason = CASES[name]
    path = tmp_path / "weights.pth"
    path.write_bytes(change(published.read_bytes()))
    with pytest.raises(TrunkError, match=reason) as refusal:
        read_vgg_weights(path)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"features.5.weight": torch.zeros(128, 64, 5, 5)}, "expected float32"),
        ({"features.5.weight": torch.zeros(128, 64, 3, 3, dtype=torch.float64)}, "float64"),
        ({"features.21.bias": torch.full((512,), float("nan"))}, "not finite"),
        ({"features.0.weight": torch.zeros(3, 3, 3, 64).permute(3, 0, 1, 2)}, "contiguous"),
        ({"epoch": 3}, "other things than tensors"),
    ],
)
def test_weights_that_do_not_fit_are_refused(tmp_path, change, reason):
    path = tmp_path / "weights.pth"
    torch.save(state_dict(change), path)
    with pytest.raises(TrunkError, match=reason):
        read_vgg_weights(path)


def test_another_networks_file_is_refused(tmp_path):
    path = tmp_path / "weights.pth"
    torch.save({"conv1.weight": torch.zeros(64, 3, 7, 7)}, path)
    with pytest.raises(TrunkError, match=r"no features\.0\.weight, but conv1\.weight"):
        read_vgg_weights(path)
    with pytest.raises(TrunkError, match="cannot be read"):
        read_vgg_weights(tmp_path / "none.pth")


def test_small_state_dicts_of_torch_round_trip(tmp_path):
    content = {"a": torch.arange(6).reshape(2, 3), "b": torch.tensor(1.5), "c": torch.zeros(0, 2)}
    for zipped in (True, False):
        torch.save(content, tmp_path / "some.pth", _use_new_zipfile_serialization=zipped)
        found = read_state_dict((tmp_path / "some.pth").read_bytes())
        assert {name: array.tolist() for name, array in found.items()} == {
            name: tensor.tolist() for name, tensor in content.items()
        }
