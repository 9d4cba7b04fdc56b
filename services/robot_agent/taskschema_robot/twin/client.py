"""The agent's side of a twin: its control server, its camera, and its clock in lock-step."""

import contextlib
import threading
from typing import TypeVar

import msgspec
import numpy as np
from websockets.exceptions import WebSocketException
from websockets.sync.client import ClientConnection, connect

from taskschema.arrays import FloatArray
from taskschema_robot.camera.camera import Frame
from taskschema_robot.errors import CameraError, TwinError
from taskschema_robot.twin import control_messages as messages
from taskschema_robot.twin.faults import FaultKind

Expected = TypeVar("Expected")

ANSWER_SECONDS = 120.0
"""How long a twin may take to answer: a long stretch of simulated time, or a picture in software."""
LARGEST_ANSWER = 50_000_000
"""[bytes]"""


class TwinClient:
    """Asks a twin for time, pictures and faults; from any thread, one request at a time.

    Args:
        url: of the twin's control server, such as `ws://127.0.0.1:9190`.

    """

    def __init__(self, url: str) -> None:
        self.url = url
        self._decoder: msgspec.json.Decoder[messages.Answer] = msgspec.json.Decoder(messages.Answer)
        self._lock = threading.Lock()
        self._open = contextlib.ExitStack()
        try:
            self._connection: ClientConnection = self._open.enter_context(
                connect(url, compression=None, ping_interval=None, max_size=LARGEST_ANSWER, proxy=None)
            )
        except (OSError, TimeoutError, WebSocketException) as error:
            raise TwinError(f"No twin at {url} ({error}): start one with `taskschema-robot twin`.") from None

    def describe(self) -> messages.Description:
        """Return what the twin is."""
        return self._ask(messages.Describe(), messages.Description)

    def advance(self, until: float, sent: dict[str, int]) -> messages.Advanced:
        """Ask for simulated time, in lock-step; see `messages.Advance`."""
        return self._ask(messages.Advance(until, sent), messages.Advanced)

    def place_object(self, pose: FloatArray) -> None:
        """Put the object somewhere: [7 + h] position, quaternion w x y z, joints."""
        self._ask(messages.PlaceObject(pose.tolist()), messages.Done)

    def object_pose(self) -> FloatArray:
        """Return where the object really is: [7 + h]."""
        return np.array(self._ask(messages.WhereIsObject(), messages.ObjectPose).pose)

    def inject(
        self, kind: FaultKind, arm: int | None = None, *, active: bool = True, value: float = 0.0
    ) -> None:
        """Cause a fault, or take it back; see `FaultKind`. Arm 0 is the left one, None both."""
        self._ask(messages.Inject(kind, arm, active, value), messages.Done)

    def take_picture(self) -> Frame:
        """Take a picture with the overhead camera.

        Raises:
            CameraError: if the twin's machine cannot render.
        """
        with self._lock:
            answer = self._exchange(messages.TakePicture())
            if isinstance(answer, messages.Refused):
                raise CameraError(answer.reason)
            if not isinstance(answer, messages.PictureTaken):
                raise TwinError(f"The twin answered with {answer}.")
            pixels = np.frombuffer(self._receive(), dtype=np.uint8)
        return Frame(answer.time, answer.number, pixels.reshape(answer.height, answer.width, 3))

    def close(self) -> None:
        """End the connection; the twin goes on."""
        self._open.close()

    def _ask(self, request: messages.Request, kind: type[Expected]) -> Expected:
        with self._lock:
            answer = self._exchange(request)
        if isinstance(answer, messages.Refused):
            raise TwinError(f"The twin refuses: {answer.reason}.")
        if not isinstance(answer, kind):
            raise TwinError(f"The twin answered with {answer}.")
        return answer

    def _exchange(self, request: messages.Request) -> messages.Answer:
        try:
            self._connection.send(msgspec.json.encode(request).decode())
            return self._decoder.decode(self._receive())
        except (OSError, WebSocketException) as error:
            raise TwinError(f"The twin at {self.url} is gone ({error}): start it again.") from None

    def _receive(self) -> bytes:
        try:
            frame = self._connection.recv(timeout=ANSWER_SECONDS, decode=False)
        except TimeoutError:
            raise TwinError(f"The twin at {self.url} does not answer.") from None
        return frame if isinstance(frame, bytes) else frame.encode()
