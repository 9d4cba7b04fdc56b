"""The server for what clients ask of the twin itself."""

import asyncio

import msgspec
import numpy as np
from websockets.asyncio.server import Server, ServerConnection
from websockets.exceptions import ConnectionClosed

from taskschema_robot.errors import CameraError
from taskschema_robot.twin import control_messages as messages
from taskschema_robot.twin.twin import Twin
from taskschema_robot.websocket_place import Place, listen

ARRIVAL_SECONDS = 5.0
"""How long to wait for frames that a client says it has sent."""
LONGEST_ADVANCE = 3600.0
"""[s] that one request may ask for."""


class ControlServer:
    """Serves one twin on a port of the loopback interface, or at a file.

    Args:
        twin: to be controlled.
        place: to listen at.

    """

    def __init__(self, twin: Twin, place: Place = 0) -> None:
        self._twin = twin
        self._decoder: msgspec.json.Decoder[messages.Request] = msgspec.json.Decoder(messages.Request)
        self._server: Server | None = None
        self._place = place
        self.url = ""
        """Where it listens, once it does."""

    async def start(self) -> None:
        """Listen."""
        self._server, self.url = await listen(
            self._place, self._serve, compression=None, ping_interval=None, max_size=100_000
        )

    async def stop(self) -> None:
        """Close all connections and stop listening."""
        if self._server is not None:
            self._server.close()
            await self._server.wait_closed()

    async def _serve(self, connection: ServerConnection) -> None:
        try:
            async for frame in connection:
                for part in await self._answer(frame):
                    await connection.send(part)
        except ConnectionClosed:
            return

    async def _answer(self, frame: str | bytes) -> list[str | bytes]:
        """Return the frames that answer a request."""
        try:
            request = self._decoder.decode(frame)
            if isinstance(request, messages.TakePicture):
                exposure = self._twin.expose()
                image = await self._twin.camera.render(exposure)
                height, width, _ = image.shape
                header = messages.PictureTaken(exposure.time, exposure.number, exposure.digest, height, width)
                return [_encode(header), image.tobytes()]
            return [_encode(await self._do(request))]
        except (msgspec.MsgspecError, CameraError, ValueError) as error:
            return [_encode(messages.Refused(str(error)))]

    async def _do(self, request: messages.Request) -> messages.Answer:
        twin = self._twin
        if isinstance(request, messages.Advance):
            return await self._advance(request)
        if isinstance(request, messages.PlaceObject):
            pose = np.array(request.pose)
            if pose.shape != twin.world.object_pose.shape or not np.isfinite(pose).all():
                raise ValueError(f"an object's pose here is {len(twin.world.object_pose)} finite numbers")
            twin.world.place_object(pose)
            return messages.Done()
        if isinstance(request, messages.WhereIsObject):
            return messages.ObjectPose(twin.world.object_pose.tolist())
        if isinstance(request, messages.Inject):
            if request.arm not in (None, 0, 1):
                raise ValueError("an arm is 0 (left), 1 (right), or null for both")
            twin.inject(request.kind, request.arm, active=request.active, value=request.value)
            return messages.Done()
        left, right = (robot.server.url for robot in twin.robots)
        return messages.Description(twin.name, (left, right), twin.options.real_time, twin.now())

    async def _advance(self, request: messages.Advance) -> messages.Answer:
        twin = self._twin
        if twin.options.real_time:
            raise ValueError("this twin runs in real time: its clock cannot be asked for time")
        if not request.until - twin.now() <= LONGEST_ADVANCE:
            raise ValueError(f"at most {LONGEST_ADVANCE:.0f} s at a time")
        for path, count in request.sent.items():
            await self._wait_for(path, count)
        twin.advance_to(request.until)
        accepted = {}
        for robot in (each for each in twin.robots if not each.server.stalled):
            for path, link in robot.server.links.items():
                if path in request.sent:
                    accepted[path] = link.outbox.accepted
        await asyncio.sleep(0)  # the frames go first, or their reader wakes up once for each
        exposure = twin.expose()
        return messages.Advanced(twin.now(), accepted, exposure.time, exposure.number, exposure.digest)

    async def _wait_for(self, path: str, count: int) -> None:
        """Wait until the bridge has dealt with `count` frames of a connection, unless it breaks or stalls."""
        deadline = asyncio.get_running_loop().time() + ARRIVAL_SECONDS
        while True:
            robot = next((each for each in self._twin.robots if path in each.server.links), None)
            if robot is None or robot.server.stalled:
                return
            link = robot.server.links[path]
            if link.handled >= count:
                return
            link.progress.clear()
            try:
                remaining = deadline - asyncio.get_running_loop().time()
                await asyncio.wait_for(link.progress.wait(), max(remaining, 0.0))
            except TimeoutError:
                raise ValueError(f"frames that {path} has sent did not arrive") from None


def _encode(answer: messages.Answer) -> str:
    return msgspec.json.encode(answer).decode()
