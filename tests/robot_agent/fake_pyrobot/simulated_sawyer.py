"""The arm behind the stand-ins, and the check of their signatures."""

import functools
import inspect
import json
import os
import threading
import time
from pathlib import Path

SIGNATURES = json.loads(Path(os.environ["TASKSCHEMA_SIGNATURES"]).read_text())["calls"]


def checked(name):
    """Require that a stand-in has the signature that was published."""

    def wrap(function):
        signature = inspect.signature(function)
        own = [p for key, p in signature.parameters.items() if key != "self"]
        assert str(signature.replace(parameters=own)) == SIGNATURES[name].replace('"', "'"), name
        return functools.wraps(function)(function)

    return wrap


class Sawyer:
    def __init__(self):
        self.positions = [0.0, -1.18, 0.0, 2.18, 0.0, 0.57, 3.3161]
        self.travel = 0.04
        self.calibrated = False
        self.enabled = self.stopped = self.error = False
        self.estop_button = 0
        self.listeners = []
        threading.Thread(target=self._publish, daemon=True).start()

    def _publish(self):
        while True:
            for listener in self.listeners:
                listener(JointStates(time.time()))
            time.sleep(0.01)


class JointStates:
    """Has a header whose stamp can say its time."""

    def __init__(self, seconds):
        self.header = self
        self.stamp = self
        self._seconds = seconds

    def to_sec(self):
        return self._seconds


SAWYER = Sawyer()
