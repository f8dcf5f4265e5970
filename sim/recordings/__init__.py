"""Recordings: MCAP, CARMEN logs and TUM trajectories, written and read."""
