"""The Sawyer's data are what robosuite's model says."""

from importlib import resources

import pytest

pytest.importorskip("robosuite")

from taskschema_worker.generate_data import generate


def test_data_in_the_package_are_the_generated_ones(tmp_path, capfd):
    packaged = resources.files("taskschema") / "data"
    for path in generate(tmp_path):
        assert path.read_text() == (packaged / path.name).read_text(), f"{path.name}: generate the data again"
    assert capfd.readouterr().out == "", "robosuite's warnings must not reach a user"


def test_licence_notice_stands_beside_the_data():
    notice = (resources.files("taskschema") / "data" / "LICENSE.robosuite").read_text()
    assert "MIT License" in notice
    assert "Stanford Vision and Learning Lab" in notice
