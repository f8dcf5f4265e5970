"""Sensors: lidar beams through a grid of wall segments with their noise, and odometry."""
