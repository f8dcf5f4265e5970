"""Merge maps: the paper's Algorithm 4, and the choice between it and its rivals."""

from collections.abc import Callable, Sequence

from merger.grid_map import GridMap
from merger.merge_config import MergeConfig, Progress
from merger.result import MergeResult, Method

__all__ = ["MergeConfig", "Method", "Progress", "merge_maps"]

MergeMethod = Callable[[Sequence[GridMap], MergeConfig, Progress], MergeResult]
"""A way to merge: ``(maps, config, progress) -> result``."""


def merge_maps(
    maps: Sequence[GridMap], config: MergeConfig | None = None, *, progress: Progress | None = None
) -> MergeResult:
    """Merge any number of occupancy grids into one, without knowing where they lie.

    Args:
        maps: The maps, of unique names.
        config: The settings; None: the defaults.
        progress: Called as ``progress(stage, done, total)`` while the work goes on.

    Returns:
        Where each map lies, the evidence, and the merged map.

    Raises:
        ValueError: no map, two maps of one name, an unknown reference, or maps that the method cannot merge.
    """
    raise NotImplementedError(f"{len(maps)} maps")
