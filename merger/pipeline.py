"""Merge maps: the paper's Algorithm 4, and the choice between it and its rivals."""

from collections.abc import Callable, Sequence
from dataclasses import replace

from merger.assembly import assemble_result, composite_largest, place_maps, sort_maps
from merger.grid_map import GridMap, crop_to_known
from merger.merge_config import MergeConfig, Progress
from merger.result import MergeResult, Method
from merger.rival.sequential import merge_sequentially
from merger.robust.pipeline import merge_robustly
from merger.stage_clock import StageClock
from merger.stages import confirm_motions, merge_all_pairs, prepare_maps, refine_motions

__all__ = ["MergeConfig", "Method", "Progress", "merge_maps"]

MergeMethod = Callable[[Sequence[GridMap], MergeConfig, Progress], MergeResult]
"""A way to merge: ``(maps, config, progress) -> result``; the reference in the config is one of the maps."""


def merge_maps(
    maps: Sequence[GridMap], config: MergeConfig | None = None, *, progress: Progress | None = None
) -> MergeResult:
    """Merge any number of occupancy grids into one, without knowing where they lie.

    Args:
        maps: The maps, of unique names.
        config: The settings; None: the defaults.
        progress: Called as ``progress(stage, done, total)`` while the work goes on.

    Returns:
        Where each map lies, the evidence, and the merged map. The order of the maps changes nothing but the default
        reference (and, in the method ``sequential``, everything).

    Raises:
        ValueError: no map, two maps of one name, an unknown reference, or maps that the method cannot merge.
    """
    config = config or MergeConfig()
    names = [grid.name for grid in maps]
    if not names:
        raise ValueError("there is no map to merge")
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise ValueError(f"two maps have the name '{twice}'")
    reference = names[0] if config.reference is None else config.reference
    if reference not in names:
        raise ValueError(f"the reference '{reference}' is none of the maps {', '.join(sorted(names))}")
    known = [crop_to_known(grid) for grid in maps]  # Pictures are often larger than what was seen.
    return METHODS[config.method](known, replace(config, reference=reference), progress or _ignore)


def merge_by_paper(maps: Sequence[GridMap], config: MergeConfig, progress: Progress) -> MergeResult:
    """Merge maps as the paper does: Algorithm 4, line by line."""
    clock = StageClock()
    maps = sort_maps(maps)
    prepared = clock.run("features", prepare_maps, maps, config, progress)
    pairs = clock.run("pairs", merge_all_pairs, prepared, config, progress)  # Algorithm 1.
    confirmed = clock.run("tree", confirm_motions, prepared, pairs, config)  # Algorithm 2.
    fine = clock.run("averaging", refine_motions, confirmed, config)  # Algorithm 3.
    placements = place_maps(prepared, fine, confirmed, config)
    merged = clock.run("compositing", composite_largest, maps, placements, config)
    return replace(assemble_result(config, placements, confirmed, fine, merged), runtime_s=clock.read())


METHODS: dict[Method, MergeMethod] = {
    Method.PAPER: merge_by_paper,
    Method.ROBUST: merge_robustly,
    Method.SEQUENTIAL: merge_sequentially,
}
"""The ways to merge, by name."""


def _ignore(stage: str, done: int, total: int) -> None:
    """Progress that nobody wants to see."""
