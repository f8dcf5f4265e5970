"""The parts of the robust method, each by its laws."""

import numpy as np
import pytest

from merger import se2
from merger.grid_map import GridMap
from merger.motion_graph import MotionGraph
from merger.robust import averaging
from merger.robust.averaging import RobustAveragingConfig, average_robustly, solve_blocks
from merger.robust.coarse_map import CoarseMap, coarsen
from merger.robust.consensus import ConsensusConfig
from merger.robust.cycles import CycleConfig
from merger.robust.dense_search import DenseSearchConfig, search_motions
from merger.robust.hypotheses import HypothesesConfig, select_motions
from merger.robust.joint_refinement import JointRefinementConfig, refine_jointly
from merger.robust.pair_probability import ProbabilityConfig, log_odds_of, probability
from merger.robust.peak_kernel import find_peaks, separate_peaks
from merger.robust.verification import Evidence, VerificationConfig, measure_evidence
from merger.robust.wall_alignment import AlignmentConfig, align_walls, motion_information
from merger.robust.wall_structure import WallStructureConfig, extract_structure


def apart(T: np.ndarray, T_other: np.ndarray, center: np.ndarray) -> float:
    return float(np.linalg.norm(se2.transform_points(T, center[None]) - se2.transform_points(T_other, center[None])))


@pytest.mark.parametrize("v", [(0.3, -0.2, 0.03), (-0.25, 0.3, -0.04)])
def test_alignment_undoes_a_nudge(pair, v, T_A_B, nudge):
    T = align_walls(*pair, nudge(T_A_B, pair[1].center_map, v), AlignmentConfig())
    assert apart(T, T_A_B, pair[1].center_map) < 0.03


def test_alignment_of_swapped_maps_is_the_inverse(pair, T_A_B, nudge):
    start = nudge(T_A_B, pair[1].center_map, (0.1, 0.1, 0.01))
    forward = align_walls(*pair, start, AlignmentConfig())
    backward = align_walls(pair[1], pair[0], se2.invert(start), AlignmentConfig())
    assert apart(se2.invert(backward), forward, pair[1].center_map) < 1e-3


def test_evidence_is_symmetric_in_the_two_maps(pair, T_A_B):
    forward = measure_evidence(*pair, T_A_B, VerificationConfig())
    backward = measure_evidence(pair[1], pair[0], se2.invert(T_A_B), VerificationConfig())
    for name in ("near_m", "opposed_m", "conflict_m", "loose_m", "tight_m", "weak_m", "strong_m"):
        assert getattr(forward, name) == pytest.approx(getattr(backward, name))


def test_evidence_speaks_for_the_true_motion_and_against_a_shifted_one(pair, T_A_B, nudge):
    right = measure_evidence(*pair, T_A_B, VerificationConfig())
    wrong = measure_evidence(*pair, nudge(T_A_B, pair[1].center_map, (1.0, 0.0, 0.0)), VerificationConfig())
    assert right.agreement > 0.98
    assert wrong.agreement < 0.8


def test_wall_length_does_not_depend_on_the_resolution(cut_map):
    lengths = [
        extract_structure(
            cut_map("a", (0.0, 14.0), se2.make_motion(1.0, -2.0, 0.0), resolution_m=r), WallStructureConfig()
        ).length_m
        for r in (0.05, 0.1)
    ]
    assert lengths[1] == pytest.approx(lengths[0], rel=0.2)


def test_dense_search_finds_the_true_motion_first(pair, T_A_B):
    config = DenseSearchConfig()
    coarse = [coarsen(item, config) for item in pair]
    best = search_motions([coarse[0]], coarse[1], config)[0][0]
    assert apart(best.T_target_source, T_A_B, pair[1].center_map) < 0.8
    assert abs(se2.angle_of(se2.invert(T_A_B) @ best.T_target_source)) < np.radians(4.0)


def test_dense_search_tries_few_rotations_of_straight_walls_and_misses_nothing(pair):
    found = []
    for min_parallel in (DenseSearchConfig().min_parallel, 0.0):
        config = DenseSearchConfig(min_parallel=min_parallel)
        coarse = [coarsen(item, config) for item in pair]
        found.append(search_motions([coarse[0]], coarse[1], config)[0])
    assert found[0][0].score == found[1][0].score
    assert found[0][0].T_target_source == pytest.approx(found[1][0].T_target_source)


