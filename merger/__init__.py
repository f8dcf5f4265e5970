"""Simultaneous merging of multiple occupancy grid maps by robust motion averaging (Jiang, Zhu et al.), and beyond."""

__version__ = "0.1.0"
