"""The robust method: maps that can be placed are placed right; what is doubtful stays apart, with its reason."""

from collections.abc import Sequence

from merger import __version__
from merger.assembly import composite_largest
from merger.grid_map import GridMap
from merger.merge_config import MergeConfig, Progress
from merger.result import MergeResult
from merger.robust.answer import place_groups
from merger.robust.consensus import grow_groups
from merger.robust.pair_answer import Findings, judge_pairs, measure_objective
from merger.robust.scale_estimation import estimate_scales, scale_map
from merger.robust.stages import describe_maps, refine_groups, search_all_pairs
from merger.stage_clock import StageClock


def merge_robustly(maps: Sequence[GridMap], config: MergeConfig, progress: Progress) -> MergeResult:
    """Merge maps of any resolutions: hypotheses, verification, consensus, averaging, joint refinement.

    Args:
        maps: The maps, of unique names; their order does not matter.
        config: The settings, whose reference names one of the maps.
        progress: Told of maps and pairs that are done.

    Returns:
        Components, placements with confidence and covariance, and why maps were left out.
    """
    clock = StageClock()
    maps = sorted(maps, key=lambda grid: grid.name)
    scales = clock.run("features", estimate_scales, maps, config, progress) if config.estimate_scale else None
    maps = maps if scales is None else [scale_map(grid, float(s)) for grid, s in zip(maps, scales, strict=True)]
    described = clock.run("features", describe_maps, maps, config, progress)
    hypotheses = clock.run("pairs", search_all_pairs, described, config, progress)
    structures = [item.structure for item in described]
    agreement = clock.run("tree", grow_groups, maps, structures, hypotheses, config.robust.consensus)
    groups = clock.run("averaging", refine_groups, described, hypotheses, agreement, config)
    findings = Findings(described, hypotheses, agreement, groups)
    placements, pairs = place_groups(findings, config, scales), judge_pairs(findings, config)
    merged = clock.run("compositing", composite_largest, maps, placements, config)
    return MergeResult(
        method=config.method,
        seed=config.seed,
        version=__version__,
        reference=str(config.reference),
        maps=placements,
        components=tuple(tuple(maps[member].name for member in group.members) for group in groups),
        pairs=pairs,
        objective=measure_objective(pairs, placements),
        runtime_s=clock.read(),
        merged=merged,
    )
