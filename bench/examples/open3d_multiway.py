"""Open3D's multiway registration as an external method: ``open3d_multiway.py MAPS OUT``.

A program of one file that needs Open3D, numpy and PyYAML and nothing of this project, so that it can be copied and run
by any Python: ``method=external method.command="python open3d_multiway.py {maps} {out}"``. It ends with status 77,
which the bench reports as *skipped*, where Open3D is missing.

Occupied cells become points in the plane z = 0. Open3D's own normals of a flat cloud all point up and its features
then see nothing, so normals are made in the plane, from walls towards free space. Pairs are matched by FPFH features
and RANSAC and refined by point-to-plane ICP; the pose graph is optimised with every edge in doubt (Choi, Zhou and
Koltun, Robust Reconstruction of Indoor Scenes, CVPR 2015).
"""

import itertools
import json
import math
import os
import re
import sys
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import yaml

os.environ.setdefault("OMP_NUM_THREADS", "1")  # threads of RANSAC share its random stream: no two runs would agree
try:
    import open3d as o3d
except ImportError:
    o3d = None

Array = npt.NDArray[np.float64]

SKIPPED = 77
"""Exit status for "cannot run here"."""
VOXEL_M = 0.1
"""Distance between points."""
FEATURE_RADIUS_M = 2.0
"""Neighbourhood of a feature: a door and a corner fit in."""
MATCH_M = 0.3
"""Largest distance of a match that agrees with a motion."""
REFINED_M = 0.1
"""The same for the last ICP."""
MIN_FITNESS = 0.3
"""Share of the smaller map's points that must agree."""


def main() -> int:
    """Merge the maps of one folder."""
    if o3d is None:
        sys.stderr.write("Open3D is not installed: pip install open3d\n")
        return SKIPPED
    o3d.utility.random.seed(0)
    o3d.utility.set_verbosity_level(o3d.utility.VerbosityLevel.Error)
    clouds = {path.stem: read_cloud(path) for path in sorted(Path(sys.argv[1]).glob("*.yaml"))}
    names = list(clouds)
    edges = match_pairs([prepare(cloud) for cloud in clouds.values()])
    component, T_ref_map = optimise(len(names), edges)
    write_result(Path(sys.argv[2]), names, component, T_ref_map)
    return 0


def read_cloud(path: Path) -> tuple[Array, Array]:
    """Occupied cells of a map and their normals towards free space: two (N, 2) arrays, metres in the map's frame."""
    header = yaml.safe_load(path.read_text())
    image = read_pgm(path.parent / header["image"])[::-1]
    dy, dx = np.asarray(np.gradient(blur((image == 254).astype(np.float64))))
    at = (image == 0) & (np.hypot(dx, dy) > 1e-3)
    points = (np.argwhere(at)[:, ::-1] + 0.5) * header["resolution"]
    normals = np.stack([dx[at], dy[at]], axis=1) / np.hypot(dx[at], dy[at])[:, None]
    x, y, yaw = header["origin"]
    R = np.array([[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]])
    return points @ R.T + (x, y), normals @ R.T


def read_pgm(path: Path) -> npt.NDArray[np.uint8]:
    """A binary PGM of 8 bits as a (rows, columns) array."""
    data = path.read_bytes()
    header = re.match(rb"P5\s+(?:#.*\s+)*(\d+)\s+(\d+)\s+255\s", data)
    if header is None:
        raise ValueError(f"{path}: not a binary PGM of 8 bits")
    return np.frombuffer(data[header.end() :], np.uint8).reshape(int(header[2]), int(header[1]))


def blur(image: Array, radius: int = 3) -> Array:
    """The mean over a square of ``2 radius + 1`` cells."""
    kernel = np.full(2 * radius + 1, 1.0 / (2 * radius + 1))
    for axis in (0, 1):
        image = np.apply_along_axis(np.convolve, axis, image, kernel, mode="same")
    return image


def prepare(cloud: tuple[Array, Array]) -> tuple[Any, Any]:
    """A thinned cloud in the plane z = 0 and its FPFH features."""
    flat = [np.column_stack([part, np.zeros(len(part))]) for part in cloud]
    points = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(flat[0]))
    points.normals = o3d.utility.Vector3dVector(flat[1])
    points = points.voxel_down_sample(VOXEL_M)
    near = o3d.geometry.KDTreeSearchParamRadius(FEATURE_RADIUS_M)
    return points, o3d.pipelines.registration.compute_fpfh_feature(points, near)


