"""Do synthetic data look as real data do? The statistics side by side, and whether they lie in the span of the real.

A share of few pairs says little: what is known of a real log is the 95 % interval of its share, not the share alone.
"""

import math
from collections.abc import Sequence
from dataclasses import asdict

import pandas as pd

from bench.reports.fidelity import SHARES, Fidelity
from bench.scoring.statistics import wilson_share

WIDENED_BY = 0.25
"""Share by which the span of the real logs is widened at either end."""

EXPLANATION = (
    "\nIn this table a statistic has a row, a dataset a column. From and to: the span of the real logs, of shares "
    "that of their 95 % intervals, widened by a quarter; outside: the synthetic datasets that leave it. Low, mid and "
    "high are pairs that overlap by up to 0.2, 0.4 and 1."
)
"""What the columns of the table mean."""


def compare_fidelity(statistics: dict[str, Fidelity], real: Sequence[str]) -> tuple[pd.DataFrame, list[str]]:
    """Statistics side by side, one row each, with the span of the real logs and which synthetic ones lie outside.

    The span reaches from the smallest real value to the largest, widened; of a share from the lower end of the smallest
    95 % interval to the upper end of the largest.

    Args:
        statistics: By dataset.
        real: Which of them are real.

    Returns:
        The table, and a sentence for every statistic that lies outside.
    """
    rows: list[dict[str, object]] = []
    sentences = []
    for name in asdict(next(iter(statistics.values()))):
        if name == "num_pairs":
            continue
        values = {label: float(getattr(found, name)) for label, found in statistics.items()}
        low, high = _span([statistics[label] for label in real], name)
        outside = [k for k, v in values.items() if k not in real and (v < low or v > high)]
        rows.append({"statistic": name, **values, "from": low, "to": high, "outside": ", ".join(outside)})
        if name in SHARES:
            counts = {label: float(found.num_pairs[name]) for label, found in statistics.items()}
            rows.append({"statistic": f"{name}: pairs", **counts, "from": math.nan, "to": math.nan, "outside": ""})
        sentences += [f"{k}: {name} is {values[k]:.3g}, outside {low:.3g} to {high:.3g}." for k in outside]
    return pd.DataFrame(rows), sentences


def _span(real: Sequence[Fidelity], name: str) -> tuple[float, float]:
    """What real logs allow a statistic to be, widened; NaN where none of them knows."""
    known = [(found, float(getattr(found, name))) for found in real]
    known = [(found, value) for found, value in known if math.isfinite(value)]
    if not known:
        return math.nan, math.nan
    ends = [(value, value) for _, value in known]
    if name in SHARES:
        counted = [(round(value * found.num_pairs[name]), found.num_pairs[name]) for found, value in known]
        ends = [(share.low, share.high) for share in (wilson_share(*count) for count in counted)]
    return min(low for low, _ in ends) * (1 - WIDENED_BY), max(high for _, high in ends) * (1 + WIDENED_BY)
