import os

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from merger import se2
from merger.grid_map import GridMap
from merger.map_server import MapFileError, read_map, write_map

_HEADER = {
    "image": "map.pgm",
    "resolution": 0.05,
    "origin": [1.0, -2.0, 0.5],
    "negate": 0,
    "occupied_thresh": 0.65,
    "free_thresh": 0.196,
}


def _write(folder, pixels=None, name="map.pgm", **changes):
    """A map by its header, changed; a field of None is left out."""
    header = {key: value for key, value in (_HEADER | changes).items() if value is not None}
    (folder / "map.yaml").write_text("".join(f"{key}: {value}\n" for key, value in header.items()))
    if pixels is None:
        pixels = np.array([[0, 254, 205], [254, 254, 205]], dtype=np.uint8)
    cv2.imwrite(str(folder / name), pixels)
    return folder / "map.yaml"


@settings(max_examples=30, deadline=None)
@given(
    st.integers(0, 10_000),
    st.floats(0.01, 1.0),
    st.tuples(st.floats(-100, 100), st.floats(-100, 100), st.floats(-3.1, 3.1)),
)
def test_a_written_map_is_read_back_as_it_was(tmp_path_factory, seed, resolution_m, origin):
    rng = np.random.default_rng(seed)
    cells = rng.choice(np.array([-2.0, 0.0, 2.0], dtype=np.float32), size=rng.integers(1, 12, size=2))
    grid = GridMap("some map", cells, resolution_m, se2.make_motion(*origin))
    path = tmp_path_factory.mktemp("maps") / "some map.yaml"
    write_map(path, grid)
    again = read_map(path)
    assert again.name == "some map"
    assert (again.log_odds == cells).all()
    assert again.resolution_m == resolution_m
    assert np.allclose(again.T_map_grid, grid.T_map_grid, atol=1e-12)
    assert sorted(file.name for file in path.parent.iterdir()) == ["some map.pgm", "some map.yaml"]


def test_row_0_of_the_image_is_the_largest_y_and_the_origin_is_the_lower_left_corner(tmp_path):
    grid = read_map(_write(tmp_path, origin=[1.0, -2.0, 0.0]))
    assert np.allclose(grid.cell_centers(grid.occupied), [[1.025, -1.925]])


def test_the_yaw_of_the_origin_turns_the_map_about_it(tmp_path):
    grid = read_map(_write(tmp_path, origin=[1.0, -2.0, np.pi / 2]))
    assert np.allclose(grid.cell_centers(grid.occupied), [[1.0 - 0.075, -2.0 + 0.025]])


def test_cells_between_the_thresholds_are_unknown_and_thresholds_are_those_of_the_file(tmp_path):
    pixels = np.array([[0, 80, 100, 150, 205, 230, 254]], dtype=np.uint8)
    grid = read_map(_write(tmp_path, pixels))
    assert grid.log_odds[0].tolist() == [2.0, 2.0, 0.0, 0.0, 0.0, -2.0, -2.0]
    grid = read_map(_write(tmp_path, pixels, occupied_thresh=0.4, free_thresh=0.3))
    assert grid.log_odds[0].tolist() == [2.0, 2.0, 2.0, 2.0, -2.0, -2.0, -2.0]


def test_a_negated_map_is_the_map_of_the_negative_image(tmp_path):
    pixels = np.array([[0, 254, 205], [1, 254, 100]], dtype=np.uint8)
    plain = read_map(_write(tmp_path, pixels))
    assert (read_map(_write(tmp_path, 255 - pixels, negate=1)).log_odds == plain.log_odds).all()


def test_the_mode_may_be_written_in_capitals(tmp_path):
    pixels = np.array([[0, 100, 128, 255]], dtype=np.uint8)
    raw = read_map(_write(tmp_path, pixels, mode="raw")).log_odds.tolist()
    assert read_map(_write(tmp_path, pixels, mode="Raw")).log_odds.tolist() == raw


@pytest.mark.parametrize("name", ["a: b", "#1", "'a'", "- x", "1", "étage 地图", "[", 'say "no"', "two\nlines"])
def test_a_map_of_any_name_is_read_back(tmp_path, name):
    grid = GridMap(name, np.array([[2.0, -2.0]], dtype=np.float32), 0.1)
    write_map(tmp_path / f"{name}.yaml", grid)
    again = read_map(tmp_path / f"{name}.yaml")
    assert (again.name, again.log_odds.tolist()) == (name, [[2.0, -2.0]])


@pytest.mark.parametrize("kind", [2, 5, 3, 6])
@pytest.mark.parametrize("white", [100, 255, 1000, 65_535])
def test_the_white_of_a_portable_map_is_what_its_head_says(tmp_path, kind, white):
    greys = np.rint(np.array([0, 254, 205]) / 255.0 * white).astype(int).repeat(3 if kind in (3, 6) else 1)
    data = " ".join(map(str, greys)).encode() if kind < 4 else greys.astype(">u2" if white > 255 else "u1").tobytes()
    path = _write(tmp_path)
    (tmp_path / "map.pgm").write_bytes(b"P%d\n# 0.050 m/pix\n3 1 %d\n" % (kind, white) + data)
    assert read_map(path).log_odds.tolist() == [[2.0, -2.0, 0.0]]


