"""The answer of the sequential method: the maps that were merged, and why the others were not."""

from collections.abc import Sequence

import numpy as np

from merger import __version__, se2
from merger.grid_map import GridMap
from merger.merge_config import MergeConfig
from merger.result import MapPlacement, MergeResult, Objective, PairResult


def place_merged(maps: Sequence[GridMap], steps: Sequence[PairResult], reference: str) -> tuple[MapPlacement, ...]:
    """Place the merged maps in the reference's frame, and leave the others alone.

    Args:
        maps: The maps, in the order in which they were merged.
        steps: What became of each but the first.
        reference: Name of the map whose frame is asked for.

    Returns:
        Placements in the order of names.
    """
    first = maps[0].name
    fine = {step.source: step.T_target_source for step in steps if step.T_target_source is not None}
    coarse = {step.source: step.T_target_source_initial for step in steps if step.T_target_source_initial is not None}
    fine[first] = coarse[first] = np.eye(3)
    group = sorted(fine)
    root = reference if reference in fine else group[0]
    if len(group) == 1:
        return _place_nothing(maps, steps)
    placements = [
        MapPlacement(
            name,
            True,
            0,
            np.eye(3) if name == root else se2.invert(fine[root]) @ fine[name],
            np.eye(3) if name == root else se2.invert(coarse[root]) @ coarse[name],
        )
        for name in group
    ]
    left_out = sorted((step for step in steps if step.source not in fine), key=lambda step: step.source)
    placements += [
        MapPlacement(step.source, False, number, reason=f"not merged when its turn came: {step.reason}")
        for number, step in enumerate(left_out, start=1)
    ]
    return tuple(sorted(placements, key=lambda placement: placement.name))


def assemble_steps(
    config: MergeConfig, placements: tuple[MapPlacement, ...], steps: Sequence[PairResult], merged: GridMap | None
) -> MergeResult:
    """The result of the placements, the steps, in the order of the sources' names, and the merged map."""
    count = max(placement.component for placement in placements) + 1
    components = tuple(
        tuple(placement.name for placement in placements if placement.component == number) for number in range(count)
    )
    pairs = tuple(sorted(steps, key=lambda step: step.source))
    objective = Objective(num_reliable=sum(step.T_target_source is not None for step in steps))
    return MergeResult(
        config.method, config.seed, __version__, str(config.reference), placements, components, pairs, objective,
        merged=merged,
    )  # fmt: skip


def _place_nothing(maps: Sequence[GridMap], steps: Sequence[PairResult]) -> tuple[MapPlacement, ...]:
    reasons = {step.source: f"not merged when its turn came: {step.reason}" for step in steps}
    names = sorted(grid.name for grid in maps)
    return tuple(
        MapPlacement(name, False, number, reason=reasons.get(name, "no other map could be merged into it"))
        for number, name in enumerate(names)
    )
