"""Signed schema files: what is in them, and that nothing altered, unsigned or foreign gets in."""

import json
import stat

import msgspec
import numpy as np
import pytest
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat, PublicFormat

from taskschema.config import RunConfig
from taskschema.errors import RunFolderError, SchemaMismatchError, SignatureError
from taskschema.schema import SchemaView
from taskschema.tasks.toy import Toy
from taskschema_learner.cli.transfer import initial_logits
from taskschema_learner.runs.checkpoint import Checkpoint, save
from taskschema_learner.runs.run_folder import RunFolder
from taskschema_learner.runs.run_hash import run_hash
from taskschema_learner.schemas.schema_file import export_schema, read_schema
from taskschema_learner.schemas.signing import key_path, owner_key, read_public_key

LOGITS = np.arange(27.0).reshape(3, 9) / 7.0
"""Numbers that JSON has to keep to the last bit."""


@pytest.fixture(autouse=True)
def own_key(tmp_path, monkeypatch):
    monkeypatch.setenv("TASKSCHEMA_SIGNING_KEY", str(tmp_path / "owner" / "key.pem"))
    return tmp_path / "owner" / "key.pem"


def logits(version):
    return LOGITS * version / 7


def checkpoint(version):
    arrays = {"weights.value.bias": np.zeros(1, dtype=np.float32), "schema.logits": logits(version)}
    return Checkpoint(version, 1, arrays)


def document(version):
    view = SchemaView(Toy().pairs, logits(version))
    return view.document(run="bar", task="toy", version=version, used_steps=2, updated_at="then")


@pytest.fixture
def folder(tmp_path):
    folder = RunFolder.create(tmp_path / "runs" / "bar", RunConfig(task="toy", seed=5))
    save(folder.checkpoints, checkpoint(7))
    folder.write_schema(document(7))
    return folder


@pytest.fixture
def exported(folder, tmp_path):
    path = tmp_path / "schema.json"
    export_schema(folder, path, owner_key())
    return path


def public_key(path):
    return path.with_name(path.name + ".pub")


def altered(path, *keys, value):
    content = json.loads(path.read_text())
    place = content
    for key in keys[:-1]:
        place = place[key]
    place[keys[-1]] = value
    path.write_text(json.dumps(content))


def test_a_file_says_where_its_schema_comes_from(exported, folder):
    content = json.loads(exported.read_text())
    provenance = content["provenance"]
    assert (provenance["run"], provenance["policy_version"]) == ("bar", 7)
    assert provenance["policy_sha256"] == run_hash(folder)
    assert provenance["config_hash"] == folder.config.config_hash
    assert msgspec.convert(provenance["config"], RunConfig) == folder.config
    assert np.array_equal(read_schema(exported).logits, LOGITS)


def test_schema_and_hash_are_of_one_version_while_the_run_trains(folder, tmp_path, monkeypatch):
    before = run_hash(folder)
    for version in (8, 9):
        save(folder.checkpoints, checkpoint(version))
    written = export_schema(folder, tmp_path / "old.json", owner_key())
    assert (written.provenance.policy_version, written.provenance.policy_sha256) == (7, before)
    read, old = folder.read_schema, folder.read_schema()
    save(folder.checkpoints, checkpoint(10))
    folder.write_schema(document(10))
    reads = iter([old, old])
    monkeypatch.setattr(folder, "read_schema", lambda: next(reads, None) or read())
    written = export_schema(folder, tmp_path / "new.json", owner_key())
    assert (written.schema, written.provenance.policy_version) == (document(10), 10)
    assert written.provenance.policy_sha256 == run_hash(folder)


@pytest.mark.parametrize("version", [6, 7])
def test_a_schema_that_no_checkpoint_holds_is_not_signed(folder, tmp_path, version):
    folder.write_schema(msgspec.structs.replace(document(version), logits=(LOGITS + 1).tolist()))
    with pytest.raises(RunFolderError, match="--resume"):
        export_schema(folder, tmp_path / "schema.json", owner_key())
    assert not (tmp_path / "schema.json").exists()


