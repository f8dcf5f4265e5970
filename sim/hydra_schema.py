"""Config dataclasses as hydra sees them, and back; for the entry points only.

Hydra needs classes that it may write to, while ours are frozen; so each config class gets a writable twin with the same
fields and defaults, and the composed tree is built back into the frozen classes, whose checks run then.
"""

import dataclasses
import re
import types
import typing
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

from hydra import compose, initialize_config_dir
from hydra.core.config_store import ConfigStore
from hydra.core.global_hydra import GlobalHydra
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Override
from hydra.errors import HydraException
from omegaconf import DictConfig, ListConfig
from omegaconf.errors import OmegaConfBaseException

T = TypeVar("T")


class OverrideError(ValueError):
    """Overrides that cannot be used; the message is one line that names the key and the fault."""


def writable_twin(config_class: Any) -> Any:
    """A dataclass with the fields and defaults of a frozen one, not frozen itself, its nested classes likewise."""
    return _twin(config_class)


def _make_twin(config_class: Any) -> Any:
    hints = typing.get_type_hints(config_class)
    fields: list[tuple[str, Any, Any]] = []
    for field in dataclasses.fields(config_class):
        kind = hints[field.name]
        if dataclasses.is_dataclass(kind):
            twin = _twin(kind)
            fields.append((field.name, twin, dataclasses.field(default_factory=_factory(twin, field))))
        else:
            fields.append((field.name, kind, _default_of(field)))
    return dataclasses.make_dataclass(config_class.__name__, fields)


_twin: Callable[[Any], Any] = cache(_make_twin)
"""One twin for each class."""


def register(name: str, config_class: type) -> None:
    """Register a config class as a hydra schema: unknown keys and wrong types are refused."""
    ConfigStore.instance().store(name=name, node=writable_twin(config_class))


def register_choice(group: str, name: str, config: Any) -> None:
    """Register a config as a choice of a group, as a file of ``conf/GROUP/`` would be."""
    ConfigStore.instance().store(group=group, name=name, node=_writable(_twin(type(config)), config))


def group_choices(conf: Path, group: str) -> list[str]:
    """Names of the choices of a config group, from files and from what has been registered."""
    files = {path.stem for path in (conf / group).glob("*.yaml")}
    store = ConfigStore.instance()
    known = {name.removesuffix(".yaml") for name in store.list(group)} if group in store.repo else set()
    return sorted(files | known)


def compose_config(conf: Path, root: str, overrides: Sequence[str]) -> DictConfig:
    """Compose a root config with overrides.

    Raises:
        OverrideError: an override names an unknown key or choice, or has a wrong type, or a config file is faulty.
    """
    GlobalHydra.instance().clear()
    try:
        with initialize_config_dir(str(conf.absolute()), version_base="1.3"):
            return compose(root, overrides=[override.input_line or "" for override in parse_overrides(overrides)])
    except (HydraException, OmegaConfBaseException) as error:
        raise OverrideError(one_line(error)) from None


def parse_overrides(overrides: Sequence[str]) -> list[Override]:
    """Parse overrides; a value that hydra's grammar cannot read (a path with a space) is taken as it stands.

    Raises:
        OverrideError: an argument is not ``key=value``, or would add or delete a key.
    """
    parsed = [_parse_override(override) for override in overrides]
    for override in parsed:
        if override.is_add() or override.is_delete() or override.is_force_add():
            raise OverrideError(f"'{override.input_line}' would add or delete a key: only key=value is possible")
        if override.key_or_group.split(".")[0] == "hydra":
            raise OverrideError(f"'{override.input_line}' is a setting of hydra, which is not used here")
    return parsed


def build(config_class: type[T], node: DictConfig) -> T:
    """Build a frozen config from a composed node; keys of the node that the class lacks are left alone.

    Raises:
        ValueError: a class refuses its values.
        OverrideError: a value is missing.
    """
    hints = typing.get_type_hints(config_class)
    values = {}
    for field in dataclasses.fields(typing.cast(Any, config_class)):
        try:
            values[field.name] = _value(hints[field.name], node[field.name])
        except OmegaConfBaseException as error:
            raise OverrideError(one_line(error)) from None
    return config_class(**values)


def _factory(twin: type, field: "dataclasses.Field[Any]") -> Any:
    """Makes the twin's instance with the values that the frozen class gives the field by default."""
    if field.default_factory is dataclasses.MISSING:
        return lambda: _writable(twin, field.default)
    make = field.default_factory
    return lambda: _writable(twin, make())


def _writable(twin: type, instance: Any) -> Any:
    values = {}
    for field in dataclasses.fields(twin):
        value = getattr(instance, field.name)
        nested = dataclasses.is_dataclass(value)
        values[field.name] = _writable(_twin(type(value)), value) if nested else _listed(value)
    return twin(**values)


def _default_of(field: "dataclasses.Field[Any]") -> Any:
    default: Any = field.default
    if isinstance(default, tuple):
        return dataclasses.field(default_factory=lambda: list(default))
    if default is not dataclasses.MISSING:
        return dataclasses.field(default=default)
    if field.default_factory is not dataclasses.MISSING:
        return dataclasses.field(default_factory=field.default_factory)
    return dataclasses.field()


def _listed(value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value


def _value(hint: Any, value: Any) -> Any:
    """A composed value as its field wants it."""
    if isinstance(value, DictConfig):
        return build(typing.cast(type, hint), value) if dataclasses.is_dataclass(hint) else dict(value)
    if isinstance(value, ListConfig):
        return _sequence(hint, value)
    return value


def _sequence(hint: Any, value: ListConfig) -> Any:
    """Lists come back as the tuple that the field declares."""
    if isinstance(hint, types.UnionType) or typing.get_origin(hint) is typing.Union:
        hint = next(part for part in typing.get_args(hint) if part is not type(None))
    arguments = typing.get_args(hint)
    item = arguments[0] if arguments else None
    kind = typing.get_origin(hint) or tuple
    return kind(_value(item, element) for element in value)


def _parse_override(override: str) -> Override:
    parser = OverridesParser.create()
    try:
        return parser.parse_override(override)
    except HydraException as error:
        key, equals, value = override.partition("=")
        if not equals or not key:
            raise OverrideError(f"'{override}' is not of the form key=value") from None
        quoted = value.replace("\\", "\\\\").replace("'", "\\'")
        try:
            return parser.parse_override(f"{key}='{quoted}'")
        except HydraException:
            raise OverrideError(one_line(error)) from None


def one_line(error: Exception) -> str:
    """What a hydra message and its cause say, on one line, without their advice."""
    texts = [str(error)]
    if error.__cause__ is not None and str(error.__cause__) not in texts[0]:
        texts.append(str(error.__cause__))
    advice = r"To append to your config use.*|Config search path:.*|object_type=.*|full_key: .*|Did you mean to.*"
    return re.sub(r"\s+", " ", " ".join(re.sub(rf"(?s)({advice})", "", text) for text in texts)).strip()
