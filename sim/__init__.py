"""Simulated multi-robot 2D lidar data, and real logs, as datasets with exact ground truth."""
