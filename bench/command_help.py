"""What ``python -m bench --help`` says."""

import ast
import inspect
import itertools
import textwrap
from dataclasses import fields

import yaml

from bench.command_words import FILES_ONLY
from bench.settings import BenchSettings, MethodSettings
from sim.resources import conf_folder

_USAGE = "python -m bench [-m] [experiment=NAME] [key=value ...]: run an experiment, print its table, write its report."
_EXAMPLES = """\
  python -m bench experiment=overlap seeds=5 out=DIR
  python -m bench -m noise.range_sigma_m=0.01,0.03 submaps.overlap=0,0.2 methods=[paper,robust] seeds=20
  python -m bench world=tim method=external method.command='prog {maps} {out}'"""
_STATUS = """\
Exit status: 0, at least one row is ok; 1, none is; 2, bad input; 130, stopped by Ctrl-C. Finished cells are kept: the
same command goes on from there."""


def help_text() -> str:
    """Usage, experiments by title, and the keys of `bench.settings.BenchSettings` with their defaults and meanings."""
    names = sorted(path.stem for path in (conf_folder() / "experiment").glob("*.yaml"))
    experiments = "\n".join(f"  {name:20} {_title(name)}" for name in names)
    keys = "\n".join(_key_lines(BenchSettings()))
    heads = ["Examples:", "Experiments:", "Keys (all others are those of `python -m sim`):"]
    parts = [f"{head}\n{text}" for head, text in zip(heads, (_EXAMPLES, experiments, keys), strict=True)]
    return "\n\n".join([_USAGE, *parts, _STATUS])


def _title(name: str) -> str:
    document = yaml.safe_load((conf_folder() / "experiment" / f"{name}.yaml").read_text(encoding="utf-8"))
    return str(document.get("title", ""))


def _key_lines(config: BenchSettings | MethodSettings, prefix: str = "") -> list[str]:
    texts = _field_texts(type(config))
    lines = []
    for name in (item.name for item in fields(config) if item.name not in FILES_ONLY):
        value = getattr(config, name)
        if isinstance(value, MethodSettings):
            lines += _key_lines(value, f"{name}.")
        else:
            lines.append(f"  {f'{prefix}{name}={_word(value)}':26} {texts[name]}")
    return lines


def _word(value: object) -> str:
    """A default as one would type it; nothing for none and for what is long."""
    if value is None or isinstance(value, dict):
        return ""
    if isinstance(value, list):
        return f"[{','.join(map(str, value))}]"
    return str(value).lower() if isinstance(value, bool) else str(value)


def _field_texts(config_class: type) -> dict[str, str]:
    """The docstring below each field of a config class."""
    tree = ast.parse(textwrap.dedent(inspect.getsource(config_class)))
    definition = next(node for node in ast.walk(tree) if isinstance(node, ast.ClassDef))
    texts = {}
    for field, text in itertools.pairwise(definition.body):
        if isinstance(field, ast.AnnAssign) and isinstance(text, ast.Expr):
            texts[ast.unparse(field.target)] = " ".join(ast.literal_eval(text.value).replace("`", "").split())
    return texts
