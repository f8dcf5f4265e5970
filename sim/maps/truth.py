"""Where each submap truly lies, and which submaps see the same walls: ``truth.json``."""

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from merger import se2
from merger.grid_map import GridMap
from sim.maps.submap_mapping import SubmapResult
from sim.maps.submaps import SubmapCut
from sim.robot_run import Trajectory

_NEAR_CELLS = 2.0
"""Two occupied cells this close are the same wall."""
_STANDSTILL_M = 0.02
"""A robot that strays less than this from its mean position gives its heading only by its poses' angles."""


class TruthError(ValueError):
    """A truth.json cannot be used; the message is one line that names the file and the fault."""


@dataclass(frozen=True)
class Truth:
    """The true places of N submaps, in the order of ``names``."""

    names: tuple[str, ...]
    """Names of the submaps, as their YAML stems."""
    T_world_map: npt.NDArray[np.float64]
    """(N, 3, 3) least-squares alignment of each submap's estimated robot poses to the true ones."""
    distortion_rms_m: npt.NDArray[np.float64]
    """(N,) root mean square position residual of that alignment, metres."""
    robot: tuple[str, ...]
    """(N,) the robot that made each submap."""
    start_s: npt.NDArray[np.float64]
    """(N,) stamp of each submap's first scan."""
    end_s: npt.NDArray[np.float64]
    """(N,) stamp of each submap's last scan."""
    overlap: npt.NDArray[np.float64]
    """(N, N) share of i's occupied cells within two cells of one of j's, by `overlap_fractions`."""


def find_truth(trajectories: Sequence[Trajectory], cuts: Sequence[SubmapCut], submaps: Sequence[SubmapResult]) -> Truth:
    """Align each submap's estimated poses to the true ones, and measure the overlaps.

    Args:
        trajectories: Of each robot.
        cuts: N submaps: their robots and scans.
        submaps: The N submaps.
    """
    parts = [(trajectories[cut.robot], cut.start, cut.stop) for cut in cuts]
    fits = [
        align_poses(trajectory.T_world_robot[start:stop], submap.T_map_robot)
        for (trajectory, start, stop), submap in zip(parts, submaps, strict=True)
    ]
    T_world_map = np.stack([T for T, _ in fits])
    return Truth(
        names=tuple(cut.name for cut in cuts),
        T_world_map=T_world_map,
        distortion_rms_m=np.array([rms for _, rms in fits]),
        robot=tuple(trajectory.robot for trajectory, _, _ in parts),
        start_s=np.array([trajectory.stamps_s[start] for trajectory, start, _ in parts]),
        end_s=np.array([trajectory.stamps_s[stop - 1] for trajectory, _, stop in parts]),
        overlap=overlap_fractions([submap.grid for submap in submaps], T_world_map),
    )


def align_poses(
    T_world_robot: npt.NDArray[np.float64], T_map_robot: npt.NDArray[np.float64]
) -> tuple[npt.NDArray[np.float64], float]:
    """Least-squares rigid motion from a submap's frame to the world.

    Minimises ``sum |T_world_map p_map - p_world|^2`` over the positions of the poses (Umeyama 1991, without scale).
    Where the robot all but stands still, positions say nothing of the angle: the mean difference of headings does.

    Args:
        T_world_robot: (K, 3, 3) true poses, K >= 1.
        T_map_robot: (K, 3, 3) estimated poses in frame ``map``.

    Returns:
        The (3, 3) motion ``T_world_map``, and the root mean square residual of the positions in metres.
    """
    world, estimated = T_world_robot[:, :2, 2], T_map_robot[:, :2, 2]
    centre_world, centre_map = world.mean(axis=0), estimated.mean(axis=0)
    a, b = estimated - centre_map, world - centre_world
    if math.sqrt(float(np.mean(np.sum(a * a, axis=1)))) < _STANDSTILL_M:
        turns = se2.angle_of(T_world_robot) - se2.angle_of(T_map_robot)
        theta = math.atan2(float(np.sin(turns).sum()), float(np.cos(turns).sum()))
    else:
        theta = math.atan2(float(np.sum(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])), float(np.sum(a * b)))
    T = se2.make_motion(0.0, 0.0, theta)
    T[:2, 2] = centre_world - T[:2, :2] @ centre_map
    residual = se2.transform_points(T, estimated) - world
    return T, math.sqrt(float(np.mean(np.sum(residual * residual, axis=1))))


