"""The Foxglove layout shows what a recording holds."""

import json
from typing import Any

import pytest
from mcap.reader import make_reader

from sim.resources import conf_folder


@pytest.fixture
def layout() -> dict[str, Any]:
    return dict(json.loads((conf_folder() / "foxglove_layout.json").read_text()))


def panels(node: Any) -> list[str]:
    return [node] if isinstance(node, str) else [*panels(node["first"]), *panels(node["second"])]


def test_every_panel_of_the_layout_is_configured(layout):
    assert set(panels(layout["layout"])) == set(layout["configById"])


def test_scans_maps_and_ways_of_a_recording_are_shown_in_the_frame_of_the_world(layout, tiny_dataset):
    with (tiny_dataset / "recording.mcap").open("rb") as file:
        recorded = {channel.topic for channel in make_reader(file).get_summary().channels.values()}
    view = layout["configById"]["3D!mapmerge"]
    shown = {topic for topic, settings in view["topics"].items() if settings["visible"]}
    unseen = {"/tf", "/tf_static", *(f"/robot_{k}/odom" for k in range(2))}
    assert recorded - shown == unseen
    assert view["followTf"] == "world"


def test_plots_follow_fields_of_topics_that_are_recorded(layout, tiny_dataset):
    with (tiny_dataset / "recording.mcap").open("rb") as file:
        recorded = {channel.topic for channel in make_reader(file).get_summary().channels.values()}
    for path in layout["configById"]["Plot!odometry"]["paths"]:
        assert path["value"].split(".")[0] in recorded
