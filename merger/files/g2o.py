"""The graph of a merge in g2o's text format, which pose-graph tools read."""

import numpy as np
import numpy.typing as npt

from merger import se2
from merger.result import MergeResult, PairStatus


def encode_g2o(result: MergeResult) -> bytes:
    """Write the placed maps as ``VERTEX_SE2`` and the reliable pairs as ``EDGE_SE2`` with their information.

    A vertex's number is the map's place in the order of names; its pose is ``T_ref_map`` in the frame of its own
    component's reference. An edge's information is that of ``v`` in ``T_target_source @ exp(v)``.
    """
    number = {placement.name: index for index, placement in enumerate(result.maps)}
    lines = [
        f"VERTEX_SE2 {number[placement.name]} {_numbers(se2.parameters_of(placement.T_ref_map))}"
        for placement in result.maps
        if placement.T_ref_map is not None
    ]
    for pair in result.pairs:
        if pair.status == PairStatus.RELIABLE and pair.T_target_source is not None:
            information = np.eye(3) if pair.information is None else pair.information
            ends = f"{number[pair.target]} {number[pair.source]}"
            motion = _numbers(se2.parameters_of(pair.T_target_source))
            lines.append(f"EDGE_SE2 {ends} {motion} {_numbers(information[np.triu_indices(3)])}")
    return ("\n".join(lines) + "\n" if lines else "").encode()


def _numbers(values: npt.NDArray[np.float64]) -> str:
    return " ".join(f"{float(value):.12g}" for value in values)