def test_dense_search_tries_the_rotation_of_two_corridors_that_meet_at_a_corner():
    cells = np.zeros((700, 700), dtype=np.float32)
    cells[20:61, 20:680] = cells[20:680, 20:61] = 2.0
    cells[22:59, 22:678] = cells[22:678, 22:59] = -2.0
    along, across = cells.copy(), cells.copy()
    along[120:], across[:, 120:] = 0.0, 0.0
    coarse = [
        coarsen(extract_structure(GridMap("l", part, 0.05), WallStructureConfig()), DenseSearchConfig())
        for part in (along, across)
    ]
    peaks = search_motions([coarse[0]], coarse[1], DenseSearchConfig())[0]
    assert any(np.abs(peak.T_target_source - np.eye(3)).max() < 0.4 for peak in peaks)


def test_dense_search_scores_as_a_slow_oracle_does():
    rng = np.random.default_rng(0)
    config = DenseSearchConfig(step_deg=90.0, min_parallel=0.0, num_peaks=3)
    target, source = (random_coarse_map(rng, side) for side in (15, 11))
    for peak in search_motions([target], source, config)[0]:
        T_cells = peak.T_target_source.copy()
        T_cells[:2, 2] /= config.cell_m
        score = 0.0
        for row, col in np.ndindex(source.walls.shape):
            place = se2.transform_points(T_cells, np.array([[col - 5.0, row - 5.0]]))[0] + 7.0
            to_col, to_row = np.round(place).astype(int)
            assert place == pytest.approx([to_col, to_row], abs=1e-9)
            if 0 <= to_row < 15 and 0 <= to_col < 15:
                score += source.walls[row, col] * target.reward[to_row, to_col]
                score += source.reward[row, col] * target.walls[to_row, to_col]
        assert peak.score == pytest.approx(score, rel=1e-3)


def random_coarse_map(rng: np.random.Generator, side: int) -> CoarseMap:
    walls, reward = rng.random((2, side, side)).astype(np.float32)
    return CoarseMap(walls, reward, np.zeros(17, dtype=np.complex128), np.eye(3))


def test_peaks_agree_with_a_slow_oracle():
    image = np.random.default_rng(0).standard_normal((23, 31)).astype(np.float32)
    framed = np.pad(image, 1, constant_values=-np.inf)
    shifted = [np.roll(framed, (r, c), (0, 1))[1:-1, 1:-1] for r in (-1, 0, 1) for c in (-1, 0, 1)]
    rows, cols = np.nonzero(image >= np.max(shifted, axis=0))
    slow = sorted(((float(image[r, c]), int(r), int(c)) for r, c in zip(rows, cols, strict=True)), reverse=True)[:7]
    assert [tuple(peak) for peak in np.stack(find_peaks(image, 7), axis=-1)] == slow
    assert [tuple(peak) for peak in np.stack(find_peaks(image, 7, slow[3][0]), axis=-1)] == slow[:4]
    assert len(find_peaks(image, 7, slow[0][0] + 1.0)[0]) == 0


def test_of_two_peaks_that_are_nearly_the_same_the_better_one_is_chosen():
    places_m = np.array([[0.0, 0.0], [0.5, 0.0], [0.5, 0.0], [1.4, 0.0], [1.6, 0.0]])
    angles_rad = np.array([3.1, -3.1, 0.0, 3.1, 3.1])  # the second is turned by 0.08 beyond half a turn
    assert separate_peaks(places_m, angles_rad, (1.0, 0.2), 9) == [0, 2, 3]
    assert separate_peaks(places_m, angles_rad, (1.0, 0.05), 9) == [0, 1, 2, 3]
    assert separate_peaks(places_m, angles_rad, (1.0, 0.2), 2) == [0, 2]


def test_dense_search_drops_the_hopeless_peaks_only(pair):
    def search(min_share: float) -> list[float]:
        config = DenseSearchConfig(min_share=min_share)
        coarse = [coarsen(item, config) for item in pair]
        return [peak.score for peak in search_motions([coarse[0]], coarse[1], config)[0]]

    everything = search(0.0)
    between = 0.5 * (everything[2] + everything[3]) / everything[0]
    assert search(between) == everything[:3]


