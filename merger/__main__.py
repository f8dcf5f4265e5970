"""``python -m merger MAPS... --out DIR``: merge maps from the command line."""

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn

import cv2

from merger.files.inputs import read_maps
from merger.files.result_files import write_result
from merger.pipeline import METHODS, MergeConfig, Method, merge_maps
from merger.result import MergeResult

_MERGED, _NOTHING_MERGED, _BAD_INPUT, _INTERRUPTED = 0, 1, 2, 130


class _Parser(argparse.ArgumentParser):
    """Tells a wrong usage in one line, like every other error."""

    def error(self, message: str) -> NoReturn:
        """Print the fault without the usage, and exit with status 2."""
        print(f"{self.prog}: {message} (--help tells the usage)", file=sys.stderr)
        raise SystemExit(_BAD_INPUT)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command.

    Returns:
        The exit status: 0, two or more maps were merged; 1, nothing could be merged; 2, bad input or usage;
        130, interrupted.
    """
    parser = _make_parser()
    options = parser.parse_args(argv)
    cv2.setNumThreads(1)  # --workers threads or processes do the work.
    try:
        if not options.out:
            raise ValueError("--out must name a folder, got ''")
        _refuse_bad_folder(Path(options.out))
        maps = read_maps(options.maps)
        config = MergeConfig(
            method=Method(options.method),
            seed=options.seed,
            workers=options.workers,
            reference=options.reference,
            resolution_m=options.resolution,
            estimate_scale=options.estimate_scale,
        )
        result = merge_maps(maps, config, progress=None if options.quiet else _show_progress)
        write_result(options.out, result, maps)
    except (ValueError, OSError, MemoryError) as error:
        _clear_progress()
        fault = f"not enough memory ({str(error) or 'none left'})" if isinstance(error, MemoryError) else error
        print(f"{parser.prog}: {' '.join(str(fault).split())}", file=sys.stderr)
        return _BAD_INPUT
    except KeyboardInterrupt:
        return _INTERRUPTED
    _clear_progress()
    _report(result, options)
    return _MERGED if result.num_placed >= 2 else _NOTHING_MERGED


def _make_parser() -> _Parser:
    parser = _Parser(
        prog="python -m merger",
        description="Merge occupancy grid maps into one, without knowing where they lie.",
        epilog="Exit status: 0, two or more maps were merged; 1, nothing could be merged; 2, bad input or usage.",
        allow_abbrev=False,
    )
    parser.add_argument(
        "maps",
        nargs="+",
        metavar="MAPS",
        help="map_server YAML files, folders that hold them, dataset folders, or MCAP files with OccupancyGrids",
    )
    parser.add_argument("--out", required=True, metavar="DIR", help="folder for the result")
    methods = [method.value for method in METHODS]
    parser.add_argument("--method", choices=methods, default=MergeConfig().method.value, help="default: %(default)s")
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="seed of all random choices (default: 0)")
    workers = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    at_work = "threads, or processes where robust searches (default: all cores)"
    parser.add_argument("--workers", type=int, default=workers, metavar="N", help=at_work)
    parser.add_argument("--reference", metavar="NAME", help="map whose frame is the result's (default: the first)")
    parser.add_argument("--resolution", type=float, metavar="M", help="cell side of the merged map, metres")
    parser.add_argument(
        "--estimate-scale",
        action="store_true",
        help="estimate stated resolutions that are off by up to 5 %% (method robust only; slow)",
    )
    parser.add_argument("--quiet", action="store_true", help="no progress and no summary")
    return parser


def _refuse_bad_folder(folder: Path) -> None:
    """Find out before the work, not after it, that the result cannot be written."""
    existing = next(path for path in (folder, *folder.absolute().parents) if path.exists())
    if not existing.is_dir():
        raise ValueError(f"{existing}: is not a folder")
    if not os.access(existing, os.W_OK):
        raise ValueError(f"{existing}: the folder cannot be written to")


def _show_progress(stage: str, done: int, total: int) -> None:
    if sys.stderr.isatty():
        print(f"\r\033[K{stage}: {done} of {total}", end="", file=sys.stderr, flush=True)


def _clear_progress() -> None:
    if sys.stderr.isatty():
        print("\r\033[K", end="", file=sys.stderr, flush=True)


def _report(result: MergeResult, options: argparse.Namespace) -> None:
    """The maps left out on stderr, the rest on stdout."""
    for placement in result.maps:
        if not placement.placed:
            print(f"left out: {placement.name}: {placement.reason}", file=sys.stderr)
    if not options.quiet:
        groups = [len(names) for names in result.components if len(names) > 1]
        parts = f" in {len(groups)} components" if len(groups) > 1 else ""
        print(
            f"{result.num_placed} of {len(result.maps)} maps merged{parts} by {result.method.value} "
            f"in {result.runtime_s.total:.2f} s: {os.fsencode(options.out).decode(errors='backslashreplace')}"
        )


if __name__ == "__main__":
    sys.exit(main())
