"""The words of ``python -m bench``, before hydra reads them: options, keys, sweeps, and what is a job's own."""

import itertools
import re
from collections.abc import Sequence
from dataclasses import dataclass

from hydra.core.override_parser.types import Override

from sim.hydra_schema import OverrideError, parse_overrides
from sim.sweep import swept_words

HELP = ("-h", "--help")
_MULTIRUN = ("-m", "--multirun")
_WHOLE_RUN = ("experiment", "title", "table", "out", "workers", "retry_failed", "quiet")
FILES_ONLY = {
    "sweep": "sweep a key with -m KEY=A,B",
    "datasets": "describe one dataset by the keys of python -m sim",
    "variants": "name methods with methods=[A,B]",
}
"""Keys of experiment files that a command line cannot say, and what it can say instead."""


@dataclass(frozen=True)
class CommandWords:
    """A command line, read."""

    jobs: list[list[str]]
    """The overrides of every job of the sweep, at least one job."""
    swept: tuple[str, ...]
    """The keys that have several values."""
    launcher: list[str]
    """What is said to hydra itself: ``hydra/launcher=NAME``, ``hydra.launcher.KEY=VALUE``."""


def read_words(arguments: Sequence[str]) -> CommandWords:
    """Read a command line.

    Raises:
        OverrideError: a word is no option and no ``key=value``, or a sweep is not possible.
    """
    words = [_quote_command(word) for word in arguments if word not in _MULTIRUN]
    for word in words:
        _check_word(word)
    launcher = [word for word in words if root_key(word) == "hydra" or word.startswith("hydra/")]
    overrides = [word for word in words if word not in launcher]
    parsed = parse_overrides(overrides)
    swept = tuple(override.get_key_element() for override in parsed if override.is_sweep_override())
    return CommandWords(_expand_sweep(parsed, multirun=len(words) < len(arguments)), swept, launcher)


def root_key(override: str) -> str:
    """The first part of an override's key."""
    return override.partition("=")[0].split(".")[0]


def _check_word(word: str) -> None:
    key, equals, value = word.partition("=")
    if word.startswith("-"):
        raise OverrideError(f"unknown option '{word}': there are {', '.join((*_MULTIRUN, *HELP))}")
    if not word.isprintable():
        raise OverrideError(f"{word!a} is not text on one line")
    if not key or not equals:
        raise OverrideError(f"'{word}' is not of the form key=value")
    if advice := FILES_ONLY.get("sweep" if root_key(word) == "sweep" else key):
        raise OverrideError(f"{key} is for files of experiments; on the command line {advice}")
    if key == "methods" and re.fullmatch(r"[\w, ]*", value):
        raise OverrideError(f"methods must be a list in brackets, methods=[A,B], got '{value}'")


def _expand_sweep(overrides: Sequence[Override], *, multirun: bool) -> list[list[str]]:
    """The overrides of every job: ``key=a,b`` gives two, as hydra's own sweeper does it."""
    choices: list[list[str]] = []
    for override in overrides:
        key = override.get_key_element()
        if not override.is_sweep_override():
            choices.append([str(override.input_line)])
        elif not multirun:
            raise OverrideError(f"'{override.input_line}' has several values: sweeps need -m")
        elif key in _WHOLE_RUN:
            raise OverrideError(f"{key} is a setting of the whole run, and cannot be swept")
        else:
            choices.append(swept_words(override))
    return [list(job) for job in itertools.product(*choices)]


def _quote_command(argument: str) -> str:
    """A command's words are its own: no comma or brace in it means anything to hydra."""
    key, _, value = argument.partition("=")
    if key != "method.command" or value[:1] in ("'", '"'):
        return argument
    escaped = value.replace("\\", "\\\\").replace("'", "\\'")
    return f"{key}='{escaped}'"