def test_of_many_motions_the_best_two_and_the_hopeful_ones_are_selected(pair, T_A_B, nudge):
    def select(count: int, min_share: float) -> list[int]:
        config = HypothesesConfig(min_share=min_share, probability=ProbabilityConfig(conflict_weight=0.0))
        selected = select_motions(*pair, starts, count, config)
        return [next(k for k, T in enumerate(starts) if T is one) for one in selected]

    shifts = ((3.0, 2.0), (0.8, 0.0), (0.01, 0.0), (0.0, 0.0), (-2.0, 5.0))
    starts = [nudge(T_A_B, pair[1].center_map, (*shift, 0.0)) for shift in shifts]
    everything = select(10, 0.0)
    assert everything[0] in {2, 3}  # which are the same motion
    assert len(everything) == 4
    assert select(2, 0.0) == everything[:2]
    assert select(10, 1.0) == everything[:2]
    assert select_motions(*pair, [], 10, HypothesesConfig()) == []


def ring(rng: np.random.Generator, num_maps: int = 12) -> tuple[MotionGraph, np.ndarray, np.ndarray]:
    """Motions around a ring with chords, exact; their information; the true motions."""
    T = se2.exp(rng.normal(size=(num_maps, 3)) * [5.0, 5.0, 2.0])
    T = se2.invert(T[0]) @ T
    edges = np.array([(k, (k + s) % num_maps) for k in range(num_maps) for s in (1, 2, 5)])
    spread = rng.normal(size=(len(edges), 3, 3))
    information = spread @ np.swapaxes(spread, 1, 2) + 10.0 * np.eye(3)
    return MotionGraph(num_maps, edges, se2.invert(T[edges[:, 0]]) @ T[edges[:, 1]]), information, T


def test_averaging_of_exact_motions_is_exact():
    graph, information, T = ring(np.random.default_rng(1))
    start = se2.exp(np.random.default_rng(2).normal(size=(12, 3)) * 0.05) @ T
    start[0] = np.eye(3)
    assert average_robustly(graph, information, start, RobustAveragingConfig()) == pytest.approx(T, abs=1e-6)


def test_many_maps_are_solved_for_as_few_are(monkeypatch):
    graph, information, T = ring(np.random.default_rng(6))
    gradients = np.random.default_rng(7).normal(size=(len(graph.edges), 3))
    dense = solve_blocks(graph.edges, information, gradients, len(T))
    monkeypatch.setattr(averaging, "_DENSE_MAPS", 5)
    assert solve_blocks(graph.edges, information, gradients, len(T)) == pytest.approx(dense)


def test_averaging_rejects_outlier_edges():
    graph, information, T = ring(np.random.default_rng(3))
    T_i_j = graph.T_i_j.copy()
    T_i_j[[4, 11, 20]] = T_i_j[[4, 11, 20]] @ se2.make_motion(3.0, -2.0, 1.0)
    broken = MotionGraph(graph.num_maps, graph.edges, T_i_j)
    averaged = average_robustly(broken, information, T, RobustAveragingConfig())
    assert np.abs(averaged - T).max() < 0.02


def test_averaging_does_not_depend_on_the_root():
    graph, information, T = ring(np.random.default_rng(4))
    noisy = MotionGraph(
        graph.num_maps, graph.edges, graph.T_i_j @ se2.exp(np.random.default_rng(5).normal(size=(36, 3)) * 0.02)
    )
    order = np.roll(np.arange(12), 5)
    number = np.argsort(order)
    turned = MotionGraph(12, number[noisy.edges], noisy.T_i_j)
    plain = average_robustly(noisy, information, T, RobustAveragingConfig())
    other = average_robustly(turned, information, se2.invert(T[order[0]]) @ T[order], RobustAveragingConfig())
    assert plain[order[0]] @ other == pytest.approx(plain[order], abs=1e-6)


def test_joint_refinement_undoes_nudges_of_all_maps(cut_map, nudge):
    spans = ((0.0, 10.0), (5.0, 15.0), (8.0, 20.0))
    T_world_map = np.stack([se2.make_motion(2.0 * k, k, 0.7 * k) for k in range(3)])
    grids = [
        cut_map(f"m{k}", span, T, resolution_m=0.05) for k, (span, T) in enumerate(zip(spans, T_world_map, strict=True))
    ]
    structures = [extract_structure(grid, WallStructureConfig()) for grid in grids]
    T_true = se2.invert(T_world_map[0]) @ T_world_map
    start = T_true.copy()
    for k in (1, 2):
        start[k] = nudge(T_true[k], structures[k].center_map, (0.1, -0.1, 0.01))
    joint = refine_jointly(structures, start, JointRefinementConfig())
    for k in (1, 2):
        assert apart(joint.T_root_map[k], T_true[k], structures[k].center_map) < 0.03
        assert 0.0 < np.sqrt(np.trace(joint.covariance[k, k, :2, :2])) < 0.1


