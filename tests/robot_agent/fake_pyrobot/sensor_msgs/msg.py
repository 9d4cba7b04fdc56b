"""Stands in for ROS messages."""


class JointState:
    pass