def overlap_fractions(maps: Sequence[GridMap], T_world_map: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Share of each map's occupied cells that another map has, too, under the true motions.

    Returns:
        (N, N) fractions in [0, 1]: ``[i, j]`` is the share of i's occupied cells whose centres lie within two cells
        (of j's resolution) of the centre of one of j's. 1 on the diagonal; 0 where either has no occupied cell.
    """
    points = [se2.transform_points(T, m.cell_centers(m.occupied)) for m, T in zip(maps, T_world_map, strict=True)]
    fraction = np.zeros((len(maps), len(maps)))
    for j, target in enumerate(points):
        tree = cKDTree(target)
        radius = _NEAR_CELLS * maps[j].resolution_m * (1.0 + 1e-9)
        for i, source in enumerate(points):
            if len(target) and len(source):
                distance = tree.query(source, distance_upper_bound=radius)[0]
                fraction[i, j] = 1.0 if i == j else float(np.mean(distance <= radius))
    return fraction


def to_json_dict(truth: Truth) -> dict[str, Any]:
    """The document of ``truth.json``."""
    maps = {
        name: {
            "T_world_map": _motion_dict(truth.T_world_map[i]),
            "distortion_rms_m": float(truth.distortion_rms_m[i]),
            "robot": truth.robot[i],
            "start_s": float(truth.start_s[i]),
            "end_s": float(truth.end_s[i]),
        }
        for i, name in enumerate(truth.names)
    }
    overlap = {"names": list(truth.names), "fraction": np.round(truth.overlap, 6).tolist()}
    return {"schema": 1, "maps": maps, "overlap": overlap}


def from_json_dict(document: dict[str, Any]) -> Truth:
    """The inverse of `to_json_dict`.

    Raises:
        TruthError: a field is missing or not what the schema says.
    """
    try:
        names = tuple(document["overlap"]["names"])
        maps = [document["maps"][name] for name in names]
        motions = [[float(entry["T_world_map"][key]) for key in ("x", "y", "theta")] for entry in maps]
        truth = Truth(
            names,
            se2.make_motion(*np.array(motions).reshape(-1, 3).T),
            np.array([float(entry["distortion_rms_m"]) for entry in maps]),
            tuple(str(entry["robot"]) for entry in maps),
            np.array([float(entry["start_s"]) for entry in maps]),
            np.array([float(entry["end_s"]) for entry in maps]),
            np.array(document["overlap"]["fraction"], dtype=np.float64).reshape(len(names), len(names)),
        )
    except (KeyError, TypeError, ValueError, IndexError) as error:
        raise TruthError(f"not a truth document: {type(error).__name__} {error}") from None
    if document.get("schema") != 1 or set(document["maps"]) != set(names):
        raise TruthError("schema must be 1, and overlap.names must list every map")
    return truth


def write_truth(path: Path, truth: Truth) -> None:
    """Write ``truth.json``."""
    path.write_text(json.dumps(to_json_dict(truth), indent=1, allow_nan=False) + "\n", encoding="utf-8")


def read_truth(path: Path) -> Truth:
    """Read ``truth.json``.

    Raises:
        TruthError: the file is missing, not JSON, or not of the schema.
    """
    try:
        return from_json_dict(json.loads(path.read_text(encoding="utf-8")))
    except (OSError, UnicodeDecodeError, json.JSONDecodeError) as error:
        raise TruthError(f"{path}: cannot be read ({type(error).__name__})") from None
    except TruthError as error:
        raise TruthError(f"{path}: {error}") from None


def _motion_dict(T: npt.NDArray[np.float64]) -> dict[str, float]:
    x, y, theta = (float(value) for value in se2.parameters_of(T))
    return {"x": x, "y": y, "theta": theta}
