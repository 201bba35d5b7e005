"""Recorded images: the targets in every one of them, in a bag, without ROS.

`ahf_ros.bag.run.answer_bag` does it all. The library rosbags reads and writes the bags.
"""
