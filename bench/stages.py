"""The stages of a cell: dataset, prediction, scores; each is cached on disk and refuses what another config made."""

import contextlib
import functools
import importlib
import math
import time
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import cv2

from bench import code_version
from bench.cell import Cell, DatasetSpec, MethodKind, MethodSpec, Outcome, hash_of
from bench.mergers.isolation import Limits, run_isolated
from bench.mergers.map_cache import write_map_cache
from bench.mergers.methods import ordered_maps, preload_of, python_methods, run_method
from bench.mergers.servers import Preload, find_server
from bench.scoring.result_document import PredictionError
from bench.scoring.result_reader import read_prediction
from bench.scoring.scores import score_failure, score_result
from bench.scoring.yardstick import Yardstick, make_yardstick
from bench.scoring.yardstick_file import encode_yardstick, read_yardstick
from bench.store import Store, write_bytes
from sim.config import num_submaps, to_plain_dict
from sim.datasets.dataset import make_dataset, read_dataset
from sim.maps.truth import read_truth

NO_DATASET = "dataset: "
"""How the reason of a row begins whose dataset could not be made: its method was never called."""
_INDEX = "dataset.json"
_NO_PLACE = "OSError: "
"""How a full disk answers: no finding about a dataset, and nothing to remember."""
_SCORING_ERRORS = (ArithmeticError, ValueError, cv2.error, MemoryError)
_OWN_LIMITS = Limits(time_s=3600.0, memory_mb=16384.0)
"""Of the bench's own work: making a dataset, scoring."""


@dataclass(frozen=True)
class ScoredCell:
    """A finished cell."""

    cell: Cell
    """What was measured."""
    score: dict[str, Any]
    """Columns of `bench.scoring.score_rows.Score`."""
    maps: list[dict[str, Any]]
    """Columns of `bench.scoring.score_rows.MapScore`, one per map."""
    pairs: list[dict[str, Any]]
    """Columns of `bench.scoring.score_rows.PairScore`, one per pair."""
    dataset: Path
    """Folder of the dataset."""
    result: Path
    """The ``result.json``, if there is one."""


@dataclass(frozen=True)
class CellKeys:
    """What the stages of a cell are kept under: hashes of all that makes them."""

    dataset: str
    """The dataset's configuration, the code that makes it, and the log that it is cut from."""
    yardstick: str
    """The dataset and the code that scores."""
    prediction: str
    """The dataset, the method, the seed, the order, and the version of what answers."""
    score: str
    """The answer and the code that scores."""


def keys_of(cell: Cell) -> CellKeys:
    """The keys of a cell."""
    config, log = cell.dataset.config, cell.dataset.config.source.path
    content = code_version.file_version(Path(log)) if log else None
    dataset = hash_of([to_plain_dict(config), code_version.dataset_version(), content])
    method = asdict(cell.method) | {"label": None}
    prediction = hash_of([dataset, method, _method_version(cell.method), cell.seed, cell.order])
    scoring = code_version.score_version()
    return CellKeys(dataset, hash_of([dataset, scoring]), prediction, hash_of([prediction, scoring]))


def finish_dataset(store: Store, spec: DatasetSpec, keys: CellKeys, retry_failed: bool) -> Outcome:
    """Make a dataset unless it is there; a failure is remembered, too.

    Raises:
        OSError: it cannot be written.
    """
    key = keys.dataset
    if (store.dataset(key) / _INDEX).is_file():
        return Outcome("ok")
    known = store.read("failed_datasets", key)
    if known and not retry_failed:
        return Outcome("failed", known["reason"])
    outcome = run_isolated(_make, (spec, store, keys), _OWN_LIMITS, Preload.DATASETS)
    if outcome.reason and outcome.reason.startswith(_NO_PLACE):
        raise OSError(outcome.reason)
    if outcome.status != "ok":
        outcome = replace(outcome, status="failed", reason=f"{NO_DATASET}{outcome.reason}")
        store.write("failed_datasets", key, {"reason": outcome.reason})
    return outcome


