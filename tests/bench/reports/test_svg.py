"""Drawings as text: nothing that is drawn is cut off."""

import re
from pathlib import Path

import pandas as pd
import pytest

from bench.reports.curves import draw_success
from bench.reports.svg import Entry, Svg, write_file


@pytest.mark.parametrize("num_words", [1, 3, 12])
def test_the_whole_legend_lies_inside_the_file_below_the_drawings(num_words):
    legend = [Entry(f"method {k}", "#2f7ed8", "▲") for k in range(num_words)]
    text = write_file([Svg("<g/>", 160.0, 90.0), Svg("<g/>", 120.0, 70.0)], legend)
    width, height = (float(v) for v in re.findall(r'viewBox="0 0 ([\d.]+) ([\d.]+)"', text)[0])
    marks = [[float(v) for v in found] for found in re.findall(r'<text x="([\d.]+)" y="([\d.]+)"[^>]*>▲<', text)]
    assert len(marks) == num_words
    assert all(0.0 <= x <= width - 12.0 and 100.0 <= baseline <= height - 4.0 for x, baseline in marks)


def test_swept_words_are_drawn_as_they_are(tmp_path: Path) -> None:
    words = ["$\\frac{$", "<b> & 'c'"]
    curve = pd.DataFrame({"method": "a & b", "runs": 1, "key": words})
    for name in ("success", "right", "wrong"):
        curve = curve.assign(**{name: 0.5, f"{name}_low": 0.1, f"{name}_high": 0.9})
    picture = draw_success(curve, "key", tmp_path)
    assert len(picture.panels) == 3
    text = (tmp_path / "success-key.svg").read_text(encoding="utf-8")
    assert text.count("$\\frac{$</text>") == text.count("&lt;b&gt; &amp; 'c'</text>") == 3
    assert "a &amp; b</text>" in text
