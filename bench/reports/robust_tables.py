"""Can a merger be trusted? Wrong placements, placements that were possible, accuracy, pairs, time beside the paper's.

Each column's definition is in the function that fills it.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

from bench.reports.tables import Results, write_swept
from bench.scoring.statistics import wilson_share

CONNECTED_FROM = 0.2
"""A map can be placed if its true overlap with another, in the better direction, is at least this."""
RECALL_BINS = ((0.5, 1.0), (0.3, 0.5), (0.2, 0.3), (0.1, 0.2))
"""Bins of true overlap, the lower end included."""
APART_BELOW = 0.01
"""Pairs of less true overlap have nothing in common: a motion for them is false."""
REFERENCE = "paper"
"""The method whose time is the unit."""

EXPLANATION = (
    " In this table errors are those of the maps that are not wrong. Can be: maps that have 0.2 or more in common with "
    "another; right: those of them that are placed and not wrong. At most, at least: the ends of the 95 % intervals."
)
"""What the columns of the table mean."""

_SPLIT_BY = "submaps.overlap"
_RUN = ("dataset", "seed", "order")


def make_robust_table(results: Results) -> tuple[pd.DataFrame, list[str]]:
    """One row for each dataset, overlap of the cut and method, and sentences about pairs and time, one a method."""
    by = ["dataset", *([_SPLIT_BY] if _SPLIT_BY in results.swept else []), "method"]
    runs = [*_RUN, *results.swept]
    possible = connected_maps(results.pairs, runs)
    maps = results.maps if results.maps.empty else results.maps.merge(possible, on=[*runs, "map"], how="left")
    rows = []
    for keys, group in results.scores.groupby(by, sort=False, dropna=False):
        row = dict(zip(by, keys, strict=True)) | {"runs": len(group)}
        of_group = maps if maps.empty else maps[(maps[by] == pd.Series(dict(zip(by, keys, strict=True)))).all(axis=1)]
        rows.append(row | placement_columns(of_group))
    table = write_swept(pd.DataFrame(rows), results.swept)
    sentences = [pair_sentence(m, results.pairs) for m in dict.fromkeys(results.scores["method"])]
    return table, [*filter(None, sentences), *time_sentences(results.scores, runs)]


def connected_maps(pairs: pd.DataFrame, runs: Sequence[str]) -> pd.DataFrame:
    """The maps of each run that can be placed: they overlap another by `CONNECTED_FROM` or more, in either direction.

    Args:
        pairs: One row a pair, with ``overlap_true``; methods that name no pair add nothing.
        runs: Columns that name a run's data.

    Returns:
        The columns of ``runs``, ``map`` and ``possible`` (always true), each map once.
    """
    if pairs.empty:
        return pd.DataFrame(columns=[*runs, "map", "possible"])
    near = pairs[pairs["overlap_true"] >= CONNECTED_FROM]
    ends = [near[[*runs, end]].rename(columns={end: "map"}) for end in ("target", "source")]
    return pd.concat(ends).drop_duplicates().assign(possible=True)


def placement_columns(maps: pd.DataFrame) -> dict[str, Any]:
    """Counts, shares with Wilson's 95 % interval, and accuracy of one group of maps.

    ``wrong`` is of the placed maps; ``right`` is of the maps that can be placed (`connected_maps`): placed and not
    wrong; ``median m``, ``worst m`` and ``worst deg`` are over the placed maps that are not wrong. NaN where empty.
    """
    if maps.empty:
        return {}
    placed, wrong = maps["placed"].astype(bool), maps["wrong"].astype(bool)
    possible = maps["possible"].notna() & maps["possible"].astype("boolean").fillna(value=False).astype(bool)
    right = placed & ~wrong
    wrong_share = wilson_share(int(wrong.sum()), int(placed.sum()))
    right_share = wilson_share(int((right & possible).sum()), int(possible.sum()))
    errors = maps[right]
    return {
        "maps": len(maps),
        "placed": int(placed.sum()),
        "wrong": int(wrong.sum()),
        "wrong %": 100 * wrong_share.value,
        "at most %": 100 * wrong_share.high,
        "can be": int(possible.sum()),
        "right": int((right & possible).sum()),
        "right %": 100 * right_share.value,
        "at least %": 100 * right_share.low,
        "median m": float(errors["error_m"].median()),
        "worst m": float(errors["error_m"].max()),
        "worst deg": float(errors["error_deg"].max()),
    }


def pair_sentence(method: str, pairs: pd.DataFrame) -> str | None:
    """Recall by true overlap and false accepts of one method; none where it names no pair.

    Recall is the share of a bin's pairs with a right, reliable motion; a false accept is a reliable motion between
    maps that have less than `APART_BELOW` in common.
    """
    own = pairs[pairs["method"] == method] if not pairs.empty else pairs
    if own.empty:
        return None
    reliable = own["status"] == "reliable"
    texts = []
    for low, high in RECALL_BINS:
        inside = (own["overlap_true"] >= low) & (own["overlap_true"] < (high if high < 1.0 else np.inf))
        found = wilson_share(int((inside & reliable & own["right"].astype(bool)).sum()), int(inside.sum()))
        texts += [f"{low:g}-{high:g}: {found.value:.3f} of {found.trials}"] if found.trials else []
    apart = own["overlap_true"] < APART_BELOW
    false = wilson_share(int((apart & reliable).sum()), int(apart.sum()))
    return (
        f"{method}: recall of pairs by true overlap {', '.join(texts)}; false accepts {false.successes} of "
        f"{false.trials} pairs that have nothing in common (at most {1000 * false.high:.1f} in 1,000)"
    )


def time_sentences(scores: pd.DataFrame, runs: Sequence[str]) -> list[str]:
    """Each method's time over that of `REFERENCE` on the same data: the median over all runs that both finished."""
    times = scores[scores["status"] == "ok"].pivot_table(index=list(runs), columns="method", values="runtime_s")
    if REFERENCE not in times:
        return []
    others = [str(name) for name in times.columns if name != REFERENCE]
    ratios = {name: (times[name] / times[REFERENCE]).dropna() for name in others}
    return [
        f"{name} takes {ratio.median():.2f} times the time of {REFERENCE} (median of {len(ratio)} runs, "
        f"{ratio.quantile(0.1):.2f} to {ratio.quantile(0.9):.2f} for most)"
        for name, ratio in ratios.items()
        if len(ratio)
    ]
