"""One simulated Sawyer as its ROS topics show it: power and stops, joint control, gripper."""
