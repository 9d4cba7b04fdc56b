"""Where the camera hangs, by the table's markers: once, before a session from images begins."""

from taskschema_robot.camera.camera import Camera, Intrinsics
from taskschema_robot.camera.table_view import TableView
from taskschema_robot.clock import Clock
from taskschema_robot.errors import CameraError
from taskschema_robot.objects.marker import table_markers
from taskschema_robot.reward.detector import MarkerDetector
from taskschema_robot.reward.poses import table_in_camera

PATIENCE = 5.0
"""How long to look for the table's markers, some of which arms may hide [s]."""
LOOK_SECONDS = 0.1


def overhead_view(camera: Camera, intrinsics: Intrinsics, view: float, clock: Clock) -> TableView:
    """Return what cuts the policy's frame out of the camera's pictures.

    Args:
        camera: overhead, mounted for good.
        intrinsics: of it.
        view: edge length of the square of table that the policy sees [m].
        clock: the agent's.

    Raises:
        CameraError: if the table's markers are not seen; the message says why.

    """
    deadline, detector = clock.now() + PATIENCE, MarkerDetector()
    while True:
        found = detector.find(camera.latest().image)
        table, reason = table_in_camera(found, table_markers(), intrinsics)
        if table is not None:
            return TableView(intrinsics, table.position, table.rotation, view)
        if clock.now() > deadline:
            raise CameraError(f"The overhead camera cannot be placed: {reason}. See `calibrate`.")
        clock.sleep_until(clock.now() + LOOK_SECONDS)
