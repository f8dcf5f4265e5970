"""Drawings as text: nothing that is drawn is cut off."""

import re

import pytest

from bench.reports.svg import Svg, write_file


@pytest.mark.parametrize("num_words", [1, 3, 12])
def test_the_whole_legend_lies_inside_the_file_below_the_drawings(num_words):
    legend = [(f"method {k}", "#2f7ed8") for k in range(num_words)]
    text = write_file([Svg("<g/>", 160.0, 90.0), Svg("<g/>", 120.0, 70.0)], legend)
    width, height = (float(v) for v in re.findall(r'viewBox="0 0 ([\d.]+) ([\d.]+)"', text)[0])
    swatches = [[float(v) for v in found] for found in re.findall(r'<rect x="([\d.]+)" y="([\d.]+)" width="10"', text)]
    assert len(swatches) == num_words
    assert all(0.0 <= x <= width - 10.0 and 90.0 <= y <= height - 10.0 for x, y in swatches)
