"""The report in a real browser: nothing is cut off on a phone or a desk, nothing is fetched; what its page offers."""

import re
import shutil
import subprocess
from pathlib import Path
from urllib.parse import unquote

import pandas as pd
import pytest

from bench.reports import curves
from bench.reports.report import Report, Section, write_report

CHROMIUM = shutil.which("chromium") or shutil.which("google-chrome")
MEASURE = """<iframe src="report.html" style="width: {width}px; height: 800px; border: 0"></iframe>
<script>onload = () => {{
  const frame = document.querySelector("iframe"), page = frame.contentDocument.documentElement;
  const fetched = frame.contentWindow.performance.getEntriesByType("resource").length;
  const [table, key] = [".scroll", "tbody .key"].map((name) => page.querySelector(name));
  table.scrollLeft = 1e6;
  const moved = key.getBoundingClientRect().left - table.getBoundingClientRect().left;
  const facts = [page.scrollWidth - page.clientWidth, fetched, Math.floor(moved), page.querySelectorAll("svg").length];
  document.title = facts.join(" ");
}}</script>"""


def write_example(folder: Path) -> None:
    """A report with a wide table and a figure."""
    scores = pd.DataFrame({"method": ["paper", "robust"], "noise.range_sigma_m": [0.01, 0.1]})
    wide = scores.assign(**{f"a_long_name_{k}": 0.123456 for k in range(20)})
    curve = scores.assign(success=0.5, success_low=0.2, success_high=0.8)
    for name in ("right", "wrong"):
        curve = curve.assign(**{name: 0.3, f"{name}_low": 0.1, f"{name}_high": 0.4})
    picture = curves.draw_success(curve, "noise.range_sigma_m", folder / "figures")
    sections = (Section("Results", "What to see. " * 40, (picture,), wide, ((0, "a_long_name_0"),), ("A point.",)),)
    command = "python -m bench " + "key=value " * 30
    write_report(folder / "report.html", Report("A title", command, sections, {"revision": "a" * 80}))


@pytest.mark.skipif(CHROMIUM is None, reason="no chromium is installed")
@pytest.mark.parametrize(("width", "scheme"), [(390, "dark"), (1280, "light")])
def test_the_report_fits_its_window_and_fetches_nothing(tmp_path: Path, width: int, scheme: str) -> None:
    write_example(tmp_path)
    (tmp_path / "frame.html").write_text(MEASURE.format(width=width))
    flags = [
        "--headless",
        "--no-sandbox",
        "--disable-gpu",
        "--allow-file-access-from-files",
        "--virtual-time-budget=2000",
    ]
    flags += [f"--user-data-dir={tmp_path}/profile", f"--blink-settings=preferredColorScheme={int(scheme == 'light')}"]
    command = [str(CHROMIUM), *flags, "--dump-dom", f"file://{tmp_path}/frame.html"]
    page = subprocess.run(command, capture_output=True, text=True, check=True, timeout=120).stdout
    measured = re.search(r"<title>(\d+) (\d+) (-?\d+) (\d+)</title>", page)
    assert measured is not None, page
    assert [int(word) for word in measured.groups()] == [0, 0, 1, 3]  # 1: the width of the table's border


def test_every_picture_says_what_it_shows_and_offers_its_files(tmp_path: Path) -> None:
    write_example(tmp_path)
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    files = [unquote(href) for href in re.findall(r'href="(figures/[^"]+)" download', page)]
    assert [Path(file).suffix for file in files] == [".svg", ".csv"]
    assert all((tmp_path / file).is_file() for file in files)
    assert 'role="img" aria-label="Runs without a fault' in page


def test_a_row_of_a_table_is_named_by_its_method_and_what_stands_before_it(tmp_path: Path) -> None:
    table = pd.DataFrame({"dataset": ["tim"], "noise": ["0.1"], "method": ["paper"], "placed": [4]})
    write_report(tmp_path / "report.html", Report("A title", "", (Section("Results", table=table),), {}))
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert '<th scope="row" class="key"><small>tim, 0.1</small>paper</th>' in page
    assert [text for _, text in re.findall(r'<td class="(.*?)">(.*?)</td>', page)] == ["tim", "0.1", "4"]


def test_a_long_chapter_is_folded_and_everything_can_be_reached_from_the_contents(tmp_path: Path) -> None:
    write_example(tmp_path)
    curve = pd.DataFrame({"method": ["paper"], "noise": [0.1], "runs": [1]})
    for name in ("success", "right", "wrong"):
        curve = curve.assign(**{name: 0.5, f"{name}_low": 0.1, f"{name}_high": 0.9})
    picture = curves.draw_success(curve, "noise", tmp_path / "figures")
    sections = (
        Section("Results", pictures=(picture,), table=curve, folded=True),
        Section("A gallery", pictures=(picture,) * 4, num_open=1),
    )
    write_report(tmp_path / "report.html", Report("A title", "", sections, {}))
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert re.findall(r"<details( open)?><summary>(?:<.*?>)?([\w ]+)", page) == [
        ("", "All 1 rows"),
        (" open", "Figure 2"),
        *(("", f"Figure {k}") for k in (3, 4, 5)),
    ]
    contents = re.findall(r'<a href="#(.*?)">', page)
    assert {"contents", "results", "a-gallery", "provenance"} == set(contents)
    assert all(page.count(f'id="{name}"') == 1 for name in contents)
