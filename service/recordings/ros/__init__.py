"""Recordings of ROS 2: MCAP files and rosbag2 folders, also damaged ones, and their messages."""
