"""The gate as a pytest fixture, ``merge_gate``: a merger that got worse is a test that fails.

Installing the package installs the fixture. In a test suite of one's own::

    def test_my_merger_is_as_good_as_it_was(merge_gate):
        merge_gate("merger.json", command="my_merger {maps} {out}", overrides=["world=tim", "submaps.count=6"])

    def test_my_function_is_as_good_as_it_was(merge_gate):
        merge_gate("function.json", merger=my_package.merge, datasets=["data/office"])

``command`` is any program that reads a folder of `map_server` maps and writes ``result.json``; ``merger`` is a function
at the top level of a module, from a list of `merger.grid_map.GridMap` to a `merger.result.MergeResult` or to the
dictionary of ``result.json``. Both run in a process of their own. ``overrides`` is what would follow
``python -m bench``; ``datasets`` are folders that ``python -m sim`` made. ``tolerances={"max_error_m": 0.05}`` changes
how much worse a score may get, ``costs=True`` judges time and memory, too, and ``name`` names the method.

The baseline's path is relative to the test's file; ``pytest --merge-gate-update`` writes it.
`bench.gates.tolerances` says what is compared.
"""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from bench.gates.comparison import Comparison

_UPDATE = "--merge-gate-update"


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the option that rewrites baselines."""
    group = parser.getgroup("merge gate")
    group.addoption(_UPDATE, action="store_true", help="make what mergers reach now the baselines of merge_gate")


@pytest.fixture
def merge_gate(request: pytest.FixtureRequest, tmp_path: Path) -> Callable[..., "Comparison"]:
    """A function that runs a merger and fails the test if a score is worse than the baseline's."""
    update = bool(request.config.getoption(_UPDATE))

    def gate(baseline: str | Path, **settings: Any) -> "Comparison":
        from bench.gates import merge_gate as gate_run  # noqa: PLC0415  # every pytest run loads this file: keep it light

        config = gate_run.MergeGateConfig(
            baseline=request.path.parent / baseline,
            datasets=tuple(request.path.parent / folder for folder in settings.pop("datasets", ())),
            overrides=tuple(settings.pop("overrides", ())),
            **settings,
        )
        fault, comparison = None, None
        try:
            comparison = gate_run.run_merge_gate(config, tmp_path, update=update)
        except ValueError as error:
            fault = f"merge_gate: {error}"
        if comparison is None:
            pytest.fail(str(fault), pytrace=False)
        if comparison.findings:
            pytest.fail("\n".join(finding.message for finding in comparison.findings), pytrace=False)
        return comparison

    return gate
