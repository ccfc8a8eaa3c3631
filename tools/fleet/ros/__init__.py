"""Robots that run ROS 2, reached through rosbridge."""
