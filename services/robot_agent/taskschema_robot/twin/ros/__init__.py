"""As much of ROS 1 as rosbridge shows to its clients: typed messages, topics, services, the bridge itself."""
