import json

import numpy as np
import pytest

from merger.files.g2o import encode_g2o
from merger.files.result_json import from_json_dict, motion_from_json, to_json_dict
from merger.pipeline import MergeConfig, Method, merge_maps
from merger.result import PairStatus


@pytest.fixture(scope="module")
def result(three_maps):
    return merge_maps(three_maps[0], MergeConfig(method=Method.PAPER))


def test_a_result_survives_the_way_through_json(result):
    document = to_json_dict(result)
    again = from_json_dict(json.loads(json.dumps(document)))
    assert to_json_dict(again) == document


def test_the_file_has_the_fields_that_others_rely_on(result):
    document = to_json_dict(result)
    assert set(document) >= {
        "schema", "method", "seed", "version", "reference", "maps", "components", "pairs", "objective", "runtime_s",
    }  # fmt: skip
    assert document["schema"] == 1
    assert set(document["maps"]["east"]) >= {
        "placed", "component", "T_ref_map", "T_ref_map_initial", "confidence", "reason",
    }  # fmt: skip
    assert set(document["pairs"][0]) >= {
        "target", "source", "status", "reason", "T_target_source",
        "num_matches", "num_inliers", "overlap", "rmse_m", "agreement",
    }  # fmt: skip
    assert set(document["runtime_s"]) == {"features", "pairs", "tree", "averaging", "compositing", "total"}


def test_what_other_programs_write_suffices():
    document = {
        "schema": 1,
        "maps": {
            "b": {"placed": True, "component": 0, "T_ref_map": {"x": 1, "y": 2, "theta": 0.5}},
            "a": {"placed": True, "component": 0, "T_ref_map": {"x": 0, "y": 0, "theta": 0}},
            "c": {"placed": False, "component": 1, "T_ref_map": None},
        },
    }
    read = from_json_dict(document)
    assert read.components == (("a", "b"), ("c",))
    assert np.allclose(read.placement("b").T_ref_map[:2, 2], [1, 2])
    with pytest.raises(KeyError):
        read.placement("d")


@pytest.mark.parametrize(
    ("document", "fault"),
    [
        ({}, "'schema' must be 1"),
        ({"schema": 2, "maps": {}}, "'schema' must be 1"),
        ({"schema": 1}, "'maps' is missing or empty"),
        ({"schema": 1, "maps": {"a": {}}}, "map 'a' needs the field 'placed'"),
        ({"schema": 1, "maps": {"a": {"placed": True}}}, "map 'a' is placed but has no 'T_ref_map'"),
        ({"schema": 1, "maps": {"a": {"placed": True, "T_ref_map": {"x": 1}}}}, "needs numbers x, y and theta"),
        ({"schema": 1, "maps": {"a": {"placed": False, "component": "one"}}}, "'component' must be an integer"),
        ({"schema": 1, "maps": {"a": {"placed": False}}, "pairs": [{"target": "a"}]}, "a pair lacks the field"),
    ],
)
def test_a_malformed_document_is_refused_with_the_fact(document, fault):
    with pytest.raises(ValueError, match=fault):
        from_json_dict(document)


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_a_motion_must_be_finite(value):
    with pytest.raises(ValueError, match="finite"):
        motion_from_json({"x": value, "y": 0.0, "theta": 0.0})


def test_the_graph_lists_placed_maps_and_reliable_pairs(result):
    lines = encode_g2o(result).decode().splitlines()
    vertices = [line.split() for line in lines if line.startswith("VERTEX_SE2")]
    edges = [line.split() for line in lines if line.startswith("EDGE_SE2")]
    assert len(vertices) == result.num_placed
    assert len(edges) == sum(pair.status == PairStatus.RELIABLE for pair in result.pairs)
    for edge in edges:
        assert len(edge) == 12
        a, b, c, d, e, f = (float(value) for value in edge[6:])
        assert np.linalg.eigvalsh([[a, b, c], [b, d, e], [c, e, f]]).min() > 0
