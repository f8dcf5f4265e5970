"""Surfaces of overlapping solids: what is hidden goes, what can be seen stays."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.buildings.outlines import outline_segments
from sim.buildings.plan import Material, Solid, box


def total_length(solids: list[Solid]) -> float:
    segments, _ = outline_segments(solids)
    return float(np.hypot(*(segments[:, 1] - segments[:, 0]).T).sum())


@given(angle=st.floats(-4.0, 4.0), x=st.floats(-50.0, 50.0), y=st.floats(-50.0, 50.0))
def test_the_outline_of_a_cross_is_that_of_its_union_however_it_is_turned(angle: float, x: float, y: float) -> None:
    across, along = box(x, y, (4.0, 1.0), angle), box(x, y, (1.0, 4.0), angle)
    assert total_length([Solid(across, Material.WALL), Solid(along, Material.WALL)]) == pytest.approx(16.0, abs=1e-4)


@given(angle=st.floats(-4.0, 4.0), gap=st.floats(0.01, 3.0))
def test_solids_side_by_side_keep_all_their_edges(angle: float, gap: float) -> None:
    offset = (1.0 + gap) * np.array([math.cos(angle), math.sin(angle)])
    solids = [Solid(box(0.0, 0.0, (1.0, 1.0), angle), Material.WALL)]
    solids.append(Solid(box(float(offset[0]), float(offset[1]), (1.0, 1.0), angle), Material.WALL))
    assert total_length(solids) == pytest.approx(8.0)


def test_furniture_hides_no_wall_and_glass_hides_nothing() -> None:
    inner, outer = box(0.0, 0.0, (1.0, 1.0)), box(0.0, 0.0, (3.0, 3.0))
    assert total_length([Solid(inner, Material.WALL), Solid(outer, Material.FURNITURE)]) == pytest.approx(16.0)
    assert total_length([Solid(inner, Material.WALL), Solid(outer, Material.GLASS)]) == pytest.approx(16.0)
    assert total_length([Solid(inner, Material.FURNITURE), Solid(outer, Material.WALL)]) == pytest.approx(12.0)
