"""Images, results, tables and messages, as files have them and as ROS sends them."""
