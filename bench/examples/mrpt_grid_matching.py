"""MRPT's ``grid-matching`` as an external method: ``mrpt_grid_matching.py [--pairwise] MAPS SCANS OUT``.

The original program of the paper's rival (Blanco, Gonzalez-Jimenez and Fernandez-Madrigal, A robust, multi-hypothesis
approach to matching occupancy grid maps, Robotica 2013), by its author; Debian package ``mrpt-apps``. A program of one
file that needs nothing but Python, made to be copied. It ends with status 77, which the bench reports as *skipped*,
where MRPT is missing.

MRPT reads no maps but scans, which the bench gives for ``{scans}``: a CARMEN log for each map, in the map's frame. Maps
are merged one after the other, in the order of ``order.txt`` beside the folder of maps: the scans that are already
merged are one map, the next map is matched to it, and one that cannot be matched is left out. With ``--pairwise`` every
pair is matched instead, and the maps are chained along the pairs whose maps agree best. The settings are those of the
example that comes with MRPT; the program's own defaults ask for more inliers, and leave most maps out.

Trap: without the line ``PARAM laser_front_laser_resolution``, MRPT draws 180 beams as a fan of 90 degrees.
"""

import cmath
import itertools
import json
import math
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

SKIPPED = 77
"""Exit status for "cannot run here"."""
PROGRAMS = ("carmen2simplemap", "grid-matching")
"""What must be installed."""
EXAMPLE = "share/mrpt/config_files/grid-matching/gridmatch_example.ini"
"""The author's settings, below the prefix of the installation."""


@dataclass(frozen=True)
class Motion:
    """A rigid motion: ``z -> turn * z + shift`` of points as complex numbers, metres."""

    shift: complex = 0j
    turn: complex = 1 + 0j

    def __matmul__(self, other: "Motion") -> "Motion":
        """The motion that does ``other`` first."""
        return Motion(self.turn * other.shift + self.shift, self.turn * other.turn)

    def inverse(self) -> "Motion":
        """The motion back."""
        return Motion(-self.shift / self.turn, 1 / self.turn)

    def document(self) -> dict[str, float]:
        """As ``result.json`` has it."""
        return {"x": self.shift.real, "y": self.shift.imag, "theta": cmath.phase(self.turn)}


def main() -> int:
    """Merge the maps of one folder."""
    missing = [program for program in PROGRAMS if shutil.which(program) is None]
    if missing:
        sys.stderr.write(f"MRPT's {' and '.join(missing)} not installed: apt-get install mrpt-apps\n")
        return SKIPPED
    pairwise = "--pairwise" in sys.argv
    maps, scans, out = map(Path, [a for a in sys.argv[1:] if a != "--pairwise"])
    names = (maps.parent / "order.txt").read_text().split()
    logs = {name: (scans / f"{name}.log").read_text().splitlines() for name in names}
    with tempfile.TemporaryDirectory() as work:
        write_settings(Path(work))
        components, pairs = (merge_by_pairs if pairwise else merge_in_order)(logs, Path(work))
    write_result(out, components, pairs)
    return 0


def write_settings(work: Path) -> None:
    """Put MRPT's example settings into the working folder, without the pictures that they ask for."""
    example = Path(shutil.which(PROGRAMS[1]) or "").resolve().parents[1] / EXAMPLE
    lines = example.read_text(errors="replace").splitlines() if example.is_file() else []
    kept = [line for line in lines if not line.startswith("debug_save_map_pairs")]
    if kept:
        (work / "settings.ini").write_text("\n".join(kept) + "\n")


Component = dict[str, Motion]
"""Maps that hang together, and their motions into the frame of one of them."""
Pair = tuple[str, str, float, Motion]
"""Target, source, how well they agree, motion of source into target."""


def merge_in_order(logs: dict[str, list[str]], work: Path) -> tuple[list[Component], list[Pair]]:
    """Match each map to all that is merged so far."""
    names = list(logs)
    merged, left_out = {names[0]: Motion()}, []
    everything = list(logs[names[0]])
    for name in names[1:]:
        found = match(convert(everything, work / "merged"), convert(logs[name], work / name), work)
        if found is None:
            left_out.append({name: Motion()})
            continue
        merged[name] = found[1]
        everything += [moved for line in logs[name] if (moved := move_line(line, found[1]))]
    return [merged, *left_out], []


