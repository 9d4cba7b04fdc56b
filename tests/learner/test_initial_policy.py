"""Starting from a policy or weights of elsewhere: kept in the folder, or a line about what differs."""

from dataclasses import replace

import msgspec
import numpy as np
import pytest
from spatial_setup import image_config

from taskschema.config import ImageConfig, RunConfig
from taskschema.errors import ConfigError, RunFolderError
from taskschema.policies.spatial_trunk import TRUNKS
from taskschema.tasks import get_task
from taskschema_learner.composition import TrainOptions, make_learner, open_folder
from taskschema_learner.learner import Learner
from taskschema_learner.runs.checkpoint import Checkpoint, save
from taskschema_learner.runs.initial_policy import policy_of_file, policy_of_run, require_fit
from taskschema_learner.runs.recomputation import recompute
from taskschema_learner.runs.run_folder import INITIAL_POLICY, TRUNK, RunFolder
from taskschema_learner.runs.run_policies import initial_policy_of, newest_policy

TOY = get_task("toy")
SMALL = RunConfig(task="toy", policy="oracle", slots=4, seed=3)


@pytest.fixture
def trained(tmp_path):
    """A run's folder with the policy after two rounds."""
    folder = RunFolder.create(tmp_path / "trained", SMALL)
    learner = Learner(SMALL, TOY)
    for again in recompute(SMALL, 2):
        learner.update(again.trajectories)
    folder.write_policy(learner.snapshot().to_bytes())
    return folder


def started_from(folder, **changes):
    initial = policy_of_run(folder)
    config = msgspec.structs.replace(SMALL, seed=4, initial_policy=initial.snapshot.sha256, **changes)
    return config, initial


def test_the_first_weights_are_the_policy_s_and_the_rest_is_new(trained):
    config, initial = started_from(trained)
    require_fit(initial, config, TOY)
    first = Learner(config, TOY, initial_policy=initial.snapshot).snapshot()
    assert first.version == 0
    theirs = newest_policy(trained).weights
    assert first.weights.keys() == theirs.keys()
    assert all((first.weights[name] == theirs[name]).all() for name in theirs)
    fresh = Learner(msgspec.structs.replace(config, initial_policy=None), TOY).snapshot()
    assert any((first.weights[name] != fresh.weights[name]).any() for name in theirs)


def test_the_run_keeps_what_it_started_from(trained, tmp_path):
    """Nothing is needed of the other run any more: rounds come out the same from the folder alone."""
    config, initial = started_from(trained)
    folder = RunFolder.create(tmp_path / "next", config, initial.snapshot.to_bytes())
    (trained.path / "policy.safetensors").unlink()
    kept = initial_policy_of(RunFolder.open(folder.path))
    hashes = [
        [each.sha256 for each in recompute(config, 2, None, start)] for start in (kept, initial.snapshot)
    ]
    assert hashes[0] == hashes[1]
    assert hashes[0] != [each.sha256 for each in recompute(msgspec.structs.replace(SMALL, seed=4), 2)]


def test_a_run_without_one_has_none(trained):
    assert initial_policy_of(trained) is None


def test_another_policy_than_the_config_s_is_refused(trained):
    config, initial = started_from(trained)
    with pytest.raises(ConfigError, match="starts from policy"):
        Learner(config, TOY)
    with pytest.raises(ConfigError, match="not from"):
        Learner(SMALL, TOY, initial_policy=initial.snapshot)


@pytest.mark.parametrize("spoil", ["altered", "exchanged", "gone"])
def test_a_kept_policy_that_is_not_the_one_is_refused(trained, tmp_path, spoil):
    config, initial = started_from(trained)
    folder = RunFolder.create(tmp_path / "next", config, initial.snapshot.to_bytes())
    path = folder.path / INITIAL_POLICY
    if spoil == "gone":
        path.unlink()
    elif spoil == "exchanged":
        path.write_bytes(Learner(SMALL, TOY).snapshot().to_bytes())
    else:
        data = path.read_bytes()
        path.write_bytes(data[:-1] + bytes([data[-1] ^ 1]))
    with pytest.raises(RunFolderError, match="restore it from a backup"):
        initial_policy_of(folder)


