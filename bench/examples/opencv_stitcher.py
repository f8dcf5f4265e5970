"""OpenCV's ``Stitcher`` in SCANS mode as an external method: ``opencv_stitcher.py MAPS OUT``.

A program of one file that needs OpenCV, numpy and PyYAML and nothing of this project, so that it can be copied and run
by any Python: ``method=external method.command="python opencv_stitcher.py {maps} {out}"``. It ends with status 77,
which the bench reports as *skipped*, where OpenCV has no ``Stitcher``.

Maps are taken for photographs: ORB keypoints, affine matches, bundle adjustment, and of the images that hang together
only the largest group. Images have one scale; a map's stated resolution turns pixels into metres.
"""

import json
import math
import sys
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
import yaml

Array = npt.NDArray[np.float64]

SKIPPED = 77
"""Exit status for "cannot run here"."""
CONFIDENCE = 1.0
"""How sure two images must be to belong together; OpenCV's default for photographs."""


def main() -> int:
    """Merge the maps of one folder."""
    if not hasattr(cv2, "Stitcher_create") or not hasattr(cv2.Stitcher, "cameras"):
        sys.stderr.write(f"OpenCV {cv2.__version__} comes without Stitcher or its cameras\n")
        return SKIPPED
    cv2.setRNGSeed(0)
    paths = sorted(Path(sys.argv[1]).glob("*.yaml"))
    maps = [read_image(path) for path in paths]
    placed = stitch([image for image, _ in maps])
    motions = {k: motion_between(maps[k], maps[min(placed)], placed[min(placed)], T) for k, T in placed.items()}
    write_result(Path(sys.argv[2]), [path.stem for path in paths], motions)
    return 0


def read_image(path: Path) -> tuple[npt.NDArray[np.uint8], Array]:
    """A map's image and the (3, 3) affine map of its pixels (column, row) to metres in the map's frame."""
    header = yaml.safe_load(path.read_text())
    image = np.asarray(cv2.imread(str(path.parent / header["image"]), cv2.IMREAD_COLOR), dtype=np.uint8)
    cell, (x, y, yaw) = float(header["resolution"]), header["origin"]
    c, s = math.cos(yaw), math.sin(yaw)
    T_map_grid = np.array([[c, -s, x], [s, c, y], [0.0, 0.0, 1.0]])
    T_grid_pixel = np.array([[cell, 0.0, cell / 2], [0.0, -cell, (image.shape[0] - 0.5) * cell], [0.0, 0.0, 1.0]])
    return image, T_map_grid @ T_grid_pixel


def stitch(images: list[npt.NDArray[np.uint8]]) -> dict[int, Array]:
    """The images that hang together, each with its (3, 3) affine map of pixels into the common picture."""
    stitcher = cv2.Stitcher.create(cv2.Stitcher_SCANS)
    stitcher.setRegistrationResol(-1)  # not scaled down
    stitcher.setPanoConfidenceThresh(CONFIDENCE)
    if stitcher.estimateTransform(images) != cv2.Stitcher_OK:
        return {}
    cameras = [np.linalg.inv(camera.R).astype(np.float64) for camera in stitcher.cameras()]  # R: picture to image
    return {int(k): T for k, T in zip(stitcher.component(), cameras, strict=True)}


def motion_between(
    source: tuple[npt.NDArray[np.uint8], Array],
    target: tuple[npt.NDArray[np.uint8], Array],
    T_all_target: Array,
    T_all_source: Array,
) -> tuple[float, float, float]:
    """The rigid motion (x, y, theta) of a map into another that is nearest to the affine one at the map's middle."""
    T = target[1] @ np.linalg.inv(T_all_target) @ T_all_source @ np.linalg.inv(source[1])
    rows, cols = source[0].shape[:2]
    middle = source[1] @ (cols / 2, rows / 2, 1.0)
    theta = math.atan2(T[1, 0] - T[0, 1], T[0, 0] + T[1, 1])
    c, s = math.cos(theta), math.sin(theta)
    moved = T @ middle
    x, y = moved[0] - (c * middle[0] - s * middle[1]), moved[1] - (s * middle[0] + c * middle[1])
    return float(x), float(y), theta


def write_result(out: Path, names: list[str], motions: dict[int, tuple[float, float, float]]) -> None:
    """Write ``result.json``: the stitched maps are one component, each other map is one of its own."""
    maps = {}
    for k, name in enumerate(names):
        motion = dict(zip(("x", "y", "theta"), motions[k], strict=True)) if k in motions else None
        component, reason = (0, None) if motion else (k + 1, "not stitched")
        maps[name] = {"placed": k in motions, "component": component, "T_ref_map": motion, "reason": reason}
    (out / "result.json").write_text(json.dumps({"schema": 1, "maps": maps}, indent=1))


if __name__ == "__main__":
    sys.exit(main())
