"""The report in a real browser: nothing is cut off at the widths of a phone and of a desk, nothing is fetched."""

import re
import shutil
import subprocess
from pathlib import Path

import pandas as pd
import pytest

from bench.reports import curves
from bench.reports.report import Report, Section, write_report

CHROMIUM = shutil.which("chromium") or shutil.which("google-chrome")
MEASURE = """<iframe src="report.html" style="width: {width}px; height: 800px; border: 0"></iframe>
<script>onload = () => {{
  const frame = document.querySelector("iframe"), page = frame.contentDocument.documentElement;
  const fetched = frame.contentWindow.performance.getEntriesByType("resource").length;
  document.title = `${{page.scrollWidth - page.clientWidth}} ${{fetched}} ${{page.querySelectorAll("svg").length}}`;
}}</script>"""


def write_example(folder: Path) -> None:
    """A report with a wide table and a figure."""
    scores = pd.DataFrame({"method": ["paper", "robust"], "noise.range_sigma_m": [0.01, 0.1]})
    wide = scores.assign(**{f"a_long_name_{k}": 0.123456 for k in range(20)})
    curve = scores.assign(success=0.5, success_low=0.2, success_high=0.8, wrong=0.1, wrong_low=0.0, wrong_high=0.4)
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
    measured = re.search(r"<title>(\d+) (\d+) (\d+)</title>", page)
    assert measured is not None, page
    assert [int(word) for word in measured.groups()] == [0, 0, 2]
