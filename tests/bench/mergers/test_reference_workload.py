"""The reference workload is timed often enough to follow the machine, and seldom enough to cost nothing."""

import pytest

from bench.mergers import reference_workload


def test_the_reference_is_timed_once_in_ten_seconds(monkeypatch: pytest.MonkeyPatch) -> None:
    times, clock = iter((2.0, 3.0)), [1000.0]
    monkeypatch.setattr(reference_workload, "time_reference", lambda: next(times))
    monkeypatch.setattr(reference_workload.time, "monotonic", lambda: clock[0])
    reference_workload._reference_in.cache_clear()
    found = []
    for clock[0] in (1000.0, 1009.9, 1010.0, 1019.0):
        found.append(reference_workload.recent_reference())
    assert found == [2.0, 2.0, 3.0, 3.0]
    reference_workload._reference_in.cache_clear()
