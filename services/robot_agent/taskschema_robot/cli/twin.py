"""`taskschema-robot twin`: run the twin."""

import asyncio
import contextlib
import signal
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import msgspec
import typer

from taskschema_robot.objects.catalogue import HEAVY_BAR, OBJECTS

if TYPE_CHECKING:
    from taskschema_robot.twin.service import TwinService
    from taskschema_robot.websocket_place import Place


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(twin)


def twin(
    object_name: Annotated[
        str, typer.Option("--object", metavar="OBJECT", help=f"On the table: {', '.join(OBJECTS)}.")
    ] = HEAVY_BAR.name,
    left: Annotated[int, typer.Option(metavar="PORT", help="Left robot's rosbridge. 0: a free one.")] = 9090,
    right: Annotated[int, typer.Option(metavar="PORT", help="Right robot's rosbridge.")] = 9091,
    control: Annotated[int, typer.Option(metavar="PORT", help="Time, faults, camera, object.")] = 9190,
    sockets: Annotated[
        Path | None, typer.Option(metavar="FOLDER", help="Listen at files in this folder, not at ports.")
    ] = None,
    lock_step: Annotated[
        bool, typer.Option("--lock-step", help="Stand still until a client asks for time: training, fast.")
    ] = False,
    calibrated: Annotated[
        bool, typer.Option("--calibrated", help="Begin with calibrated grippers; real ones are not.")
    ] = False,
    json: Annotated[bool, typer.Option("--json", help="Print the addresses as JSON, on one line.")] = False,
) -> None:
    """Run two simulated Sawyers that speak rosbridge as the real ones do, in one world, until Ctrl-C.

    The agent drives it with the same driver as the robots. It listens on this machine's loopback interface
    only, or at files to which only their owner can connect. Let things go wrong in it with `taskschema-robot
    fault`.
    """
    import uvloop

    from taskschema_robot.objects.catalogue import get_object
    from taskschema_robot.twin.service import TwinService
    from taskschema_robot.twin.twin import TwinOptions

    places: tuple[Place, Place, Place] = (left, right, control)
    if sockets is not None:
        sockets.mkdir(mode=0o700, parents=True, exist_ok=True)
        places = (sockets / "left", sockets / "right", sockets / "control")
    options = TwinOptions(real_time=not lock_step, places=places[:2], calibrated=calibrated)
    service = TwinService(get_object(object_name), options, places[2])
    uvloop.run(_serve(service, as_json=json))


async def _serve(service: "TwinService", *, as_json: bool) -> None:
    await service.start()
    left, right = (robot.server.url for robot in service.twin.robots)
    addresses = {"left": left, "right": right, "control": service.control.url}
    if as_json:
        print(msgspec.json.encode(addresses).decode(), flush=True)
    else:
        pace = "in real time" if service.twin.options.real_time else "in lock-step"
        print(f"Twin with {service.twin.name}, {pace}; Ctrl-C ends it.")
        for name, address in addresses.items():
            print(f"{name:8}{address}", flush=True)
    ended = asyncio.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        asyncio.get_running_loop().add_signal_handler(number, ended.set)
    try:
        await ended.wait()
    finally:
        with contextlib.suppress(asyncio.CancelledError):
            await service.stop()
