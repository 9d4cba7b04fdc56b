"""Plays a recorded exchange with a genuine rosbridge against the twin's bridge, and keeps both sides."""

import asyncio
import base64
import json
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from stand_in_node import PERIOD, StandInNode
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed

from taskschema_robot.clock import RealClock
from taskschema_robot.twin.ros.bridge import Bridge
from taskschema_robot.twin.ros.graph import RosGraph
from taskschema_robot.twin.ros.server import BridgeServer

FILE = Path(__file__).parent / "recordings/rosbridge-ros1.jsonl"
TICK = 0.005
Line = dict[str, Any]


@cache
def recording() -> dict[str, list[Line]]:
    """Lines by scenario."""
    scenarios: dict[str, list[Line]] = {}
    for text in FILE.read_text().splitlines():
        line = json.loads(text)
        scenarios.setdefault(line["scenario"], []).append(line)
    return scenarios


@dataclass
class Exchange:
    """What came out of one scenario: recorded or replayed."""

    to_clients: dict[str, list[Any]] = field(default_factory=dict)
    """Frames by client, fragments joined; a closed connection is the number of its close code."""
    to_node: list[tuple[str, Any]] = field(default_factory=list)
    """(topic or service, fields)"""
    errors: list[str] = field(default_factory=list)
    """Ids of the operations that the bridge logged an error for; an empty one where it had none."""


class FragmentJoiner:
    """Joins a client's fragments."""

    def __init__(self) -> None:
        self._text = ""

    def take(self, frame: Any) -> list[Any]:
        return [unpacked(found) for found in self._joined(frame)]

    def _joined(self, frame: Any) -> list[Any]:
        if not (isinstance(frame, dict) and frame.get("op") == "fragment"):
            return [frame]
        assert isinstance(frame["total"], float)
        self._text = self._text * (frame["num"] > 0) + frame["data"]
        try:
            return [json.loads(self._text)]
        except ValueError:
            return []


def unpacked(frame: Any) -> Any:
    """Return what a png frame carries, and any other frame as it is."""
    if not (isinstance(frame, dict) and frame.get("op") == "png"):
        return frame
    picture = np.frombuffer(base64.b64decode(frame["data"]), dtype=np.uint8)
    return json.loads(cv2.imdecode(picture, cv2.IMREAD_COLOR)[:, :, ::-1].tobytes())


def error_id(message: str) -> str:
    return message.split("[id: ")[1].split("]")[0] if "[id: " in message else ""


def recorded(lines: list[Line]) -> Exchange:
    """Return what the genuine bridge did."""
    exchange, joiners = Exchange(), {}
    for line in lines:
        frame, client = line["frame"], line.get("client", "")
        if line["dir"] == "<" and isinstance(frame, str):
            joined = joiners.setdefault(client, FragmentJoiner()).take(json.loads(frame))
            exchange.to_clients.setdefault(client, []).extend(joined)
        elif line["dir"] == "R":
            exchange.to_node.append((frame.get("topic") or frame["service"], frame["fields"]))
        elif line["dir"] == "L" and frame["level"] == "ERROR":
            exchange.errors.append(error_id(frame["message"]))
    return exchange


class Replay:
    """One scenario against a bridge of its own."""

    def __init__(self, lines: list[Line]) -> None:
        self._lines = lines
        self._clock = RealClock()
        self.exchange = Exchange()
        graph = RosGraph()
        self._node = StandInNode(graph, self._clock.now)
        self._bridge = Bridge(graph, self._clock.now, link_delay=0.15, log=self._log)
        self._server = BridgeServer(self._bridge)
        self._clients: dict[str, ClientConnection] = {}
        self._readers: list[asyncio.Task[None]] = []

    def _log(self, level: str, message: str) -> None:
        if level == "ERROR":
            self.exchange.errors.append(error_id(message))

    async def run(self) -> Exchange:
        """Send what the client sent, when it sent it."""
        await self._server.start()
        ticker = asyncio.create_task(self._tick())
        start = asyncio.get_running_loop().time()
        try:
            for line in self._lines:
                delay = start + line["t"] - asyncio.get_running_loop().time()
                if delay > 0:
                    await asyncio.sleep(delay)
                await self._play(line)
            await asyncio.sleep(0.3)
        finally:
            ticker.cancel()
            await self._server.stop()
        self.exchange.to_node = self._node.received
        return self.exchange

    async def _tick(self) -> None:
        loop = asyncio.get_running_loop()
        due = loop.time()
        while True:
            self._bridge.tick()
            if loop.time() >= due:
                due += PERIOD
                self._node.tick()
            await asyncio.sleep(min(TICK, max(due - loop.time(), 0.0)))

    async def _play(self, line: Line) -> None:
        client, frame = line.get("client", ""), line["frame"]
        event = frame.get("event", "") if isinstance(frame, dict) else ""
        if line["dir"] == "#" and event == "connected":
            address = f"{self._server.url}/{client}"
            connection = await connect(address, compression=None, ping_interval=None)
            self._clients[client] = connection
            self._readers.append(asyncio.create_task(self._read(client, connection)))
        elif line["dir"] == "#" and event == "client aborts TCP with RST":
            self._clients[client].transport.abort()
        elif line["dir"] == ">":
            await self._send(self._clients[client], frame)

    async def _send(self, connection: ClientConnection, frame: Any) -> None:
        if isinstance(frame, str):
            await connection.send(frame)
        elif "binary_base64" in frame:
            await connection.send(base64.b64decode(frame["binary_base64"]))
        elif "text_bytes_base64" in frame:
            await connection.send(base64.b64decode(frame["text_bytes_base64"]), text=True)
        elif "text_in_websocket_frames" in frame:
            await connection.send(frame["text_in_websocket_frames"])
        elif frame["control"] == "CLOSE":
            await connection.close(frame["code"], frame["reason"])
        elif frame["control"] == "PING":
            payload = base64.b64decode(frame["payload_base64"]) or b"empty"
            await asyncio.wait_for(await connection.ping(payload), 5)
        elif frame["control"] == "PONG" and "by" not in frame:
            await connection.pong(b"")

    async def _read(self, client: str, connection: ClientConnection) -> None:
        frames, joiner = self.exchange.to_clients.setdefault(client, []), FragmentJoiner()
        try:
            async for text in connection:
                frames.extend(joiner.take(json.loads(text)))
        except ConnectionClosed:
            return
