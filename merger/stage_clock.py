"""Wall time of the stages of a merge."""

import time
from collections.abc import Callable
from dataclasses import fields
from typing import ParamSpec, TypeVar

from merger.result import Runtime

_Args = ParamSpec("_Args")
_Answer = TypeVar("_Answer")


class StageClock:
    """Adds up the wall time of each stage; keeps state because time passes."""

    def __init__(self) -> None:
        """Start the clock of the whole merge."""
        self._start_s = time.perf_counter()
        self._spent_s = {field.name: 0.0 for field in fields(Runtime)}

    def run(self, stage: str, work: Callable[_Args, _Answer], *args: _Args.args, **kwargs: _Args.kwargs) -> _Answer:
        """Call ``work`` and add its time to one stage: a field of `merger.result.Runtime`."""
        start_s = time.perf_counter()
        answer = work(*args, **kwargs)
        self._spent_s[stage] += time.perf_counter() - start_s
        return answer

    def read(self) -> Runtime:
        """The times so far, ``total`` since the clock was made."""
        return Runtime(**{**self._spent_s, "total": time.perf_counter() - self._start_s})