def differences(initial, config, task=TOY):
    with pytest.raises(ConfigError) as caught:
        require_fit(initial, config, task)
    text = str(caught.value)
    assert "\n" not in text
    assert "--init-policy" in text
    return text


def test_what_does_not_fit_is_said(trained):
    """By name where the other run is known, by shape of a bare file."""
    bar = RunConfig(task="lateral-lifting", policy="oracle")
    text = differences(policy_of_run(trained), bar, get_task("lateral-lifting"))
    assert "skills: there reach, raise, no_op, here top_grasp, lift, no_op" in text
    narrow = msgspec.structs.replace(SMALL, network=msgspec.structs.replace(SMALL.network, hidden=(64, 64)))
    assert "hidden layers: there (64, 64, 64, 64), here (64, 64)" in differences(
        policy_of_run(trained), narrow
    )
    image = msgspec.structs.replace(SMALL, observation="image")
    assert "observation: there state, here image" in differences(policy_of_run(trained), image)
    chooser = msgspec.structs.replace(SMALL, policy="state")
    assert "chooses skills from the state: there False, here True" in differences(
        policy_of_run(trained), chooser
    )
    file = policy_of_file(trained.path / "policy.safetensors")
    assert "weights pair.bias: there None, here (9,)" in differences(file, chooser)
    assert "schema logits: there (3, 9), here (3, 16)" in differences(
        file, RunConfig(task="opening"), get_task("opening")
    )


@pytest.mark.parametrize("content", [b"", b"no policy", b"\x10" * 40])
def test_a_file_that_is_no_policy_is_refused(tmp_path, content):
    path = tmp_path / "policy.safetensors"
    path.write_bytes(content)
    with pytest.raises(RunFolderError, match="--init-policy takes a run"):
        policy_of_file(path)


def test_a_file_alone_will_do(trained):
    config, initial = started_from(trained)
    bare = policy_of_file(trained.path / "policy.safetensors")
    require_fit(bare, config, TOY)
    assert bare.snapshot.sha256 == initial.snapshot.sha256


VGG = msgspec.structs.replace(image_config(), image=ImageConfig(trunk="vgg16", vgg_sha256="0" * 64))


@pytest.fixture
def published(tmp_path):
    """Options of a new run with published weights, whose folder is there, and nothing else yet."""
    rng = np.random.default_rng(0)
    weights = {}
    for layer in TRUNKS["vgg16"]:
        weights[f"{layer.name}.weight"] = rng.standard_normal(layer.shape, np.float32)
        weights[f"{layer.name}.bias"] = rng.standard_normal(layer.outputs, np.float32)
    options = TrainOptions(VGG, tmp_path / "published", trunk=weights)
    open_folder(options)
    return options


def first_trunk(options):
    weights = make_learner(options, open_folder(options)).snapshot().weights
    return {name: array for name, array in weights.items() if name.startswith("trunk.")}


def test_a_run_with_published_weights_goes_on_with_them_before_its_first_checkpoint(published):
    found = first_trunk(replace(published, resume=True, trunk=None))
    assert len(found) == 20
    assert all((found[name] == published.trunk[name]).all() for name in found)


def test_without_its_published_weights_a_run_does_not_go_on(published):
    with pytest.raises(ConfigError, match="--vgg-weights FILE"):
        Learner(VGG, TOY)
    path = published.run_dir / TRUNK
    data = path.read_bytes()
    path.write_bytes(data[:-1] + bytes([data[-1] ^ 1]))
    with pytest.raises(RunFolderError, match=r"trunk\.safetensors is damaged"):
        first_trunk(replace(published, resume=True, trunk=None))
    path.unlink()  # as in the folder of an earlier version
    with pytest.raises(RunFolderError, match="continue it with --resume --vgg-weights FILE"):
        first_trunk(replace(published, resume=True, trunk=None))
    assert len(first_trunk(replace(published, resume=True))) == 20
    learner = make_learner(published, RunFolder.open(published.run_dir))
    save(published.run_dir / "checkpoints", Checkpoint(1, 1, learner.arrays(), {}))
    assert len(first_trunk(replace(published, resume=True, trunk=None))) == 20
