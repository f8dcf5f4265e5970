"""Sweeps over overrides: ``seed=range(0,100) world=tim,intel`` names 200 configs; for the entry points only."""

import itertools
import re
from collections.abc import Collection, Sequence
from copy import deepcopy
from dataclasses import dataclass
from pathlib import Path

from hydra.core.override_parser.types import Override
from hydra.errors import HydraException
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from sim.hydra_schema import OverrideError, compose_config, one_line, parse_overrides


@dataclass(frozen=True)
class SweepPoint:
    """One config of a sweep."""

    label: str
    """A name of its own among the configs, fit for a folder's name."""
    parameters: dict[str, str]
    """The swept keys and their values."""
    config: DictConfig
    """The composed config."""


def expand_sweep(conf: Path, root: str, overrides: Sequence[str], groups: Collection[str]) -> list[SweepPoint]:
    """Compose every config of a sweep, the last swept key changing fastest.

    Choices of groups are composed by hydra; plain values are put into what it composed, which is much faster.

    Args:
        conf: Folder of the configuration.
        root: Name of the root config.
        overrides: ``key=value``, some of them sweeps.
        groups: Keys that are config groups.

    Raises:
        OverrideError: an override cannot be used, or two configs would get the same label.
    """
    parsed = parse_overrides(overrides)
    fixed = [override.input_line or "" for override in parsed if not override.is_sweep_override()]
    swept = [override for override in parsed if override.is_sweep_override()]
    if not swept:
        raise OverrideError("-m needs a sweep, such as seed=range(0,100) or world=tim,intel")
    choices_of = [swept_words(override) for override in swept]
    composed: dict[tuple[str, ...], DictConfig] = {}
    points: dict[str, SweepPoint] = {}
    for words in itertools.product(*choices_of):
        choices = tuple(word for word in words if word.partition("=")[0] in groups)
        if choices not in composed:
            composed[choices] = compose_config(conf, root, [*fixed, *choices])
        config = deepcopy(composed[choices])
        for override in parse_overrides([word for word in words if word not in choices]):
            _update(config, override)
        label = re.sub(r"[^\w.=+-]", "_", "_".join(words))
        if label in points:
            raise OverrideError(f"two datasets of the sweep would be called '{label}'")
        parameters = dict(zip((override.key_or_group for override in swept), map(_value_text, words), strict=True))
        points[label] = SweepPoint(label, parameters, config)
    return list(points.values())


def swept_words(override: Override) -> list[str]:
    """A swept override as the plain overrides that it stands for; at least one.

    Raises:
        OverrideError: it stands for none, or cannot be enumerated.
    """
    try:
        words = [f"{override.key_or_group}={value}" for value in override.sweep_string_iterator()]
    except HydraException:
        raise OverrideError(f"'{override.input_line}' is a sweep that is not known here: use a,b,c or range") from None
    if not words:
        raise OverrideError(f"'{override.input_line}' is an empty sweep")
    return words


def _value_text(word: str) -> str:
    return word.partition("=")[2]


def _update(config: DictConfig, override: Override) -> None:
    try:
        OmegaConf.update(config, override.key_or_group, override.value(), force_add=False)
    except OmegaConfBaseException as error:
        raise OverrideError(f"{override.input_line}: {one_line(error)}") from None