def merge_by_pairs(logs: dict[str, list[str]], work: Path) -> tuple[list[Component], list[Pair]]:
    """Match every pair; chain along those that agree best (a spanning tree, after Kruskal)."""
    simplemaps = {name: convert(lines, work / name) for name, lines in logs.items()}
    found = [(i, j, match(simplemaps[i], simplemaps[j], work)) for i, j in itertools.combinations(sorted(logs), 2)]
    pairs = [(i, j, *answer) for i, j, answer in found if answer]
    components: list[Component] = [{name: Motion()} for name in logs]
    for i, j, _, T_i_j in sorted(pairs, key=lambda pair: -pair[2]):
        keep = next(c for c in components if i in c)
        join = next(c for c in components if j in c)
        if keep is not join:
            T = keep[i] @ T_i_j @ join[j].inverse()
            keep.update({name: T @ motion for name, motion in join.items()})
            components = [c for c in components if c is not join]
    return components, pairs


def convert(lines: list[str], stem: Path) -> Path:
    """Scans as MRPT's ``.simplemap``."""
    log, simplemap = stem.with_suffix(".log"), stem.with_suffix(".simplemap")
    log.write_text("\n".join(lines) + "\n")
    subprocess.run(
        ["carmen2simplemap", "-q", "-w", "-i", str(log), "-o", str(simplemap)], check=True, capture_output=True
    )
    return simplemap


def match(target: Path, source: Path, work: Path) -> tuple[float, Motion] | None:
    """The best goodness of ICP and the heaviest hypothesis for the motion of source into target, if there is one."""
    modes, goodness = work / "modes.txt", work / "goodness.txt"
    modes.unlink(missing_ok=True)
    goodness.unlink(missing_ok=True)
    command = ["grid-matching", "-1", str(target), "-2", str(source), "-m", "-g", "-n", "-o", str(modes)]
    if (work / "settings.ini").is_file():
        command += ["-c", str(work / "settings.ini")]
    subprocess.run([*command, "-i", str(goodness)], check=True, capture_output=True, cwd=work)
    rows = [[float(word) for word in line.split()] for line in modes.read_text().splitlines() if line[:1] != "%"]
    if not rows:
        return None
    _, x, y, phi = max(rows)
    agreement = max(map(float, goodness.read_text().split()), default=0.0) if goodness.exists() else 0.0
    return agreement, Motion(complex(x, y), cmath.rect(1.0, phi))


def move_line(line: str, T: Motion) -> str:
    """A line of a log with all its poses moved; nothing for a line of the head."""
    words = line.split()
    first = {"ODOM": 1, "FLASER": 2 + int(words[1]) if words[0] == "FLASER" else 0}.get(words[0])
    if first is None:
        return ""
    for at in range(first, first + 6 if words[0] == "FLASER" else first + 3, 3):
        x, y, theta = map(float, words[at : at + 3])
        moved = (T @ Motion(complex(x, y), cmath.rect(1.0, theta))).document()
        words[at : at + 3] = [f"{value:.9f}" for value in moved.values()]
    return " ".join(words)


def write_result(out: Path, components: list[Component], pairs: list[Pair]) -> None:
    """Write ``result.json``; a map that is alone is not placed."""
    maps = {
        name: {
            "placed": len(component) > 1,
            "component": number,
            "T_ref_map": motion.document() if len(component) > 1 else None,
            "reason": None if len(component) > 1 else "grid-matching found no motion",
        }
        for number, component in enumerate(components)
        for name, motion in component.items()
    }
    found = [
        {"target": i, "source": j, "status": "reliable", "T_target_source": T.document(), "agreement": min(1.0, a)}
        for i, j, a, T in pairs
        if math.isfinite(a)
    ]
    (out / "result.json").write_text(json.dumps({"schema": 1, "maps": maps, "pairs": found}, indent=1))


if __name__ == "__main__":
    sys.exit(main())