def match_pairs(maps: list[tuple[Any, Any]]) -> list[tuple[int, int, float, Array, Array]]:
    """Every pair that agrees: target, source, fitness, (4, 4) motion of source into target, (6, 6) information."""
    found = []
    for i, j in itertools.combinations(range(len(maps)), 2):
        T, fitness = register(maps[i], maps[j])
        if fitness >= MIN_FITNESS:
            reg = o3d.pipelines.registration
            information = reg.get_information_matrix_from_point_clouds(maps[j][0], maps[i][0], MATCH_M, T)
            found.append((i, j, fitness, T, information))
    return found


def register(target: tuple[Any, Any], source: tuple[Any, Any]) -> tuple[Array, float]:
    """The (4, 4) motion of source into target, and the share of the smaller cloud that agrees with it."""
    reg = o3d.pipelines.registration
    guess = reg.registration_ransac_based_on_feature_matching(
        source[0], target[0], source[1], target[1], True, MATCH_M,
        reg.TransformationEstimationPointToPoint(False), 3,
        [reg.CorrespondenceCheckerBasedOnEdgeLength(0.9), reg.CorrespondenceCheckerBasedOnDistance(MATCH_M)],
        reg.RANSACConvergenceCriteria(200_000, 0.999),
    )  # fmt: skip
    T = in_plane(guess.transformation)
    for distance in (MATCH_M, REFINED_M):
        T = in_plane(
            reg.registration_icp(
                source[0], target[0], distance, T, reg.TransformationEstimationPointToPlane()
            ).transformation
        )
    matches = len(reg.evaluate_registration(source[0], target[0], REFINED_M, T).correspondence_set)
    return T, matches / min(len(source[0].points), len(target[0].points))


def in_plane(T: Array) -> Array:
    """The motion of the plane z = 0 that is nearest to a (4, 4) motion."""
    theta = math.atan2(T[1, 0] - T[0, 1], T[0, 0] + T[1, 1])
    flat = np.eye(4)
    flat[:2, :2] = [[math.cos(theta), -math.sin(theta)], [math.sin(theta), math.cos(theta)]]
    flat[:2, 3] = T[:2, 3]
    return flat


def optimise(count: int, edges: list[tuple[int, int, float, Array, Array]]) -> tuple[list[int], list[Array]]:
    """Component and (4, 4) motion into its first map, for each map."""
    reg = o3d.pipelines.registration
    component, T_ref_map = chain(count, edges)
    graph = reg.PoseGraph()
    graph.nodes.extend([reg.PoseGraphNode(T) for T in T_ref_map])
    for i, j, _, T, information in edges:
        graph.edges.append(reg.PoseGraphEdge(j, i, T, information, uncertain=True))
    if edges:
        options = reg.GlobalOptimizationOption(MATCH_M, edge_prune_threshold=0.25, reference_node=0)
        method = reg.GlobalOptimizationLevenbergMarquardt()
        reg.global_optimization(graph, method, reg.GlobalOptimizationConvergenceCriteria(), options)
    kept = {(edge.target_node_id, edge.source_node_id) for edge in graph.edges}
    component, _ = chain(count, [edge for edge in edges if edge[:2] in kept])
    poses = [in_plane(node.pose) for node in graph.nodes]
    first = [component.index(number) for number in component]
    return component, [np.linalg.inv(poses[root]) @ pose for root, pose in zip(first, poses, strict=True)]


def chain(count: int, edges: list[tuple[int, int, float, Array, Array]]) -> tuple[list[int], list[Array]]:
    """Components, and motions chained along the edges of greatest fitness (a spanning tree, after Kruskal)."""
    component, T_ref_map = list(range(count)), [np.eye(4) for _ in range(count)]
    for i, j, _, T_i_j, _ in sorted(edges, key=lambda edge: -edge[2]):
        if component[i] == component[j]:
            continue
        keep, join, motion = (i, j, T_i_j) if component[i] < component[j] else (j, i, np.linalg.inv(T_i_j))
        T = T_ref_map[keep] @ motion @ np.linalg.inv(T_ref_map[join])
        joined = component[join]
        for k in [k for k in range(count) if component[k] == joined]:
            component[k], T_ref_map[k] = component[keep], T @ T_ref_map[k]
    return component, T_ref_map


def write_result(out: Path, names: list[str], component: list[int], T_ref_map: list[Array]) -> None:
    """Write ``result.json``; a map that is alone is not placed."""
    maps = {}
    for name, number, T in zip(names, component, T_ref_map, strict=True):
        placed = component.count(number) > 1
        motion = {"x": float(T[0, 3]), "y": float(T[1, 3]), "theta": math.atan2(T[1, 0], T[0, 0])}
        reason = None if placed else "no pair agrees"
        maps[name] = {"placed": placed, "component": number, "T_ref_map": motion if placed else None, "reason": reason}
    (out / "result.json").write_text(json.dumps({"schema": 1, "maps": maps}, indent=1))


if __name__ == "__main__":
    sys.exit(main())
