"""Work done side by side: in this process, or in several on this machine."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, as_completed
from contextlib import contextmanager
from multiprocessing import get_context
from types import TracebackType
from typing import TYPE_CHECKING, Self, TypeVar

from vegtool.progress import Progress, silent

if TYPE_CHECKING:
    from concurrent.futures import ProcessPoolExecutor
    from multiprocessing.synchronize import Event

Item = TypeVar("Item")
Result = TypeVar("Result")

WORKER_DIED = (
    "the process that converted it, or one beside it, was ended from outside, mostly for want of"
    " memory; fewer files at a time (-j) need less"
)
TRIES = 2
"""Times that an item is begun alone whose process ends under it, before it counts as what ends
it."""
MOST_ON_WINDOWS = 61
"""Processes that one can wait for there (concurrent.futures)."""
AGAIN = 8
"""Items to each process that are begun again together, where all that were waiting are lost."""


def alone(
    function: Callable[[Item], Result], items: Sequence[Item]
) -> Iterator[tuple[Item, Result | None]]:
    """As `Processes.each`, in this process."""
    for item in items:
        yield item, function(item)


class Processes:
    """Processes on this machine, until the `with` block ends; an exception in it, Ctrl-C included,
    ends them at their next `check_stop`."""

    def __init__(self, count: int) -> None:
        self._count = min(count, MOST_ON_WINDOWS) if sys.platform == "win32" else count
        # spawn: a GL context does not survive a fork
        self._spawn = get_context("spawn")
        self._stop = self._spawn.Event()
        self._pool: ProcessPoolExecutor | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if error is not None:
            self._stop.set()
        self._end()

    def submit(
        self, function: Callable[..., Result], jobs: Sequence[tuple[object, ...]]
    ) -> list[Future[Result]]:
        """A future of the function called with the arguments of each job."""
        from concurrent.futures import ProcessPoolExecutor

        with _uninterrupted():
            if self._pool is None:
                self._pool = ProcessPoolExecutor(
                    self._count, self._spawn, _in_worker, (self._stop,)
                )
            return [self._pool.submit(function, *job) for job in jobs]

    def each(
        self, function: Callable[[Item], Result], items: Sequence[Item]
    ) -> Iterator[tuple[Item, Result | None]]:
        """Each item with its result, in the order in which they are done; None where whoever
        worked on it was ended from outside, again and again."""
        lost: list[Item] = []
        yield from self._together(function, items, lost)
        # a process that ends takes all with it that wait for one: again, a few at a time, and the
        # few of whom one ends its process, one at a time
        few = AGAIN * self._count
        for first in range(0, len(lost), few):
            once_more: list[Item] = []
            yield from self._together(function, lost[first : first + few], once_more)
            for item in once_more:
                yield item, self._again(function, item)

    def _together(
        self, function: Callable[[Item], Result], items: Sequence[Item], lost: list[Item]
    ) -> Iterator[tuple[Item, Result]]:
        """Items with their results; those that were lost with a process are added to `lost`, in
        their order."""
        from concurrent.futures.process import BrokenProcessPool

        futures = self.submit(function, [(item,) for item in items])
        of = dict(zip(futures, items, strict=True))
        for future in as_completed(futures):
            try:
                result = future.result()
            except BrokenProcessPool:
                continue
            yield of.pop(future), result
        lost += of.values()
        if of:
            self._end()  # one that has lost a process takes no more work

    def _again(self, function: Callable[[Item], Result], item: Item) -> Result | None:
        """The result of an item that was lost; None where it is lost again and again."""
        for _ in range(TRIES):
            lost: list[Item] = []
            for _, result in self._together(function, [item], lost):
                return result
        return None

    def _end(self) -> None:
        if self._pool is not None:
            self._pool.shutdown(cancel_futures=True)
            self._pool = None


def side_by_side(
    function: Callable[[Item, Progress], Result],
    items: Sequence[Item],
    died: Callable[[Item], Result],
    workers: int,
    progress: Callable[[Item], Progress] = lambda item: silent,
) -> Iterator[Result]:
    """What a function makes of items, in the order given, in so many processes, or in this one.

    function, items, results: what `pickle` takes. died: the result, where the process was ended
    from outside. progress: of an item; in other processes it is told when that is done, and how
    many of all are. Raises what the function raises; what has not begun then does not begin.
    """
    if workers <= 1 or len(items) <= 1:
        for item in items:
            yield function(item, progress(item))
        return
    from concurrent.futures.process import BrokenProcessPool

    with Processes(min(workers, len(items))) as crew:
        futures = crew.submit(function, [(item, _or_stop) for item in items])
        for done, (item, future) in enumerate(zip(items, futures, strict=True), start=1):
            try:
                yield future.result()
            except BrokenProcessPool:
                yield died(item)
            progress(item)("done", done / len(items))


def _or_stop(stage: str, fraction: float) -> None:
    """A worker's progress."""
    check_stop()


_stop: Event | None = None
"""In a worker: set once all work is to end."""


def check_stop() -> None:
    """In a worker: the chance to end, and to leave nothing half-written. Raises KeyboardInterrupt
    where all is to end."""
    if _stop is not None and _stop.is_set():
        raise KeyboardInterrupt


def _in_worker(stop: Event) -> None:
    """What a worker does first: leave Ctrl-C to the process that started it, and end with it."""
    global _stop
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _stop = stop
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """Not to wait without end for work from a process that was killed."""
    from multiprocessing import parent_process

    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


@contextmanager
def _uninterrupted() -> Iterator[None]:
    """Processes are started whole: one half-started would be waited for without end.

    They begin deaf to Ctrl-C, which a terminal sends to all of them; other signals wait.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    came: list[int] = []
    others = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]
    before = {number: signal.signal(number, lambda n, frame: came.append(n)) for number in others}
    before[signal.SIGINT] = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler or signal.SIG_DFL)
    for number in came:
        signal.raise_signal(number)