def test_scale_and_raw_modes_keep_probabilities(tmp_path):
    pixels = np.array([[0, 100, 128, 255]], dtype=np.uint8)
    scale = read_map(_write(tmp_path, pixels, mode="scale")).log_odds[0]
    assert scale[0] > 2.0
    assert 0.0 < scale[1] < 2.0
    assert scale[3] < -2.0
    raw = read_map(_write(tmp_path, pixels, mode="raw")).log_odds[0]
    assert raw[0] < -2.0
    assert raw[1] > 2.0
    assert raw[2] == 0.0
    assert raw[3] == 0.0


@pytest.mark.parametrize("suffix", ["png", "bmp"])
def test_other_images_colours_and_transparency_are_read(tmp_path, suffix):
    colours = np.dstack([np.array([[0, 254, 205]], dtype=np.uint8)] * 3)
    name = f"map.{suffix}"
    assert read_map(_write(tmp_path, colours, name=name, image=name)).log_odds[0].tolist() == [2.0, -2.0, 0.0]
    if suffix == "png":
        alpha = np.dstack([colours, np.array([[255, 0, 255]], dtype=np.uint8)])
        assert read_map(_write(tmp_path, alpha, name=name, image=name)).log_odds[0].tolist() == [2.0, 0.0, 0.0]
        wide = read_map(_write(tmp_path, colours[:, :, 0].astype(np.uint16) * 257, name=name, image=name))
        assert wide.log_odds[0].tolist() == [2.0, -2.0, 0.0]


@pytest.mark.parametrize(
    ("changes", "fault"),
    [
        ({"image": None}, "field 'image' is missing"),
        ({"resolution": None}, "field 'resolution' is missing"),
        ({"origin": None}, "field 'origin' is missing"),
        ({"resolution": 0.0}, "resolution must be in [0.001, 100] m, got 0"),
        ({"resolution": -0.05}, "resolution must be in [0.001, 100] m, got -0.05"),
        ({"resolution": "fine"}, "field 'resolution' must be a finite number, got 'fine'"),
        ({"resolution": "yes"}, "field 'resolution' must be a finite number, got True"),
        ({"resolution": ".inf"}, "field 'resolution' must be a finite number"),
        ({"origin": [1.0, 2.0]}, "field 'origin' is missing or not a list of three"),
        ({"resolution": 1e300}, "resolution must be in [0.001, 100] m, got 1e+300"),
        ({"resolution": "9" * 400}, "field 'resolution' must be a finite number"),
        ({"origin": [1e300, 2.0, 0.0]}, "its origin must lie within 1e+08 m"),
        ({"origin": "[1.0, 2.0, .nan]"}, "field 'origin' must be a finite number"),
        ({"mode": "colourful"}, "mode must be one of trinary, scale, raw, got 'colourful'"),
        ({"free_thresh": 0.7}, "need 0 <= free_thresh < occupied_thresh <= 1"),
        ({"image": "other.pgm"}, "its image other.pgm does not exist"),
    ],
)
def test_a_fault_in_the_header_is_told_with_the_file_in_one_line(tmp_path, changes, fault):
    path = _write(tmp_path, **changes)
    with pytest.raises(MapFileError) as error:
        read_map(path)
    assert str(error.value).startswith(f"{path}: ")
    assert fault in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("", "the file is empty"),
        ("  \n", "the file is empty"),
        ("- 1\n- 2\n", "not a map_server YAML"),
        ("image: [\n", "not YAML"),
        ("resolution: 2001-99-99\n", "not YAML"),
        ("image: " + 100_000 * "[", "too long for a map_server YAML"),
        ("image: " + 9_000 * "[", "not YAML"),
        (b"\xff\xfe\x00\x01", "cannot be read"),
    ],
)
def test_a_file_that_is_no_header_is_refused(tmp_path, text, fault):
    path = tmp_path / "map.yaml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(MapFileError, match=fault):
        read_map(path)


@pytest.mark.parametrize("data", [b"", b"not an image", b"P5\n3 2\n255\n"])
def test_an_image_that_is_not_one_is_refused_by_us_alone(tmp_path, data, capfd):
    path = _write(tmp_path)
    (tmp_path / "map.pgm").write_bytes(data)
    with pytest.raises(MapFileError, match=r"its image map\.pgm is not an image"):
        read_map(path)
    assert capfd.readouterr().err == ""


def test_a_file_whose_name_is_no_text_is_refused(tmp_path):
    path = _write(tmp_path).rename(os.fsdecode(os.fsencode(tmp_path) + b"/\xff.yaml"))
    with pytest.raises(MapFileError, match="its name is not in UTF-8"):
        read_map(path)


def test_a_missing_file_is_told(tmp_path):
    with pytest.raises(MapFileError, match="no such file"):
        read_map(tmp_path / "none.yaml")
