"""Drawings as text: nothing that is drawn is cut off."""

import re

import pytest

from bench.reports.svg import Entry, Svg, write_file


@pytest.mark.parametrize("num_words", [1, 3, 12])
def test_the_whole_legend_lies_inside_the_file_below_the_drawings(num_words):
    legend = [Entry(f"method {k}", "#2f7ed8", "▲") for k in range(num_words)]
    text = write_file([Svg("<g/>", 160.0, 90.0), Svg("<g/>", 120.0, 70.0)], legend)
    width, height = (float(v) for v in re.findall(r'viewBox="0 0 ([\d.]+) ([\d.]+)"', text)[0])
    marks = [[float(v) for v in found] for found in re.findall(r'<text x="([\d.]+)" y="([\d.]+)"[^>]*>▲<', text)]
    assert len(marks) == num_words
    assert all(0.0 <= x <= width - 12.0 and 100.0 <= baseline <= height - 4.0 for x, baseline in marks)
