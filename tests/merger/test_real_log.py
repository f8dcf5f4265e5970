"""The Intel log in eight parts, if it is there: what the paper's pipeline must reach."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from merger import se2
from merger.pipeline import MergeConfig, Method, merge_maps
from sim.config import SimConfig, SourceConfig, SourceKind
from sim.datasets.dataset import make_dataset, read_dataset
from sim.maps.submaps import SubmapsConfig

_LOG = Path(__file__).resolve().parents[3] / "shared" / "data" / "intel-corrected.log.gz"

pytestmark = pytest.mark.skipif(not _LOG.is_file(), reason=f"the log {_LOG.name} is not beside the repository")


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    source = SourceConfig(kind=SourceKind.CARMEN, path=str(_LOG))
    config = replace(SimConfig(), source=source, submaps=SubmapsConfig(count=8, overlap=0.3))
    return read_dataset(make_dataset(config, tmp_path_factory.mktemp("intel") / "dataset"))


def test_the_paper_places_all_parts_of_the_log_within_its_bounds(dataset):
    result = merge_maps(dataset.maps, MergeConfig(method=Method.PAPER, composite=False))
    T_world_map = dict(zip(dataset.truth.names, dataset.truth.T_world_map, strict=True))
    assert result.num_placed == 8
    for placement in result.maps:
        expected = se2.invert(T_world_map[result.reference]) @ T_world_map[placement.name]
        error = np.abs(se2.log(se2.invert(expected) @ placement.T_ref_map))
        assert error[:2].max() < 0.15
        assert error[2] < np.deg2rad(0.5)
