"""Watchdogs beside the arms: camera, Redis and learner; the stop endpoint and keys."""

import os
import pty
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request
from contextlib import contextmanager, suppress

import numpy as np
import pytest
from agent_setup import CONFIG
from bus_setup import Run, wait_until

from taskschema.bus.connection import connect
from taskschema.bus.records import RunRecords
from taskschema.errors import StaleTokenError
from taskschema_learner.embedded_redis import EmbeddedRedis
from taskschema_robot.agent.keyboard import Keyboard
from taskschema_robot.agent.stop_endpoint import StopEndpoint
from taskschema_robot.agent.world import SessionEndedError
from taskschema_robot.camera.camera import Frame
from taskschema_robot.errors import CameraError
from taskschema_robot.safety.fault import FaultKind
from taskschema_robot.safety.monitors import CameraMonitor, LinkMonitor


def picture(brightness: int) -> np.ndarray:
    return np.full((2, 2, 3), brightness, dtype=np.uint8)


class StillCamera:
    """A camera whose frames are made by hand."""

    def __init__(self) -> None:
        self.frame = Frame(10.0, 0, picture(0))
        self.broken = False

    def latest(self) -> Frame:
        if self.broken:
            raise CameraError("no picture")
        return self.frame

    def close(self) -> None:
        pass


def test_a_camera_that_repeats_its_picture_is_noticed():
    camera = StillCamera()
    monitor = CameraMonitor(camera, oldest=1.0)
    assert monitor.fault(10.5) is None
    camera.frame = Frame(11.9, 0, camera.frame.image)  # a new time on the old picture
    assert monitor.fault(12.0).kind is FaultKind.CAMERA
    camera.frame = Frame(12.0, 1, picture(1))
    assert monitor.fault(12.1) is None
    camera.broken = True
    assert "no picture" in monitor.fault(12.2).reason


def test_the_same_picture_under_new_numbers_is_noticed():
    camera = StillCamera()
    monitor = CameraMonitor(camera, oldest=1.0)
    for number in range(11):
        camera.frame = Frame(10.0 + 0.1 * number, number, picture(7))
        assert monitor.fault(10.0 + 0.1 * number) is None
    camera.frame = Frame(11.1, 11, picture(7))
    assert "the same picture" in monitor.fault(11.1).reason
    # What was between two motions nobody has watched: a still scene may look the same.
    camera.frame = Frame(20.0, 100, picture(7))
    assert monitor.fault(20.0) is None
    camera.frame = Frame(20.4, 104, picture(8))
    assert monitor.fault(20.4) is None


def test_a_redis_that_is_silent_is_noticed_and_a_learner_that_failed(tmp_path):
    with EmbeddedRedis(tmp_path) as server, Run(server.url, CONFIG) as run:
        now = [0.0]
        records = RunRecords(connect(server.url, patience=0.1))
        with LinkMonitor(records, run.name, 10.0, lambda: now[0]) as monitor:
            wait_until(lambda: monitor._last == 0.0 and monitor.fault(0.0) is None)
            run.records.set_state(run.name, "failed", "out of disk")
            wait_until(lambda: monitor.fault(0.0) is not None)
            assert "out of disk" in monitor.fault(0.0).reason
            run.records.set_state(run.name, "running")
            wait_until(lambda: monitor.fault(0.0) is None)
        now[0] = 11.0  # the looking has ended: silence
        assert monitor.fault(0.0).kind is FaultKind.LINK
        assert "Redis has been silent" in monitor.fault(0.0).reason


