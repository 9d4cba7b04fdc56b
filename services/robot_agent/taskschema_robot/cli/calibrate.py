"""`taskschema-robot calibrate`: print markers, find the lens, check the set-up."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from taskschema_robot.camera.camera import Frame, Intrinsics
    from taskschema_robot.objects.robot_object import RobotObject


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(calibrate)


def calibrate(
    item: Annotated[
        str | None, typer.Option("--object", metavar="OBJECT", help="Its markers, too, not the table's only.")
    ] = None,
    sheets: Annotated[
        Path | None, typer.Option(metavar="FILE.pdf", help="Write the marker sheets to print, and end.")
    ] = None,
    twin: Annotated[
        str | None, typer.Option(metavar="URL", help="Look through the camera of this twin.")
    ] = None,
    camera: Annotated[
        str | None, typer.Option(metavar="SOURCE", help="Look through this camera: number or URL.")
    ] = None,
    lens: Annotated[
        Path | None, typer.Option(metavar="FILE", help="The camera's lens: made if it is not there yet.")
    ] = None,
    frames: Annotated[int, typer.Option(min=2, help="Pictures to look at.")] = 10,
) -> None:
    """Print the marker sheets, or check what the overhead camera sees of them.

    First --sheets: print at 100 %, measure the ruler, glue six markers to the table and an object's to the
    object, as docs/run-a-robot.md shows. Then without it: every item says what is good and what to mend.
    """
    from taskschema.errors import ConfigError
    from taskschema_robot.objects.catalogue import get_object

    found = None if item is None else get_object(item)
    if sheets is not None:
        from taskschema_robot.reward.sheets import write_sheets

        pages = write_sheets(sheets, found)
        print(f"{sheets}: {pages} pages; print at 100 % and measure the ruler at the foot of each.")
        return
    if twin is not None:
        pictures, projection = _through_twin(twin, frames)
    elif camera is not None and lens is not None:
        pictures, projection = _through_camera(camera, lens, frames)
    else:
        raise ConfigError(
            "Say what to look through: --twin URL, or --camera SOURCE with --lens FILE; "
            "or --sheets FILE.pdf to print markers first."
        )
    _report(pictures, projection, found)


def _through_twin(url: str, count: int) -> "tuple[list[Frame], Intrinsics]":
    from taskschema_robot.twin.client import TwinClient
    from taskschema_robot.twin.scene import intrinsics

    client = TwinClient(url)
    try:
        return [client.take_picture() for _ in range(count)], intrinsics()
    finally:
        client.close()


def _through_camera(source: str, lens: Path, count: int) -> "tuple[list[Frame], Intrinsics]":
    """Return pictures of a camera whose lens is known, or found out first with a person's help."""
    from taskschema_robot.camera.video_camera import VideoCamera
    from taskschema_robot.clock import RealClock
    from taskschema_robot.reward.calibration import LENS_VIEWS, calibrate_lens
    from taskschema_robot.reward.lens_file import read_lens, write_lens

    clock = RealClock()
    known = read_lens(lens) if lens.exists() else None
    size = known[1] if known else (1920, 1080)
    camera = VideoCamera(source, size, clock, exact=known is not None)

    def next_picture() -> "Frame":
        before = camera.latest().number
        while camera.latest().number == before:
            clock.sleep_until(clock.now() + 0.02)
        return camera.latest()

    def tilted_picture() -> "Frame":
        input("Tilt the camera, or the table's markers on a board, another way and press Enter. ")
        return next_picture()

    try:
        if known is None:
            projection, residual = calibrate_lens(tilted_picture, LENS_VIEWS, print)
            height, width, _ = camera.latest().image.shape
            write_lens(lens, projection, (width, height), residual)
            print(f"{lens}: written, {residual:.2f} pixels off on average; mount the camera and check again.")
        else:
            projection = known[0]
        return [next_picture() for _ in range(count)], projection
    finally:
        camera.close()


def _report(pictures: "list[Frame]", projection: "Intrinsics", item: "RobotObject | None") -> None:
    from taskschema_robot.errors import CameraError
    from taskschema_robot.reward.calibration import check_view

    findings = check_view(pictures, projection, item)
    for finding in findings:
        print(f"{'good' if finding.good else 'MEND':5} {finding.what}: {finding.words}")
    if not all(finding.good for finding in findings):
        raise CameraError("The set-up is not good yet: mend what is marked, and check again.")
