"""``python -m bench.gate DIR --baseline FILE``: is a run of the bench worse than it once was?

``DIR`` is what ``python -m bench`` left behind. Exit status 0: no score is worse than its tolerance; 1: at least one
is, and a table says which; 2: bad input, one line. ``--update`` takes the scores of ``DIR`` as the new baseline.
"""

import argparse
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from bench.gates.baseline import read_baseline, write_baseline
from bench.gates.comparison import Comparison, Finding, compare_rows
from bench.gates.junit import write_junit
from bench.gates.rows import cell_label, read_rows
from bench.gates.tolerances import ANOTHER_MACHINE, COSTS, change_tolerances

_SHOWN = 200
_COLUMNS = ("cell", "seed", "score", "before", "after", "tolerance")


@dataclass(frozen=True)
class GateConfig:
    """What is compared with what."""

    folder: Path
    """Folder of results, with ``scores.csv``."""
    baseline: Path
    """The baseline's JSON file."""
    tolerances: Mapping[str, float] = field(default_factory=dict)
    """Absolute tolerances that replace those of `bench.gates.tolerances.TOLERANCES`, by score."""
    costs: bool = True
    """Whether time and memory are judged, and kept in baselines."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit status."""
    options = _parse(arguments)
    try:
        config = GateConfig(options.folder, options.baseline, _tolerances(options), not options.no_costs)
        if options.update:
            _say(f"{options.baseline}: {update_baseline(config)} rows", options.quiet)
            return 0
        comparison = check_gate(config)
        if options.junit:
            write_junit(options.junit, comparison)
    except (ValueError, OSError) as error:
        sys.stderr.write(f"bench.gate: {' '.join(str(error).split())}\n")
        return 2
    _say(describe(comparison), options.quiet and not comparison.findings)
    return 1 if comparison.findings else 0


def check_gate(config: GateConfig) -> Comparison:
    """Compare a folder of results with a baseline.

    Raises:
        ValueError: either cannot be read, or a tolerance is not known.
    """
    tolerances = [t for t in change_tolerances(config.tolerances) if config.costs or t.score not in COSTS]
    return compare_rows(read_baseline(config.baseline), read_rows(config.folder / "scores.csv"), tolerances)


def update_baseline(config: GateConfig) -> int:
    """Make a folder's scores the baseline, and return how many rows it has.

    Raises:
        ValueError: the scores cannot be read, or not one row is ok.
    """
    rows = read_rows(config.folder / "scores.csv")
    if not any(row.status == "ok" for row in rows):
        raise ValueError(
            f"no baseline from a run without an ok row: {rows[0].label} {rows[0].status}: {rows[0].reason}"
        )
    write_baseline(config.baseline, rows, costs=config.costs)
    return len(rows)


def describe(comparison: Comparison) -> str:
    """A comparison for a person: what got worse as a table, then the verdict."""
    findings = comparison.findings
    lines = _table(findings[:_SHOWN]) if findings else []
    if len(findings) > _SHOWN:
        lines.append(f"... and {len(findings) - _SHOWN} more")
    if comparison.new:
        lines.append(f"not in the baseline, not judged: {_first(comparison.new)}")
    if comparison.without_result:
        lines.append(f"without a result in the baseline, not judged: {_first(comparison.without_result)}")
    compared = f"{comparison.num_pairs} rows of {len(comparison.cells)} cells compared"
    if comparison.other_data:
        lines.append(f"not the baseline's data (make it anew with --update): {_first(comparison.other_data)}")
    lines += [f"time of {method}: {text}" for method, text in comparison.times]
    verdict = f"{len(findings) or 'no'} score{'s' * (len(findings) > 1)} got worse"
    return "\n".join([*lines, f"gate: {verdict}, {compared}"])


def _first(labels: Sequence[str]) -> str:
    return ", ".join(labels[:5]) + " ..." * (len(labels) > 5)


def _table(findings: Sequence[Finding]) -> list[str]:
    rows = [_COLUMNS, *((cell_label(f.cell), f.seeds, f.score, f.before, f.after, f.tolerance) for f in findings)]
    widths = [max(len(row[k]) for row in rows) for k in range(len(_COLUMNS))]
    lines = ["  ".join(text.ljust(width) for text, width in zip(row, widths, strict=True)).rstrip() for row in rows]
    return [lines[0], "-" * max(map(len, lines)), *lines[1:]]


def _tolerances(options: argparse.Namespace) -> dict[str, float]:
    changes = dict(ANOTHER_MACHINE) if options.another_machine else {}
    for text in options.tolerance:
        name, _, value = text.partition("=")
        try:
            changes[name] = float(value)
        except ValueError:
            raise ValueError(f"--tolerance must be SCORE=NUMBER, got '{text}'") from None
    return changes


def _parse(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m bench.gate", description=__doc__.partition("\n\n")[0])
    parser.add_argument("folder", type=Path, metavar="DIR", help="what python -m bench wrote")
    parser.add_argument("--baseline", type=Path, required=True, metavar="FILE", help="JSON file to compare with")
    parser.add_argument("--update", action="store_true", help="rewrite FILE with the scores of DIR")
    parser.add_argument("--junit", type=Path, metavar="FILE", help="write the answer as JUnit XML, too")
    parser.add_argument(
        "--tolerance", action="append", default=[], metavar="SCORE=NUMBER", help="how much worse a score may get"
    )
    parser.add_argument("--another-machine", action="store_true", help="allow for what another processor changes")
    parser.add_argument("--no-costs", action="store_true", help="neither judge nor keep time and memory")
    parser.add_argument("--quiet", action="store_true", help="say nothing while all is well")
    return parser.parse_args(arguments)


def _say(text: str, quiet: bool) -> None:
    if not quiet:
        sys.stdout.write(text + "\n")


if __name__ == "__main__":
    sys.exit(main())
