"""Frozen config classes pass through hydra and come back the same, checked."""

from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path

import pytest
from omegaconf import OmegaConf

from sim.config import SimConfig
from sim.hydra_schema import (
    OverrideError,
    build,
    compose_config,
    parse_overrides,
    register,
    register_choice,
    writable_twin,
)
from sim.resources import conf_folder
from sim.sim_schema import GROUPS, ROOT, RunConfig, register_schema


class Color(StrEnum):
    RED = "red"
    BLUE = "blue"


@dataclass(frozen=True)
class Inner:
    size_m: float = 1.0
    places: tuple[float, ...] = (1.0, 2.0)

    def __post_init__(self) -> None:
        if self.size_m <= 0.0:
            raise ValueError(f"size_m must be > 0, got {self.size_m}")


@dataclass(frozen=True)
class Outer:
    inner: Inner = field(default_factory=lambda: Inner(size_m=3.0))
    color: Color = Color.RED
    count: int | None = None
    names: tuple[str, ...] = ()


@pytest.fixture
def conf(tmp_path: Path) -> Path:
    (tmp_path / "root.yaml").write_text("defaults: [outer_schema, inner: plain, _self_]\n")
    (tmp_path / "inner").mkdir()
    (tmp_path / "inner" / "plain.yaml").write_text("{}\n")
    (tmp_path / "inner" / "large.yaml").write_text("size_m: 9.0\n")
    register("outer_schema", Outer)
    register_choice("inner", "named", Inner(size_m=5.0, places=(7.0,)))
    return tmp_path


def test_the_twin_has_the_defaults_of_the_frozen_class_and_can_be_written():
    node = OmegaConf.structured(writable_twin(Outer))
    assert build(Outer, node) == Outer()
    node.inner.size_m = 4.0
    assert build(Outer, node).inner.size_m == 4.0


def test_every_kind_of_value_comes_back_as_its_field_wants_it(conf):
    words = ["inner=large", "inner.places=[3,4.5]", "color=BLUE", "count=2", "names=[a,b]"]
    assert build(Outer, compose_config(conf, "root", words)) == Outer(Inner(9.0, (3.0, 4.5)), Color.BLUE, 2, ("a", "b"))


def test_a_choice_may_be_a_table_in_the_code(conf):
    assert build(Outer, compose_config(conf, "root", ["inner=named"])).inner == Inner(5.0, (7.0,))


def test_the_frozen_classes_check_what_was_composed(conf):
    with pytest.raises(ValueError, match="size_m must be > 0, got -1"):
        build(Outer, compose_config(conf, "root", ["inner.size_m=-1"]))


@pytest.mark.parametrize(
    "word", ["other=1", "inner.other=1", "inner=other", "color=GREEN", "count=x", "+new=1", "~inner"]
)
def test_unknown_keys_choices_and_wrong_types_are_refused_in_one_line(conf, word):
    with pytest.raises(OverrideError) as caught:
        compose_config(conf, "root", [word])
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("value", ["/a b/c.log", "x(1).yaml", "it's=odd", "a,b'c"])
def test_a_path_that_hydras_grammar_cannot_read_is_taken_as_it_stands(value):
    (override,) = parse_overrides([f"out={value}"])
    assert override.value() == value


def test_the_commands_own_schema_gives_the_defaults_of_its_classes():
    register_schema()
    node = compose_config(conf_folder(), ROOT, ["noise=none"])
    assert build(RunConfig, node) == RunConfig()
    assert build(SimConfig, node) == SimConfig()


@pytest.mark.parametrize(
    "word", [f"{group}={path.stem}" for group in GROUPS for path in sorted((conf_folder() / group).glob("*.yaml"))]
)
def test_every_choice_of_every_group_can_be_composed(word):
    register_schema()
    more = ["source.path=x.log"] if word == "source=carmen" else []
    build(SimConfig, compose_config(conf_folder(), ROOT, [word, *more]))
