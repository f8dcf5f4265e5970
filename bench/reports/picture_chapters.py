"""The chapters that are mostly pictures: merged maps, pairs, errors, and the gallery of failures."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from bench.reports import error_curves, figures
from bench.reports.drawing import Picture
from bench.reports.exhibit import Exhibit, load_exhibit
from bench.reports.report import MAX_ROWS, Section
from bench.reports.tables import Results
from bench.scoring import pair_metrics
from bench.stages import ScoredCell

MAX_FAILURES = 6
"""Failures in the gallery."""
MOST_PANELS = 9
"""Panels of a chapter that are all shown; of more the pictures are folded, or all but the first."""
_RECALL_WORDS = {
    "overlap": "true overlap",
    "recall_low": "low",
    "recall_high": "high",
    "recall_initial": "before confirmation",
    "false": "false, confirmed",
}
_GALLERY_TEXT = (
    "Runs with maps in wrong places: what the method made of it, the truth, and the confirmed pair that misled it."
)


def error_chapter(results: Results, folder: Path) -> Section:
    """How far maps are off, which pairs are found, and whether confidences are honest."""
    pictures = [error_curves.draw_errors(results, folder), error_curves.draw_reliability(results, folder)]
    table = None
    if not results.pairs.empty:
        table = error_curves.recall_by_overlap(results)
        pictures.insert(1, error_curves.draw_recall(table, folder))
    text = (
        "False: pairs that the method confirms although the truth contradicts them. The intervals treat pairs and maps "
        "of one run as if they were independent: they are rather too narrow."
    )
    if table is not None:
        table = table.rename(columns=_RECALL_WORDS)
    folded = table is not None and len(table) > MAX_ROWS
    return Section("Errors, pairs and confidences", text, tuple(p for p in pictures if p), table, folded=folded)


def picture_chapters(exhibits: Sequence[Exhibit], folder: Path) -> tuple[Section, Section, Section]:
    """Methods side by side (Fig. 9), merged maps (Fig. 8), and pairs (Figs. 6 and 7)."""
    merged = [figures.draw_coarse_fine(e, folder) for e in exhibits]
    pairs: list[Picture] = []
    for exhibit in exhibits:
        if exhibit.prediction.pairs:
            pairs.append(figures.draw_pairs(exhibit, folder))
            unreliable = figures.draw_unreliable_pair(exhibit, folder)
            pairs += [unreliable] if unreliable else []
    by_dataset: dict[object, list[Exhibit]] = {}
    for exhibit in exhibits:
        by_dataset.setdefault((exhibit.label, exhibit.scored.cell.dataset.swept), []).append(exhibit)
    rivals = [figures.draw_rivals(group, folder) for group in by_dataset.values() if len(group) > 1]
    walls = (
        "Each map has its own colour; where walls of different colours lie on each other, maps agree. Pieces that a "
        "method could not connect lie where each fits the truth best."
    )
    crosses = "A cross marks a motion that the truth contradicts."
    return (
        _fold(Section("Methods side by side", f"{walls} As the paper's Fig. 9.", tuple(rivals))),
        _fold(Section("Merged maps", f"{walls} As the paper's Fig. 8.", tuple(merged)), num_open=0),
        _fold(Section("Pairs of maps", f"{crosses} As the paper's Figs. 6 and 7.", tuple(pairs)), num_open=0),
    )


def gallery_chapter(cells: Sequence[ScoredCell], folder: Path) -> Section:
    """Runs with maps in wrong places, the worst first."""
    return _fold(Section("Gallery of failures", _GALLERY_TEXT, tuple(_gallery(cells, folder))))


def _fold(section: Section, num_open: int = 1) -> Section:
    """A section of many panels with all but its first pictures folded."""
    many = sum(len(picture.panels) for picture in section.pictures) > MOST_PANELS
    return replace(section, num_open=num_open) if many else section


def _gallery(cells: Sequence[ScoredCell], folder: Path) -> list[Picture]:
    failures = sorted((c for c in cells if c.score["num_wrong"]), key=lambda c: -c.score["num_wrong"])
    pictures = []
    for exhibit in filter(None, map(load_exhibit, failures[:MAX_FAILURES])):
        pictures.append(figures.draw_failure(exhibit, folder))
        truth = exhibit.dataset.truth.T_world_map
        false = [p for p in exhibit.prediction.pairs if p.status == "reliable" and not pair_metrics.is_right(p, truth)]
        if false:
            misleading = max(false, key=lambda p: (p.in_tree, float(np.nan_to_num(p.num_inliers))))
            stem = f"misled-{exhibit.scored.cell.seed}"
            pictures.append(figures.draw_pair(exhibit, misleading, folder, stem, "the pair that misled it"))
    return pictures
