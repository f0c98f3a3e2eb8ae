"""Work on several threads."""

from __future__ import annotations

import threading

from shaftline.mismatch.simulate.joint_replay import THREADS, map_threaded


def test_results_come_in_their_order_and_none_is_lost() -> None:
    assert list(map_threaded(lambda x: x * x, range(50))) == [x * x for x in range(50)]
    assert list(map_threaded(abs, [])) == []


def test_no_more_is_taken_than_is_under_way() -> None:
    taken = []

    def items() -> object:
        for i in range(100):
            taken.append(i)
            yield i

    results = map_threaded(lambda x: x, items())  # type: ignore[arg-type, var-annotated]
    next(results)
    assert len(taken) <= 2 * THREADS


def test_work_inside_of_other_work_needs_no_further_thread() -> None:
    def outer(x: int) -> list[int]:
        return list(map_threaded(lambda y: x * y, range(5)))

    count = 4 * THREADS
    assert list(map_threaded(outer, range(count))) == [
        [x * y for y in range(5)] for x in range(count)
    ]


def test_as_many_work_at_a_time_as_there_are_threads() -> None:
    meeting = threading.Barrier(THREADS, timeout=10.0)
    assert len(list(map_threaded(lambda _: meeting.wait(), range(THREADS)))) == THREADS
