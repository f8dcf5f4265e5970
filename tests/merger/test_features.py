import numpy as np
import pytest

from merger import se2
from merger.edges import extract_edge_points
from merger.features import FeatureConfig, Features, extract_features, match_features, match_many
from merger.grid_map import GridMap
from merger.ransac import RansacConfig, guess_motion


def _to_map(grid, points_grid):
    return se2.transform_points(grid.T_map_grid, points_grid)


def test_true_matches_of_turned_maps_outvote_the_false_ones(cut_map):
    T = se2.make_motion(2.0, 1.0, 2.2)
    grids = cut_map("a", (0.0, 15.0), np.eye(3)), cut_map("b", (5.0, 20.0), T)
    features = [extract_features(grid, FeatureConfig()) for grid in grids]
    matches = match_features(*features, FeatureConfig())
    places = [_to_map(grids[k], features[k].points_grid)[matches[:, k]] for k in range(2)]
    guess = guess_motion(*places, RansacConfig(), np.random.default_rng(0))
    assert guess.num_inliers >= 10
    error = se2.log(se2.invert(T) @ guess.T_target_source)
    assert np.abs(error[:2]).max() < 0.5
    assert abs(error[2]) < 0.05


def test_keypoints_do_not_depend_on_where_the_origin_lies(cut_map):
    grid = cut_map("a", (0.0, 12.0), np.eye(3))
    moved = GridMap("a", grid.log_odds, grid.resolution_m, se2.make_motion(100.0, -3.0, 1.0))
    first, second = (extract_features(g, FeatureConfig()) for g in (grid, moved))
    assert (first.points_grid == second.points_grid).all()
    assert (first.descriptors == second.descriptors).all()


def test_an_unknown_border_shifts_keypoints_but_changes_no_descriptor(cut_map):
    grid = cut_map("a", (0.0, 12.0), np.eye(3))
    wide = GridMap("a", np.pad(grid.log_odds, ((30, 5), (7, 40))), grid.resolution_m)
    first, second = (extract_features(g, FeatureConfig()) for g in (grid, wide))
    assert np.allclose(second.points_grid - first.points_grid, np.array([7, 30]) * grid.resolution_m, atol=1e-9)
    assert (first.descriptors == second.descriptors).all()


@pytest.mark.parametrize("resolution_m", [0.025, 0.05, 0.1, 0.13])
def test_keypoints_lie_at_the_same_places_at_every_resolution(cut_map, resolution_m):
    config = FeatureConfig()
    grid, other = (cut_map("a", (0.0, 12.0), np.eye(3), resolution_m=r) for r in (0.05, resolution_m))
    first, second = (_to_map(g, extract_features(g, config).points_grid) for g in (grid, other))
    distances = np.linalg.norm(first[:, None] - second[None], axis=2).min(axis=1)
    assert np.median(distances) < 0.1


def test_a_map_with_nothing_to_see_has_no_keypoint_and_no_match():
    empty = extract_features(GridMap("a", np.zeros((40, 40), dtype=np.float32), 0.05), FeatureConfig())
    assert empty.points_grid.shape == (0, 2)
    assert match_features(empty, empty, FeatureConfig()).shape == (0, 2)
    assert match_many(empty, empty, 0.1).shape == (0, 2)


def _random_features(seed, count):
    rng = np.random.default_rng(seed)
    return Features(rng.random((count, 2)), rng.integers(0, 256, size=(count, 128)).astype(np.float32))


def test_matches_are_those_of_the_obvious_loop():
    a, b = _random_features(0, 30), _random_features(1, 40)
    b.descriptors[:10] = np.clip(a.descriptors[5:15] + 3, 0, 255)

    def one_way(from_, to):
        found = []
        for row, descriptor in enumerate(from_.descriptors):
            distances = np.linalg.norm(to.descriptors.astype(float) - descriptor, axis=1)
            order = np.argsort(distances)
            if distances[order[0]] < 0.8 * distances[order[1]]:
                found.append((row, int(order[0])))
        return found

    union = set(one_way(a, b)) | {(t, s) for s, t in one_way(b, a)}
    matches = match_features(a, b, FeatureConfig())
    assert [tuple(row) for row in matches.tolist()] == sorted(union)
    single = match_features(a, b, FeatureConfig(both_directions=False))
    assert [tuple(row) for row in single.tolist()] == sorted((t, s) for s, t in one_way(b, a))