def test_information_is_weak_along_a_corridor(pair, T_A_B):
    information = motion_information(*pair, T_A_B, 2.5e-3)
    assert np.linalg.eigvalsh(information).min() > 0.0


def evidence(near_m: float, conflict_m: float, **other: float) -> Evidence:
    usual = {"loose_m": 0.0, "blunt_m": 0.2 * near_m, "weak_m": near_m / 3.0, "expected_m": near_m}
    plain = {"opposed_m": 0.0, "tight_m": near_m, "strong_m": near_m / 2.0, "free_m2": near_m}
    return Evidence(near_m=near_m, conflict_m=conflict_m, **(plain | usual | other))


def test_a_motion_is_more_probable_with_more_agreement_less_conflict_and_no_rival():
    config = ProbabilityConfig()
    base = log_odds_of(evidence(40.0, 1.0), 10.0, config)
    assert log_odds_of(evidence(80.0, 1.0), 10.0, config) > base
    assert log_odds_of(evidence(40.0, 4.0), 10.0, config) < base
    assert log_odds_of(evidence(40.0, 1.0), 34.0, config) < base - 2.0
    assert log_odds_of(evidence(40.0, 1.0, loose_m=8.0), 10.0, config) < base
    assert log_odds_of(evidence(40.0, 1.0, weak_m=0.2), 10.0, config) < base
    assert probability(0.0) == 0.5


def test_a_motion_far_ahead_of_its_rivals_is_surer_than_one_of_the_same_shares():
    config = ProbabilityConfig()
    near, far = (log_odds_of(evidence(size, 0.05 * size), 0.2 * size, config) for size in (100.0, 400.0))
    assert far > near + 0.82 * np.log(4.0) - 0.1


def test_straight_walls_and_walls_without_shared_floor_say_less():
    config = ProbabilityConfig()
    base = log_odds_of(evidence(40.0, 1.0), 10.0, config)
    assert log_odds_of(evidence(40.0, 1.0, blunt_m=2.0), 10.0, config) < base - 1.0
    assert log_odds_of(evidence(40.0, 1.0, expected_m=15.0), 10.0, config) < base - 1.0


def test_maps_agree_with_themselves_as_much_as_their_floor_lets_expect(pair):
    found = measure_evidence(pair[0], pair[0], np.eye(3), VerificationConfig())
    assert found.near_m == pytest.approx(pair[0].length_m)
    assert found.expected_m == pytest.approx(found.near_m, rel=0.1)


@pytest.mark.parametrize(
    "make",
    [
        lambda: DenseSearchConfig(cell_m=0.0),
        lambda: DenseSearchConfig(free_weight=-1.0),
        lambda: DenseSearchConfig(separation_m=0.0),
        lambda: DenseSearchConfig(step_deg=100.0),
        lambda: DenseSearchConfig(min_parallel=1.5),
        lambda: DenseSearchConfig(min_share=-0.1),
        lambda: HypothesesConfig(min_share=1.1),
        lambda: HypothesesConfig(num_promising=0),
        lambda: AlignmentConfig(cutoffs_m=(0.1, 0.2)),
        lambda: WallStructureConfig(spacing_m=-1.0),
        lambda: VerificationConfig(far_m=0.01),
        lambda: ProbabilityConfig(coefficients=(1.0,)),
        lambda: CycleConfig(reach_m=0.0),
        lambda: CycleConfig(min_own_m=-1.0),
        lambda: ConsensusConfig(cycle_log_odds=-1.0),
        lambda: ConsensusConfig(echo_log_odds=-1.0),
        lambda: ConsensusConfig(cycle_log_odds=10.0),
        lambda: RobustAveragingConfig(annealing=1.0),
        lambda: JointRefinementConfig(cutoffs_m=()),
    ],
)
def test_settings_out_of_range_are_refused(make):
    with pytest.raises(ValueError, match="must be"):
        make()
