"""Marker sheets that can be read back, and the check of a set-up."""

import re
from itertools import count

import cv2
import numpy as np
import pytest
from marker_scene import FROM_ABOVE, INTRINSICS, draw, picture_of, standing
from typer.testing import CliRunner

from taskschema_robot.camera.camera import Frame
from taskschema_robot.cli.main import app
from taskschema_robot.errors import CameraError
from taskschema_robot.objects.catalogue import OBJECTS, get_object
from taskschema_robot.objects.marker import table_markers
from taskschema_robot.reward import sheets
from taskschema_robot.reward.calibration import calibrate_lens, check_view
from taskschema_robot.reward.detector import MarkerDetector
from taskschema_robot.reward.lens_file import read_lens, write_lens
from taskschema_robot.reward.placement import direction
from taskschema_robot.reward.poses import Pose

JAR = get_object("glass-jar")


def test_what_is_printed_is_what_is_found_at_its_size():
    dpi = 150
    seen = {}
    for page in sheets._pages(table_markers()):
        figure = sheets._draw("table", 1, 1, page)
        figure.set_dpi(dpi)
        from matplotlib.backends.backend_agg import FigureCanvasAgg

        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        image = np.asarray(canvas.buffer_rgba())[..., :3].copy()
        for number, corners in MarkerDetector().find(image).items():
            seen[number] = float(np.hypot(*(corners[0] - corners[1]))) / dpi * 0.0254
    assert set(seen) == {marker.number for marker in table_markers()}
    for marker in table_markers():
        assert seen[marker.number] == pytest.approx(marker.size, abs=0.0008)


def test_the_command_writes_a_pdf(tmp_path):
    path = tmp_path / "sheets.pdf"
    result = CliRunner().invoke(app, ["calibrate", "--sheets", str(path), "--object", "glass-jar"])
    assert result.exit_code == 0, result.output
    assert path.read_bytes().startswith(b"%PDF")
    assert "print at 100 %" in result.output


@pytest.mark.parametrize("item", OBJECTS.values(), ids=OBJECTS)
def test_the_last_page_says_where_every_marker_goes(item):
    figure = sheets._draw_places(item, 4)
    (table,) = (artist for axes in figure.axes for artist in axes.tables)
    cells = {place: cell.get_text().get_text() for place, cell in table.get_celld().items()}
    markers = [*item.markers, *item.joint_markers]
    for row, marker in enumerate(markers, 1):
        assert (cells[row, 0], cells[row, 1]) == (str(marker.number), f"{1000 * marker.size:.0f}")
        place = [float(cells[row, column]) / 1000 for column in (2, 3, 4)]
        np.testing.assert_allclose(place, marker.position, atol=6e-5)
    assert len({row for row, _ in cells}) == len(markers) + 1
    edges = {text.get_text() for axes in figure.axes for text in axes.texts}
    assert {f"{1000 * edge:.0f}" for edge in item.size} <= edges


def test_axes_in_words():
    assert direction((1.0, 0.0, 0.0)) == "+x"
    assert direction((0.7, 0.0, -0.7)) == "+x -z"


def frames(**kwargs) -> list[Frame]:
    return [picture_of(JAR, standing(JAR, 0.02, 0.01), seed=n, time=0.03 * n, **kwargs) for n in range(3)]


def test_a_good_set_up():
    findings = check_view(frames(), INTRINSICS, JAR)
    assert all(finding.good for finding in findings), findings
    assert "1.40 m above the table" in next(item.words for item in findings if item.what == "camera")


def test_what_is_wrong_is_named():
    findings = {item.what: item for item in check_view(frames(hidden=(40, 41, 42)), INTRINSICS, JAR)}
    assert not findings["table markers"].good
    findings = {item.what: item for item in check_view(frames(hidden=(15,)), INTRINSICS, JAR)}
    assert not findings["glass-jar"].good
    assert "15" in findings["glass-jar"].words


def tilted(number: int, bent: float = 0.0) -> Frame:
    """A view of the table's markers; of a board that is bent, their ends are off by so much [m]."""
    turn = cv2.Rodrigues(0.25 * np.array([np.cos(number), np.sin(number), 0.1 * number]))[0]
    place = FROM_ABOVE.position + [0.05 * np.cos(2 * number), 0.05 * np.sin(number), -0.02 * number]
    camera = Pose(place, turn @ FROM_ABOVE.rotation)
    shown = []
    for marker in table_markers():
        rise = bent * np.sin(number) * np.sign(marker.corners[:, 1].mean())
        shown.append((marker, Pose(np.array([0.0, rise, abs(rise)]), np.eye(3))))
    return Frame(0.0, number, draw(shown, camera, seed=number))


def test_the_lens_is_found_from_tilted_views(tmp_path):
    numbers = iter(range(12))
    found, residual = calibrate_lens(lambda: tilted(next(numbers)), 12, lambda words: None)
    assert residual < 0.5
    assert found.matrix[0, 0] == pytest.approx(INTRINSICS.matrix[0, 0], rel=0.03)
    write_lens(tmp_path / "lens.json", found, (1920, 1080), residual)
    again, size = read_lens(tmp_path / "lens.json")
    np.testing.assert_allclose(again.matrix, found.matrix)
    assert size == (1920, 1080)


def test_a_lens_that_does_not_fit_is_refused_and_not_written(tmp_path, monkeypatch):
    numbers = count()
    monkeypatch.setattr("builtins.input", lambda question: "")
    camera = TiltedCamera(lambda: tilted(next(numbers) % 12, bent=0.008))
    monkeypatch.setattr("taskschema_robot.camera.video_camera.VideoCamera", lambda *unused, **also: camera)
    lens = tmp_path / "lens.json"
    result = CliRunner().invoke(app, ["calibrate", "--camera", "0", "--lens", str(lens)])
    assert isinstance(result.exception, CameraError)
    assert re.search(r"best is \d+\.\d pixels off on average, 1 is the most: take", str(result.exception))
    assert not lens.exists()


class TiltedCamera:
    """A camera before which the board is tilted each time it is looked through."""

    def __init__(self, take) -> None:
        self.latest = take

    def close(self) -> None:
        """Do nothing."""


def test_too_few_views_and_bad_files(tmp_path):
    blank = Frame(0.0, 0, np.zeros((1080, 1920, 3), dtype=np.uint8))
    with pytest.raises(CameraError, match="0 views"):
        calibrate_lens(lambda: blank, 8, lambda words: None)
    (tmp_path / "lens.json").write_text("{}")
    with pytest.raises(CameraError, match="calibrate --lens"):
        read_lens(tmp_path / "lens.json")
