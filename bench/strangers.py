"""``python -m bench.strangers DIR``: maps of two or three unrelated buildings in one call.

``DIR`` holds datasets anywhere below: the results of an experiment, or what ``python -m sim`` wrote. Mixtures of them
are drawn and merged; a component that has maps of two buildings is a false link. ``strangers.csv`` in ``DIR`` has a row
a mixture. Exit status 0: no false link; 1: at least one; 2: bad input, one line.
"""

import argparse
import json
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from tqdm import tqdm

from bench.mergers.methods import merge_config
from bench.scoring.statistics import wilson_share
from bench.store import write_text
from merger.pipeline import merge_maps
from merger.result import MergeResult, PairStatus
from sim.datasets.dataset import read_dataset

_GENERATED = "office"


@dataclass(frozen=True)
class Mixture:
    """What became of the maps of one mixture."""

    buildings: str
    """Their datasets."""
    num_buildings: int
    """Two or three."""
    num_maps: int
    """Maps of all."""
    num_placed: int
    """Maps that were joined to another."""
    num_false_links: int
    """Components with maps of more than one building."""
    num_false_pairs: int
    """Reliable motions between maps of different buildings."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit status."""
    options = _parse(arguments)
    try:
        mixtures = merge_strangers(options)
    except (ValueError, OSError) as error:
        sys.stderr.write(f"bench.strangers: {' '.join(str(error).split())}\n")
        return 2
    write_text(options.folder / "strangers.csv", pd.DataFrame(map(asdict, mixtures)).to_csv(index=False))
    sys.stdout.write(describe(options.method, mixtures) + "\n")
    return int(any(m.num_false_links for m in mixtures))


def merge_strangers(options: argparse.Namespace) -> list[Mixture]:
    """Draw mixtures and merge each.

    Raises:
        ValueError: there are not two buildings, or the method or a number is not known.
    """
    if options.mixtures < 1 or options.seed < 0:
        raise ValueError(f"need mixtures >= 1 and seed >= 0, got {options.mixtures} and {options.seed}")
    drawn = draw_mixtures(find_buildings(options.folder), options.mixtures, np.random.default_rng(options.seed))
    bar = tqdm(drawn, unit="mixture", disable=options.quiet, dynamic_ncols=True)
    return [merge_mixture(folders, options.method, options.seed) for folders in bar]


def find_buildings(folder: Path) -> dict[str, list[Path]]:
    """The datasets below a folder by the building that they show.

    Raises:
        ValueError: there are fewer than two buildings.
    """
    buildings: dict[str, list[Path]] = {}
    for index in sorted(folder.rglob("dataset.json")):
        config = json.loads(index.read_text(encoding="utf-8"))["config"]
        buildings.setdefault(_building(config), []).append(index.parent)
    if len(buildings) < 2:
        raise ValueError(f"{folder}: strangers need datasets of two buildings, found {len(buildings)}")
    return buildings


def draw_mixtures(
    buildings: Mapping[str, Sequence[Path]], count: int, rng: np.random.Generator
) -> list[tuple[Path, ...]]:
    """Mixtures of two or three buildings, one dataset of each."""
    mixtures = []
    for _ in range(count):
        chosen = rng.choice(sorted(buildings), size=min(int(rng.integers(2, 4)), len(buildings)), replace=False)
        mixtures.append(tuple(buildings[b][int(rng.integers(len(buildings[b])))] for b in chosen))
    return mixtures


def merge_mixture(folders: Sequence[Path], method: str, seed: int) -> Mixture:
    """Merge the maps of several datasets in one call, and count what was joined over the borders."""
    maps = [
        replace(grid, name=f"{number}-{grid.name}")
        for number, folder in enumerate(folders)
        for grid in read_dataset(folder).maps
    ]
    result = merge_maps(maps, replace(merge_config(method, seed, 1, ()), composite=False))
    false_links, false_pairs = count_false(result)
    names = " + ".join(folder.name for folder in folders)
    return Mixture(names, len(folders), len(maps), result.num_placed, false_links, false_pairs)


def count_false(result: MergeResult) -> tuple[int, int]:
    """Components, and reliable pairs, with maps of more than one building; names are ``BUILDING-MAP``."""
    links = sum(len({_of(name) for name in component}) > 1 for component in result.components)
    pairs = sum(
        p.status is PairStatus.RELIABLE and _of(p.target) != _of(p.source) and p.T_target_source is not None
        for p in result.pairs
    )
    return links, pairs


def describe(method: str, mixtures: Sequence[Mixture]) -> str:
    """The outcome in one sentence."""
    linked = wilson_share(sum(m.num_false_links > 0 for m in mixtures), len(mixtures))
    placed, maps = sum(m.num_placed for m in mixtures), sum(m.num_maps for m in mixtures)
    pairs = sum(m.num_false_pairs for m in mixtures)
    return (
        f"{method}: {linked.successes} of {linked.trials} mixtures with a false link "
        f"(at most {100 * linked.high:.1f} %), {pairs} false pairs; {placed} of {maps} maps placed"
    )


def _of(name: str) -> str:
    return name.partition("-")[0]


def _building(config: Mapping[str, Any]) -> str:
    """A log, a named world, or a generated one with its seed."""
    if config["source"]["path"]:
        return str(config["source"]["path"])
    return f"{config['world']} {config['seed']}" if config["world"] == _GENERATED else str(config["world"])


def _parse(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m bench.strangers", description=__doc__.partition("\n\n")[2])
    parser.add_argument("folder", type=Path, metavar="DIR", help="folder with datasets of two buildings or more")
    parser.add_argument("--method", default="robust", help="paper, robust (default) or sequential")
    parser.add_argument("--mixtures", type=int, default=20, metavar="N", help="how many mixtures (default 20)")
    parser.add_argument("--seed", type=int, default=0, help="seed of the draw and of the method (default 0)")
    parser.add_argument("--quiet", action="store_true", help="show no progress")
    return parser.parse_args(arguments)


if __name__ == "__main__":
    sys.exit(main())
