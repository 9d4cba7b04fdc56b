"""Stands in for ROS messages."""
