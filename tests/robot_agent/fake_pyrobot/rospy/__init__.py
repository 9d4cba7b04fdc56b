"""Stands in for rospy."""

import os

from simulated_sawyer import SAWYER, checked


class Subscriber:
    @checked("rospy.Subscriber")
    def __init__(
        self,
        name,
        data_class,
        callback=None,
        callback_args=None,
        queue_size=None,
        buff_size=65536,
        tcp_nodelay=False,
    ):
        if callback_args is None:
            assert name == "/robot/joint_states"
            SAWYER.listeners.append(callback)
        elif name != os.environ.get("TASKSCHEMA_SILENT_TOPIC"):
            assert data_class is AnyMsg
            SAWYER.listeners.append(lambda message: callback(message, callback_args))


class AnyMsg:
    """Any message, not read."""
