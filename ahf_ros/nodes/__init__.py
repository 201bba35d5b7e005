"""The ROS 2 nodes: messages, parameters and threads; the work is done by the rooms below."""
