"""Robots and people: bodies in pymunk, plans that cover the free space, and who gives way to whom."""
