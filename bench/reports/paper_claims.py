"""In plain sentences: do our Tables 1 and 2 bear out what the paper claims? Those that do not say DISAGREES."""

import math
from collections.abc import Sequence
from typing import Any

import pandas as pd

from bench.reports.tables import Results

_CLAIMS = (
    ("Obj.", "error (Obj.)", "more accurate"),
    ("median m", "true median error", "more accurate"),
    ("T(s)", "time", "faster"),
)
"""Column, what it is called, and what the paper claims of it."""
_EQUAL_WITHIN = 0.02


def first_words(sentences: Sequence[str]) -> list[str]:
    """The sentences that disagree first, for whoever reads only the beginning."""
    return sorted(sentences, key=lambda s: "DISAGREES" not in s)


def judge_table1(table: pd.DataFrame, dataset: str) -> list[str]:
    """What our Table 1 says of the paper's claims about one dataset.

    Args:
        table: The table of `bench.reports.paper_tables.make_table1`.
        dataset: Its rows.
    """
    ours: Any = table[table["dataset"] == dataset].set_index("method")
    sentences = [_judge_success(ours, dataset, method) for method in ours.index]
    if {"sequential", "paper"} <= set(ours.index):
        for column, what, claim in _CLAIMS:
            ratio = float(ours.loc["sequential", column] / ours.loc["paper", column])
            sentences.append(_compare(dataset, what, ratio, claim) + _say_how_many(ours, column))
    return [s for s in sentences if s]


def _judge_success(ours: Any, dataset: str, method: str) -> str:
    claim, wrong, missing = (
        ours.loc[method, "paper's Suc."],
        int(ours.loc[method, "wrong"]),
        int(ours.loc[method, "maps"] - ours.loc[method, "placed"]),
    )
    found = f"{wrong} of the maps placed wrong and {missing} left out"
    if not ours.loc[method, "answers"]:
        return f"{dataset}: {method} gave no answer."
    if claim == "Y" and (wrong or missing):
        return f"{dataset}: DISAGREES with the paper's Suc. = Y for {method}: {found}."
    if claim == "N" and not (wrong or missing):
        return f"{dataset}: DISAGREES with the paper's Suc. = N for {method}: every map is placed right."
    return f"{dataset}: agrees with the paper's Suc. = {claim} for {method}: {found}." if claim in ("Y", "N") else ""


def _say_how_many(ours: Any, column: str) -> str:
    """Errors of different maps are compared with care: a map that is left out has none."""
    placed = [int(ours.loc[method, "placed"]) for method in ("sequential", "paper")]
    if column == "T(s)" or placed[0] == placed[1] or math.isnan(ours.loc["sequential", column]):
        return ""
    return f" Errors of {placed[0]} placed maps against {placed[1]}."


def _compare(dataset: str, what: str, ratio: float, claim: str) -> str:
    if math.isnan(ratio):
        return ""
    found = f"that simultaneous merging is {claim}: sequential has {ratio:.3g} times its {what}."
    if abs(ratio - 1.0) < _EQUAL_WITHIN:
        return f"{dataset}: DISAGREES {found} They are equal within {100 * _EQUAL_WITHIN:.0f} %."
    return f"{dataset}: {'agrees' if ratio > 1.0 else 'DISAGREES'} {found}"


def judge_table2(dataset: str, group: pd.DataFrame, results: Results) -> list[str]:
    """What our Table 2 says of the paper's claims about one dataset.

    Args:
        dataset: Its name.
        group: Its rows of `bench.reports.paper_tables.make_table2`.
        results: Everything found, with the maps that each order places.
    """
    fine, coarse = group["fine"].dropna(), group["coarse"].dropna()
    if fine.empty:
        return [f"{dataset}: no order gives a merged map."]
    spread = float(fine.max() - fine.min()) / max(float(fine.mean()), 1e-12)
    word = "agrees" if spread < 0.01 else "DISAGREES"
    same = _same_placed(results, dataset)
    gain = float(coarse.mean() / fine.mean()) if len(coarse) else float("nan")
    better = "agrees" if gain > 1.0 else "DISAGREES"
    return [
        f"{dataset}: {word} that the order does not matter: fine errors differ by {_percent(spread)}, "
        f"the placed maps are {'the same' if same else 'not the same'}.",
        f"{dataset}: {better} that averaging reduces the error: coarse is {gain:.3g} times fine.",
    ]


def _percent(share: float) -> str:
    return f"{100 * share:.2g} %" if share >= 1e-4 else "less than 0.01 %"


def _same_placed(results: Results, dataset: str) -> bool:
    maps: Any = results.maps
    if maps.empty:
        return True
    of_dataset = maps[(maps["dataset"] == dataset) & maps["placed"].astype(bool)]
    sets = {tuple(sorted(names)) for _, names in of_dataset.groupby(["method", "seed", "order"])["map"]}
    return len(sets) == 1
