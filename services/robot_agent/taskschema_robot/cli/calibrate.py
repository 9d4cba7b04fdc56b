"""`taskschema-robot calibrate`: print markers, check the set-up."""

from pathlib import Path
from typing import Annotated

import typer


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
    if twin is None:
        raise ConfigError(
            "Say what to look through: --twin URL; or --sheets FILE.pdf to print markers first."
        )
    _check_twin(twin, item, frames)


def _check_twin(url: str, item: str | None, count: int) -> None:
    from taskschema_robot.errors import CameraError
    from taskschema_robot.objects.catalogue import get_object
    from taskschema_robot.reward.calibration import check_view
    from taskschema_robot.twin.client import TwinClient
    from taskschema_robot.twin.scene import intrinsics

    client = TwinClient(url)
    try:
        pictures = [client.take_picture() for _ in range(count)]
    finally:
        client.close()
    findings = check_view(pictures, intrinsics(), None if item is None else get_object(item))
    for finding in findings:
        print(f"{'good' if finding.good else 'MEND':5} {finding.what}: {finding.words}")
    if not all(finding.good for finding in findings):
        raise CameraError("The set-up is not good yet: mend what is marked, and check again.")
