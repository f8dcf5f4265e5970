"""How fast the merger is, beside the plain way to do the same."""

from itertools import combinations

import numpy as np
import pytest
from scipy.spatial import cKDTree

from merger import se2
from merger.grid_map import GridMap
from merger.nearest_edges import index_edges
from merger.pipeline import MergeConfig, Method, merge_maps
from merger.rigid_fit import fit_motion
from merger.trimmed_icp import TrimmedIcpConfig, align, choose_overlap
from merger.wilson import draw_trees

_CELL_M = 0.05


def _walls(seed, count=4500):
    rng = np.random.default_rng(seed)
    ends = rng.uniform(0, 25, size=(30, 2, 2))
    ends[::2, 1, 0], ends[1::2, 1, 1] = ends[::2, 0, 0], ends[1::2, 0, 1]
    wall = rng.integers(30, size=count)
    return ends[wall, 0] + rng.random((count, 1)) * (ends[wall, 1] - ends[wall, 0])


@pytest.fixture(scope="module")
def edge_points():
    target = _walls(0)
    start = se2.make_motion(0.15, -0.1, 0.01)
    return target, se2.transform_points(se2.invert(start), target[1500:]), se2.make_motion(0.0, 0.0, 0.0)


@pytest.mark.benchmark(group="TrICP of 4500 edge points")
def test_trimmed_icp_with_tabulated_neighbours(benchmark, edge_points):
    target, source, start = edge_points
    index = index_edges(target, _CELL_M)
    benchmark(align, index, source, start, TrimmedIcpConfig())


@pytest.mark.benchmark(group="TrICP of 4500 edge points")
def test_trimmed_icp_with_a_tree_alone(benchmark, edge_points):
    target, source, start = edge_points

    def align_plainly():
        tree, T, config = cKDTree(target), start, TrimmedIcpConfig()
        for _ in range(80):
            moved = se2.transform_points(T, source)
            distances, nearest = tree.query(moved)
            order = np.argsort(distances)
            kept = order[: choose_overlap(distances[order] ** 2, config)]
            T_new = fit_motion(target[nearest[kept]], source[kept])
            if np.abs(T_new - T).max() < 1e-5:
                break
            T = T_new
        return T

    benchmark(align_plainly)


_EDGES = np.array([pair for pair in combinations(range(8), 2) if sum(pair) % 3])


@pytest.mark.benchmark(group="640 spanning trees of 8 maps")
def test_trees_by_wilsons_walks(benchmark):
    benchmark(lambda: draw_trees(8, _EDGES, 640, np.random.default_rng(0)))


@pytest.mark.benchmark(group="640 spanning trees of 8 maps")
def test_trees_by_the_printed_rejection_loop(benchmark):
    def draw():
        rng, found = np.random.default_rng(0), 0
        while found < 640:
            chosen = _EDGES[rng.choice(len(_EDGES), size=7, replace=False)]
            L = np.zeros((8, 8), dtype=np.int64)
            L[tuple(chosen.T)] = 1
            found += bool(np.linalg.matrix_power(L + L.T + np.eye(8, dtype=np.int64), 8).all())

    benchmark.pedantic(draw, rounds=2)


@pytest.mark.benchmark(group="16000 spanning trees of 40 maps")
def test_trees_of_forty_maps_by_wilsons_walks(benchmark):
    edges = np.array([pair for pair in combinations(range(40), 2) if pair[1] - pair[0] <= 4])
    benchmark.pedantic(lambda: draw_trees(40, edges, 16_000, np.random.default_rng(0)), rounds=2)


def _draw_maps():
    """Four overlapping maps of 25 x 25 m at 0.05 m, each turned."""
    rng = np.random.default_rng(1)
    world = np.full((500, 900), -2.0, dtype=np.float32)
    for x in range(0, 900, 120):
        world[:, x : x + 3] = 2.0
        door = rng.integers(20, 440)
        world[door : door + 30, x : x + 3] = -2.0
    for _ in range(160):
        row, col, high, wide = rng.integers((5, 5, 4, 4), (480, 880, 25, 25))
        world[row : row + high, col : col + wide] = 2.0
    maps = []
    for number, first in enumerate((0, 130, 260, 390)):
        cells = np.rot90(world[:, first : first + 500], number)
        maps.append(GridMap(f"map_{number}", np.ascontiguousarray(cells), _CELL_M))
    return maps


@pytest.mark.benchmark(group="merge of four maps of 25 x 25 m")
@pytest.mark.parametrize("method", list(Method))
def test_a_whole_merge(benchmark, method):
    maps = _draw_maps()
    result = benchmark.pedantic(merge_maps, (maps, MergeConfig(method=method)), rounds=2, warmup_rounds=1)
    assert result.num_placed >= 2
