"""Simulations that do not wait for each other, on two threads: kernels let other threads run."""

from __future__ import annotations

import functools
import itertools
import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

T = TypeVar("T")
R = TypeVar("R")

THREADS = min(2, os.cpu_count() or 1)


@functools.cache
def _pool(_process: int) -> ThreadPoolExecutor:
    """A process's own: the threads of the one that it was forked from are not there."""
    return ThreadPoolExecutor(THREADS)


def at_once(work: Callable[[T], R], items: Iterable[T]) -> Iterator[R]:
    """``map(work, items)``, in its order.

    Args:
        work: whose inner loops let other threads run.
        items: of which twice as many as there are threads are under way at a time.
    """
    pool, waiting = _pool(os.getpid()), iter(items)
    running = [pool.submit(work, item) for item in itertools.islice(waiting, 2 * THREADS)]
    while running:
        yield running.pop(0).result()
        running += [pool.submit(work, item) for item in itertools.islice(waiting, 1)]
