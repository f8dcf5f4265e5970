"""The gate's answer as JUnit XML, which every CI system shows: one test case a cell.

Elements and attributes are those that Jenkins' schema knows (`junit-10.xsd`); control characters, which XML does not
allow, are left out.
"""

from pathlib import Path
from xml.etree import ElementTree

from bench.gates.comparison import CellComparison, Comparison
from bench.gates.rows import cell_label
from bench.one_line import one_line
from bench.store import write_bytes

_MOST = 2000
"""Characters of a message."""


def write_junit(path: Path, comparison: Comparison) -> None:
    """Write a comparison as JUnit XML, whole or not at all."""
    counts = {
        "tests": len(comparison.cells),
        "failures": sum(bool(cell.findings) for cell in comparison.cells),
        "skipped": sum(cell.skipped is not None and not cell.findings for cell in comparison.cells),
        "errors": 0,
    }
    attributes = {name: str(count) for name, count in counts.items()}
    root = ElementTree.Element("testsuites", {k: v for k, v in attributes.items() if k != "skipped"})  # it has no such
    suite = ElementTree.SubElement(root, "testsuite", {"name": "bench.gate", **attributes})
    for cell in comparison.cells:
        _add_case(suite, cell)
    ElementTree.indent(root)
    write_bytes(path, ElementTree.tostring(root, encoding="utf-8", xml_declaration=True))


def _add_case(suite: ElementTree.Element, cell: CellComparison) -> None:
    method = str(dict(cell.cell).get("method"))
    case = ElementTree.SubElement(
        suite, "testcase", {"classname": f"bench.gate.{method}", "name": cell_label(cell.cell)}
    )
    if cell.findings:
        messages = [one_line(finding.message, _MOST) for finding in cell.findings]
        failure = ElementTree.SubElement(case, "failure", {"message": messages[0], "type": "worse"})
        failure.text = "\n".join(messages)
    elif cell.skipped is not None:
        ElementTree.SubElement(
            case, "skipped", {"message": one_line(f"the baseline has no result: {cell.skipped}", _MOST)}
        )