def test_the_key_is_made_once_and_only_its_owner_reads_it(own_key):
    assert not own_key.exists()
    first = owner_key()
    assert stat.S_IMODE(own_key.stat().st_mode) == 0o600
    assert owner_key().private_bytes_raw() == first.private_bytes_raw()
    assert read_public_key(public_key(own_key)) == first.public_key()
    own_key.chmod(0o640)
    with pytest.raises(SignatureError, match="chmod 600"):
        owner_key()


def test_the_usual_place_of_the_key(monkeypatch, tmp_path):
    monkeypatch.delenv("TASKSCHEMA_SIGNING_KEY")
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    assert key_path() == tmp_path / "taskschema" / "signing-key.pem"


def test_the_owners_public_key_lets_the_file_in(exported, own_key):
    trusted = read_public_key(public_key(own_key))
    assert np.array_equal(read_schema(exported, trusted).logits, LOGITS)
    rows = initial_logits(str(exported), RunConfig(task="toy"), public_key(own_key))
    assert np.array_equal(rows, LOGITS)


@pytest.mark.parametrize(
    ("keys", "value"),
    [
        (("schema", "logits", 0, 0), 9.0),
        (("provenance", "run"), "another"),
        (("provenance", "config", "seed"), 6),
        (("schema_file_version",), 1.0),
        (("signature", "value"), "AAAA"),
        (("signature", "value"), "no base64!"),
        (("signature", "algorithm"), "none"),
        (("signature", "public_key"), "AAAA"),
    ],
)
def test_whatever_is_altered_is_refused_with_or_without_a_public_key(exported, own_key, keys, value):
    altered(exported, *keys, value=value)
    for trusted in (None, read_public_key(public_key(own_key))):
        with pytest.raises((SignatureError, RunFolderError)) as refusal:
            read_schema(exported, trusted)
        assert "\n" not in str(refusal.value)


def test_another_owners_file_is_refused_where_a_public_key_is_configured(exported, folder, own_key):
    trusted = read_public_key(public_key(own_key))
    export_schema(folder, exported, Ed25519PrivateKey.generate())
    with pytest.raises(SignatureError, match="another key"):
        read_schema(exported, trusted)
    assert np.array_equal(read_schema(exported).logits, LOGITS)


def test_a_foreign_signature_under_the_owners_name_is_refused(exported, folder, own_key):
    owners = json.loads(exported.read_text())["signature"]["public_key"]
    export_schema(folder, exported, Ed25519PrivateKey.generate())
    altered(exported, "signature", "public_key", value=owners)
    with pytest.raises(SignatureError, match="altered"):
        read_schema(exported, read_public_key(public_key(own_key)))


def test_what_is_not_signed_needs_that_no_public_key_is_configured(folder, own_key, monkeypatch):
    owner_key()
    config, bare = RunConfig(task="toy"), folder.path / "schema.json"
    assert np.array_equal(initial_logits(str(bare), config), LOGITS)
    assert np.array_equal(initial_logits(str(folder.path), config), LOGITS)
    for reference in (str(bare), str(folder.path)):
        with pytest.raises(SignatureError, match="is not signed"):
            initial_logits(reference, config, public_key(own_key))


def test_a_schema_of_other_skills_or_horizon_says_what_differs(exported):
    with pytest.raises(SchemaMismatchError, match="skills"):
        initial_logits(str(exported), RunConfig(task="lateral-lifting"))
    source = "from taskschema.tasks.toy import Toy\nclass Long(Toy):\n    name = 'long'\n    horizon = 4\n"
    with pytest.raises(SchemaMismatchError, match="horizon 3, this task has 4"):
        initial_logits(str(exported), RunConfig(task="Long", task_source=source))


def test_keys_of_another_kind_are_refused(tmp_path, own_key):
    other = ec.generate_private_key(ec.SECP256R1())
    public = tmp_path / "other.pub"
    public.write_bytes(other.public_key().public_bytes(Encoding.PEM, PublicFormat.SubjectPublicKeyInfo))
    with pytest.raises(SignatureError, match="not an Ed25519 public key"):
        read_public_key(public)
    owner_key()
    with pytest.raises(SignatureError, match="never the private key"):
        read_public_key(own_key)
    own_key.write_bytes(other.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption()))
    with pytest.raises(SignatureError, match="not an Ed25519 key"):
        owner_key()
    own_key.write_text("nothing")
    with pytest.raises(SignatureError, match="no unencrypted private key"):
        owner_key()