def test_signs_of_life_are_what_counts(run):
    now, bus = [0.0], run.learner()
    bus.set_state("running")
    monitor = LinkMonitor(RunRecords(connect(run.url)), run.name, 10.0, lambda: now[0])
    for _ in range(4):
        now[0] += 6.0
        bus.beat()
        monitor._look()
        assert monitor.fault(0.0) is None
    now[0] += 11.0
    monitor._look()
    assert "the learner has given no sign of life for 11 s" in monitor.fault(0.0).reason
    run.learner()  # a newer one takes over
    with pytest.raises(StaleTokenError):
        bus.beat()
    monitor._look()
    assert monitor.fault(0.0) is not None
    run.records.set_state(run.name, "stopped")  # in order: what it asked for stands
    monitor._look()
    assert monitor.fault(0.0) is None


def test_a_killed_learner_is_noticed(shared_redis, tmp_path):
    command = [
        sys.executable,
        "-m",
        "taskschema_learner",
        "train",
        "toy",
        "--agent",
        "robot",
        "--api",
        "none",
    ]
    command += ["--run-dir", str(tmp_path / "killed-learner"), "--redis", shared_redis.url]
    records = RunRecords(connect(shared_redis.url, patience=0.1))
    learner = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    try:
        wait_until(lambda: records.status("killed-learner").state == "running", 300.0)
        with LinkMonitor(records, "killed-learner", 10.0) as monitor:
            first = records.status("killed-learner").alive_at
            wait_until(lambda: records.status("killed-learner").alive_at > first, 60.0)
            assert monitor.fault(0.0) is None
            learner.kill()
            learner.wait()
            assert records.status("killed-learner").state == "running"
            wait_until(lambda: monitor.fault(0.0) is not None, 60.0)
            assert "no sign of life" in monitor.fault(0.0).reason
    finally:
        learner.kill()
        learner.wait()


def test_the_stop_endpoint():
    reasons = []
    with StopEndpoint(reasons.append, 0) as endpoint:
        with urllib.request.urlopen(urllib.request.Request(endpoint.url, method="POST"), timeout=5) as answer:
            assert b"not a safety-rated stop" in answer.read()
        assert reasons == ["the stop endpoint"]
        with pytest.raises(urllib.error.HTTPError, match="404"):
            urllib.request.urlopen(endpoint.url.replace("/stop", "/other"), timeout=5)
        assert "127.0.0.1" in endpoint.url
    assert len(reasons) == 1


@contextmanager
def keyboard_of_a_terminal(on_stop):
    """A keyboard on a real terminal, and the end that a person types at."""
    leader, follower = pty.openpty()
    try:
        with os.fdopen(follower, "r", buffering=1) as stream, Keyboard(on_stop, stream=stream) as keyboard:
            yield leader, keyboard
    finally:
        with suppress(OSError):
            os.close(leader)


def test_keys_of_a_real_terminal():
    stopped, keys = threading.Event(), []
    with keyboard_of_a_terminal(stopped.set) as (leader, keyboard):
        os.write(leader, b"p")
        wait_until(lambda: keys.append(keyboard.take()) or keys[-1])
        began = time.monotonic()
        os.write(leader, b" ")
        assert stopped.wait(5.0)
        assert time.monotonic() - began < 1.0
        assert keys[-1] == "p"
        assert keyboard.take() is None


@pytest.mark.parametrize("typed", [b"x ", b"xs", b"S", b"\x1b[A ", "ä ".encode()])
def test_the_stop_key_stops_whatever_was_typed_with_it(typed):
    stopped = threading.Event()
    with keyboard_of_a_terminal(stopped.set) as (leader, _):
        os.write(leader, typed)
        assert stopped.wait(5.0)


def test_a_question_that_only_a_next_episode_needs_ends_with_the_session():
    ended = threading.Event()
    with keyboard_of_a_terminal(lambda: None) as (_, keyboard):
        threading.Timer(0.2, ended.set).start()
        with pytest.raises(SessionEndedError):
            keyboard.ask("Press Enter when it is there. ", ended.is_set)


def test_a_terminal_that_is_gone_stops_the_arms():
    stopped = threading.Event()
    with keyboard_of_a_terminal(stopped.set) as (leader, _):
        os.close(leader)
        assert stopped.wait(5.0)
