"""The oracle of ray casting: pymunk's ``segment_query_first`` with segments of radius 0."""

import math

import numpy as np
import pymunk


def make_space(segments_m, centers_m=(), radii_m=()):
    """A space with these walls (their index is the shape's ``tag``) and discs (-2)."""
    space = pymunk.Space()
    for index, (a, b) in enumerate(np.asarray(segments_m, dtype=float)):
        shape = pymunk.Segment(space.static_body, tuple(a), tuple(b), 0.0)
        shape.tag = index
        space.add(shape)
    for center, radius in zip(centers_m, radii_m, strict=True):
        shape = pymunk.Circle(space.static_body, float(radius), tuple(float(v) for v in center))
        shape.tag = -2
        space.add(shape)
    return space


def cast(space, origin_m, angle_rad, limit_m):
    """Range (+inf: none) and tag of what one ray meets first."""
    x, y = (float(v) for v in origin_m)
    end = (x + limit_m * math.cos(angle_rad), y + limit_m * math.sin(angle_rad))
    hit = space.segment_query_first((x, y), end, 0.0, pymunk.ShapeFilter())
    return (hit.alpha * limit_m, hit.shape.tag) if hit else (math.inf, -1)