def finish_prediction(store: Store, cell: Cell, keys: CellKeys, retry_failed: bool) -> Outcome:
    """Run the method unless its answer is there."""
    known = store.read("outcomes", keys.prediction)
    if known and not (retry_failed and known["status"] != "ok"):
        return Outcome(**known)
    find_server(preload_of(cell.method)).wait_until_ready()
    importlib.import_module("bench.scoring.warm_kernels")  # once a sweep, as the server: no row is charged for it
    start = time.perf_counter()
    with store.fill(store.prediction(keys.prediction)) as folder:
        maps = ordered_maps(store.dataset(keys.dataset), cell.order)
        outcome = run_method(cell.method, maps, cell.seed, folder, store.map_cache(keys.dataset))
    outcome = replace(outcome, overhead_s=time.perf_counter() - start - outcome.wall_s)
    store.write("outcomes", keys.prediction, vars(outcome))
    return outcome


def finish_score(store: Store, cell: Cell, keys: CellKeys, outcome: Outcome, *, waited_for: bool = True) -> ScoredCell:
    """Score the answer of a cell unless that is done; ``waited_for``: whether the next cell waits for it."""
    dataset, answer = store.dataset(keys.dataset), store.prediction(keys.prediction) / "result.json"
    yardstick = store.yardstick(keys.yardstick)
    document = store.read("scores", keys.score)
    if document is None or document["outcome"] != _comparable(outcome):
        try:
            start = time.perf_counter()
            document = _score(dataset, yardstick, answer, outcome)
            if waited_for:
                document["score"]["runtime_overhead_s"] += time.perf_counter() - start
        except _SCORING_ERRORS as error:
            reason = f"scoring: {type(error).__name__}: {' '.join(str(error).split())}"
            return failed_cell(store, cell, keys, replace(outcome, status="failed", reason=reason))
        store.write("scores", keys.score, document)
    return ScoredCell(cell, document["score"], document["maps"], document["pairs"], dataset, answer)


def failed_cell(store: Store, cell: Cell, keys: CellKeys, outcome: Outcome) -> ScoredCell:
    """A cell whose dataset could not be made, or whose answer could not be scored."""
    dataset = store.dataset(keys.dataset)
    num_maps = num_submaps(cell.dataset.config)
    blank = replace(outcome, wall_s=math.nan, peak_memory_mb=math.nan)
    return ScoredCell(cell, vars(score_failure(num_maps, blank)), [], [], dataset, dataset / "result.json")


def _make(spec: DatasetSpec, store: Store, keys: CellKeys) -> None:
    """Make a dataset, and once what every cell that meets it would work out again."""
    out = store.dataset(keys.dataset)
    out.parent.mkdir(parents=True, exist_ok=True)
    dataset = read_dataset(make_dataset(spec.config, out))
    with store.fill(store.map_cache(keys.dataset)) as folder:
        write_map_cache(dataset.maps, folder)
    with contextlib.suppress(*_SCORING_ERRORS):  # whoever scores will meet them, and say so
        write_bytes(store.yardstick(keys.yardstick), encode_yardstick(make_yardstick(dataset)))


def _score(dataset_folder: Path, yardstick_file: Path, answer: Path, outcome: Outcome) -> dict[str, Any]:
    yardstick = find_yardstick(dataset_folder, yardstick_file)
    names = yardstick.truth.names
    document: dict[str, Any] = {"outcome": _comparable(outcome), "maps": [], "pairs": []}
    try:
        if outcome.status == "ok":
            score, maps, pairs = score_result(yardstick, read_prediction(answer, names), outcome)
            document |= {"maps": [vars(m) for m in maps], "pairs": [vars(p) for p in pairs]}
        else:
            score = score_failure(len(names), outcome)
    except PredictionError as error:
        score = score_failure(len(names), replace(outcome, status="failed", reason=str(error)))
    return document | {"score": vars(replace(score, runtime_overhead_s=outcome.overhead_s))}


@functools.lru_cache(maxsize=4)
def find_yardstick(dataset_folder: Path, file: Path) -> Yardstick:
    """The yardstick of a dataset: from its file, else worked out and written there; kept while methods answer."""
    known = read_yardstick(file, read_truth(dataset_folder / "truth.json"))
    if known is None:
        known = make_yardstick(read_dataset(dataset_folder))
        write_bytes(file, encode_yardstick(known))
    return known


def _comparable(outcome: Outcome) -> dict[str, Any]:
    """An outcome as it is compared after a trip through JSON, where NaN would differ from itself."""
    return {name: str(value) for name, value in vars(outcome).items()}


def _method_version(method: MethodSpec) -> str:
    if method.kind is MethodKind.EXTERNAL:
        return code_version.command_version(method.target)
    if method.kind is MethodKind.PYTHON:
        point = python_methods().get(method.target)
        return point.dist.version if point and point.dist else "unknown"
    return code_version.merger_version()
