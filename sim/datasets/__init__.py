"""Datasets: whole folders, made, described, checked, collected."""
