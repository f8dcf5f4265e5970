"""A Python function as a command: ``python -m bench.mergers.merger_call FUNCTION MAPS OUT``.

``FUNCTION`` is ``module:name`` or ``path/to/file.py:name``. The function takes the maps, a list of
`merger.grid_map.GridMap` in the order in which a sequential method is to take them, and gives a
`merger.result.MergeResult` or the dictionary that ``result.json`` is to hold.
"""

import importlib
import importlib.util
import inspect
import json
import shlex
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from merger.files.result_json import to_json_dict
from merger.grid_map import GridMap
from merger.map_server import read_map
from merger.result import MergeResult

Merger = Callable[[Sequence[GridMap]], MergeResult | Mapping[str, Any]]
"""Maps in, motions out."""

_MODULE = "merger_under_test"


def main() -> None:
    """Run the command line."""
    function, maps, out = sys.argv[1:]
    answer = load_merger(function)([read_map(path) for path in _ordered(Path(maps))])
    document = to_json_dict(answer) if isinstance(answer, MergeResult) else answer
    (Path(out) / "result.json").write_text(json.dumps(document), encoding="utf-8")


def merger_command(merger: Merger) -> str:
    """The command that calls a function of a module or a file.

    Raises:
        ValueError: it is no such function (a lambda, say, or one that is made inside another).
    """
    name, source = getattr(merger, "__qualname__", ""), inspect.getsourcefile(inspect.unwrap(merger))
    if source is None or not name.isidentifier():
        raise ValueError(f"the merger must be a function at the top level of a module, got {merger!r}")
    function = f"{Path(source).absolute()}:{name}"
    return f"{shlex.quote(sys.executable)} -m bench.mergers.merger_call {shlex.quote(function)} {{maps}} {{out}}"


def load_merger(function: str) -> Merger:
    """The function that ``module:name`` or ``path/to/file.py:name`` names.

    Raises:
        ValueError: there is none.
    """
    where, _, name = function.rpartition(":")
    try:
        module = _load_file(Path(where)) if where.endswith(".py") else importlib.import_module(where)
        merger: Merger = getattr(module, name)
    except (ImportError, AttributeError, OSError) as error:
        raise ValueError(f"no merger '{function}': {error}") from None
    return merger


def _load_file(path: Path) -> Any:
    sys.path.insert(0, str(path.parent))
    spec = importlib.util.spec_from_file_location(_MODULE, path)
    if spec is None or spec.loader is None:
        raise ImportError(f"{path} is no Python file")
    module = importlib.util.module_from_spec(spec)
    sys.modules[_MODULE] = module
    spec.loader.exec_module(module)
    return module


def _ordered(folder: Path) -> list[Path]:
    """The maps in the order that the bench asks for; by name without one."""
    order = folder.parent / "order.txt"
    names = order.read_text(encoding="utf-8").split() if order.is_file() else []
    return [folder / f"{name}.yaml" for name in names] or sorted(folder.glob("*.yaml"))


if __name__ == "__main__":
    main()
