"""The agent's side of a twin: its control server, its camera, and its clock in lock-step."""

from collections.abc import Coroutine
from typing import Any, TypeVar

import msgspec
import numpy as np
from websockets.asyncio.client import ClientConnection
from websockets.exceptions import WebSocketException

from taskschema.arrays import FloatArray
from taskschema_robot.camera.camera import Frame
from taskschema_robot.camera.fetched_frame import FetchedFrame
from taskschema_robot.drivers.input_output import InputOutputInTurn
from taskschema_robot.errors import CameraError, TwinError
from taskschema_robot.twin import control_messages as messages
from taskschema_robot.twin.faults import FaultKind
from taskschema_robot.websocket_place import connecting

Expected = TypeVar("Expected")
Result = TypeVar("Result")

OPEN_SECONDS = 10.0
ANSWER_SECONDS = 120.0
"""How long a twin may take to answer: a long stretch of simulated time, or a picture in software."""
LARGEST_ANSWER = 50_000_000
"""[bytes]"""


class TwinClient:
    """Asks a twin for time, pictures and faults; from any thread, one request at a time.

    Args:
        url: of the twin's control server, such as `ws://127.0.0.1:9190` or `unix:/twin/control`.
        io: where the twin itself runs, if it is this process; None: the client makes a loop of its own.

    """

    def __init__(self, url: str, io: InputOutputInTurn | None = None) -> None:
        self.url = url
        self._decoder: msgspec.json.Decoder[messages.Answer] = msgspec.json.Decoder(messages.Answer)
        self.input_output = io or InputOutputInTurn()
        self._owns_loop = io is None
        """What asks this twin runs here; in lock-step, the connections to its robots live here, too."""
        try:
            self._connection: ClientConnection = self.input_output.run(self._connect(), OPEN_SECONDS)
        except (OSError, TimeoutError, WebSocketException) as error:
            if self._owns_loop:
                self.input_output.close()
            raise TwinError(f"No twin at {url} ({error}): start one with `taskschema-robot twin`.") from None

    async def _connect(self) -> ClientConnection:
        return await connecting(self.url, compression=None, ping_interval=None, max_size=LARGEST_ANSWER)

    def run(self, work: Coroutine[Any, Any, Result]) -> Result:
        """Run what asks this twin.

        Raises:
            TwinError: if the twin is gone or does not answer.
        """
        try:
            return self.input_output.run(work, ANSWER_SECONDS)
        except TimeoutError:
            raise TwinError(f"The twin at {self.url} does not answer.") from None
        except (OSError, WebSocketException) as error:
            raise TwinError(f"The twin at {self.url} is gone ({error}): start it again.") from None

    def describe(self) -> messages.Description:
        """Return what the twin is."""
        return self.run(self._ask(messages.Describe(), messages.Description))

    async def advance(self, until: float, sent: dict[str, int]) -> messages.Advanced:
        """Ask for simulated time, in lock-step, from within `run`; see `messages.Advance`."""
        return await self._ask(messages.Advance(until, sent), messages.Advanced)

    def place_object(self, pose: FloatArray) -> None:
        """Put the object somewhere: [7 + h] position, quaternion w x y z, joints."""
        self.run(self._ask(messages.PlaceObject(pose.tolist()), messages.Done))

    def object_pose(self) -> FloatArray:
        """Return where the object really is: [7 + h]."""
        return np.array(self.run(self._ask(messages.WhereIsObject(), messages.ObjectPose)).pose)

    def inject(
        self, kind: FaultKind, arm: int | None = None, *, active: bool = True, value: float = 0.0
    ) -> None:
        """Cause a fault, or take it back; see `FaultKind`. Arm 0 is the left one, None both."""
        self.run(self._ask(messages.Inject(kind, arm, active, value), messages.Done))

    def take_picture(self) -> Frame:
        """Take a picture with the overhead camera.

        Raises:
            CameraError: if the twin's machine cannot render.
        """
        return self.run(self._take_picture())

    async def _take_picture(self) -> Frame:
        answer = await self._exchange(messages.TakePicture())
        if isinstance(answer, messages.Refused):
            raise CameraError(answer.reason)
        if not isinstance(answer, messages.PictureTaken):
            raise TwinError(f"The twin answered with {answer}.")
        pixels = np.frombuffer(await self._connection.recv(decode=False), dtype=np.uint8)
        image = pixels.reshape(answer.height, answer.width, 3)
        return FetchedFrame(answer.time, answer.number, answer.digest, lambda: image)

    def close(self) -> None:
        """End the connection; the twin goes on."""
        self.run(self._connection.close())
        if self._owns_loop:
            self.input_output.close()

    async def _ask(self, request: messages.Request, kind: type[Expected]) -> Expected:
        answer = await self._exchange(request)
        if isinstance(answer, messages.Refused):
            raise TwinError(f"The twin refuses: {answer.reason}.")
        if not isinstance(answer, kind):
            raise TwinError(f"The twin answered with {answer}.")
        return answer

    async def _exchange(self, request: messages.Request) -> messages.Answer:
        await self._connection.send(msgspec.json.encode(request), text=True)
        return self._decoder.decode(await self._connection.recv(decode=False))
