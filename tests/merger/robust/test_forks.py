"""Work shared among forked processes gives the answers of work done in one."""

import os
import threading

import cv2
import pytest

from merger.robust.forks import map_in_forks


@pytest.fixture
def one_opencv_thread():
    before = cv2.getNumThreads()
    cv2.setNumThreads(1)
    yield
    cv2.setNumThreads(before)


@pytest.fixture
def alone(one_opencv_thread, monkeypatch):
    """As if no other test had left a thread."""
    monkeypatch.setattr("merger.robust.forks.threading.active_count", lambda: 1)


def quiet(stage: str, done: int, total: int) -> None:
    pass


@pytest.mark.usefixtures("alone")
@pytest.mark.parametrize("workers", [1, 2, 3, 20])
@pytest.mark.parametrize("count", [0, 1, 2, 7])
def test_answers_come_in_the_order_of_the_items(workers: int, count: int) -> None:
    offset = 100  # what the work reads besides its item is there in every process
    assert map_in_forks(lambda item: item + offset, range(count), workers, "pairs", quiet) == [
        item + offset for item in range(count)
    ]


@pytest.mark.usefixtures("alone")
def test_work_is_shared_among_processes() -> None:
    processes = map_in_forks(lambda _: os.getpid(), range(6), 3, "pairs", quiet)
    assert len(set(processes)) == 3
    assert processes[2] == processes[5] == os.getpid()


@pytest.mark.usefixtures("alone")
def test_progress_rises_to_the_end() -> None:
    told: list[int] = []
    map_in_forks(lambda item: item, range(7), 2, "pairs", lambda stage, done, total: told.append(done))
    assert told == sorted(told)
    assert told[-1] == 7


@pytest.mark.usefixtures("alone")
@pytest.mark.parametrize("bad", [0, 1], ids=["in a child", "in the parent"])
def test_an_error_is_raised_where_the_work_was_asked_for(bad: int) -> None:
    def work(item: int) -> int:
        if item == bad:
            raise ValueError("no wall in map 3")
        return item

    with pytest.raises(ValueError, match="no wall in map 3"):
        map_in_forks(work, range(4), 2, "pairs", quiet)


@pytest.mark.usefixtures("alone")
def test_a_process_that_is_killed_is_told() -> None:
    parent = os.getpid()

    def work(item: int) -> int:
        if os.getpid() != parent:
            os._exit(7)
        return item

    with pytest.raises(RuntimeError, match="exit code 7"):
        map_in_forks(work, range(4), 2, "pairs", quiet)


@pytest.mark.usefixtures("one_opencv_thread")
def test_a_process_with_threads_does_not_fork() -> None:
    done = threading.Event()
    other = threading.Thread(target=done.wait)
    other.start()
    processes = map_in_forks(lambda _: os.getpid(), range(6), 3, "pairs", quiet)
    done.set()
    other.join()
    assert set(processes) == {os.getpid()}
