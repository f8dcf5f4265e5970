"""The command that makes a dataset again."""

import dataclasses
import shlex
from collections.abc import Mapping
from enum import Enum
from typing import Any

from sim.config import SimConfig, SourceKind
from sim.sensors.lidar_noise import NOISE_PRESETS
from sim.sensors.lidar_presets import LIDAR_PRESETS

_PLAIN_ROBOT = "pioneer"
"""The choice of ``robot`` that leaves every default."""


def make_command(config: SimConfig, name: str) -> str:
    """The command line that gives this config, whatever the defaults of the groups are.

    Args:
        config: What made the dataset.
        name: Name of the dataset, for the folder to write.
    """
    words = ["python", "-m", "sim", *override_words(config), f"out={_text(f'out/{name}')}"]
    return " ".join(shlex.quote(word) for word in words)


def override_words(config: SimConfig) -> list[str]:
    """Overrides ``key=value``: the choice of each group, then every value that differs from it."""
    lidar = _nearest(config.lidar, LIDAR_PRESETS)
    noise = _nearest(config.noise, NOISE_PRESETS)
    words = [f"source={config.source.kind.value}", f"mapping={config.mapping.poses.value}", f"seed={config.seed}"]
    if config.source.kind is SourceKind.SIMULATED:
        words.append(f"world={_text(config.world)}")
    words += [f"robot={_PLAIN_ROBOT}", f"lidar={lidar}", f"noise={noise}"]
    chosen = SimConfig(world=config.world, lidar=LIDAR_PRESETS[lidar], noise=NOISE_PRESETS[noise])
    return words + _differences("", config, chosen, {"source.kind", "mapping.poses", "seed"})


def _nearest(config: Any, presets: Mapping[str, Any]) -> str:
    """The preset that has most values in common with a config, the first of equals."""
    names = [field.name for field in dataclasses.fields(config)]
    return max(presets, key=lambda preset: sum(getattr(presets[preset], n) == getattr(config, n) for n in names))


def _differences(prefix: str, value: Any, default: Any, done: set[str]) -> list[str]:
    """Overrides of the leaves of a config that differ from another one's."""
    words = []
    for field in dataclasses.fields(value):
        key, mine, other = prefix + field.name, getattr(value, field.name), getattr(default, field.name)
        if dataclasses.is_dataclass(mine):
            words += _differences(f"{key}.", mine, other, done)
        elif mine != other and key not in done:
            words.append(f"{key}={_text(mine)}")
    return words


def _text(value: Any) -> str:
    """A value in hydra's grammar."""
    if value is None:
        return "null"
    if isinstance(value, Enum):
        return value.name
    if isinstance(value, (tuple, list)):
        return "[" + ",".join(_text(item) for item in value) + "]"
    if isinstance(value, str):
        plain = value.replace("/", "").replace("-", "").replace("_", "").replace(".", "")
        is_word = plain.isalnum() and not plain.isdigit()
        return value if is_word else "'" + value.replace("\\", "\\\\").replace("'", "\\'") + "'"
    return repr(value) if isinstance(value, float) else str(value).lower()