def test_a_place_with_several_orientations_is_matched_once():
    a = _random_features(5, 20)
    twice = Features(np.repeat(a.points_grid, 2, axis=0), np.repeat(a.descriptors, 2, axis=0))
    twice.descriptors[1::2] = _random_features(6, 20).descriptors
    matches = match_features(twice, Features(twice.points_grid + 3.0, twice.descriptors), FeatureConfig())
    places = {tuple(twice.points_grid[t]) for t, _ in matches}
    assert len(matches) == len(places) == 20


def test_many_to_many_candidates_are_as_near_as_the_nearest_but_for_a_margin():
    a, b = _random_features(2, 25), _random_features(3, 35)
    matches = {tuple(row) for row in match_many(a, b, 0.05).tolist()}
    distances = np.sqrt(((a.descriptors[:, None] - b.descriptors[None]) ** 2).mean(axis=2)) / 64.0
    expected = {(t, s) for t in range(25) for s in range(35) if distances[t, s] <= distances[t].min() + 0.05}
    assert matches == expected
    assert len({s for _, s in matches}) < len(matches) > 25


def test_as_many_keypoints_are_kept_as_asked_for_and_the_strongest(cut_map):
    grid = cut_map("a", (0.0, 15.0), np.eye(3))
    everything = extract_features(grid, FeatureConfig())
    strongest = extract_features(grid, FeatureConfig(max_keypoints=40))
    assert 40 <= len(strongest.points_grid) <= 44 < len(everything.points_grid)
    assert {tuple(p) for p in strongest.points_grid} <= {tuple(p) for p in everything.points_grid}


def test_guesses_find_a_motion_that_a_third_of_the_matches_support():
    rng = np.random.default_rng(4)
    T = se2.make_motion(3.0, -2.0, 1.1)
    source = rng.uniform(-10, 10, size=(60, 2))
    target = se2.transform_points(T, source)
    target[20:] = rng.uniform(-10, 10, size=(40, 2))
    guess = guess_motion(target, source, RansacConfig(), rng)
    assert guess.inliers[:20].all()
    assert np.allclose(guess.T_target_source, T, atol=1e-6)


@pytest.mark.parametrize("count", [0, 1])
def test_fewer_than_two_matches_support_nothing(count):
    guess = guess_motion(np.zeros((count, 2)), np.zeros((count, 2)), RansacConfig(), np.random.default_rng(0))
    assert guess.num_inliers == 0


def test_edge_points_are_the_walls_that_free_space_touches():
    cells = np.zeros((6, 8), dtype=np.float32)
    cells[:, :3], cells[:, 3:6] = -2.0, 2.0
    points = extract_edge_points(GridMap("a", cells, 0.1))
    assert len(points) == 6
    assert np.allclose(points[:, 0], 0.35)


def test_without_free_space_every_wall_is_an_edge():
    cells = np.zeros((6, 8), dtype=np.float32)
    cells[2, 3:6] = 2.0
    assert len(extract_edge_points(GridMap("a", cells, 0.1))) == 3


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: FeatureConfig(ratio=1.5), r"features\.ratio must be in \(0, 1\], got 1\.5"),
        (lambda: FeatureConfig(pixel_m=0.0), r"features\.pixel_m must be > 0, got 0\.0"),
        (lambda: RansacConfig(min_inliers=1), r"ransac\.min_inliers must be >= 2, got 1"),
        (lambda: RansacConfig(num_guesses=0), r"ransac\.num_guesses must be >= 1, got 0"),
    ],
)
def test_settings_out_of_range_are_refused_by_name_and_value(make, message):
    with pytest.raises(ValueError, match=message):
        make()
