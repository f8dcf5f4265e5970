"""Scores map mergers against ground truth."""
