"""Work done by a Dask cluster that is there already, whose workers see the same files.

Dask: M. Rocklin, "Dask: parallel computation with blocked algorithms and task scheduling",
Proceedings of the 14th Python in Science Conference (2015). The scheduler gives the work of a
worker that has ended to another.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError, ThreadPoolExecutor
from typing import Any, Self, TypeVar

from vegtool.errors import CapabilityError, UsageError, VegtoolError

Item = TypeVar("Item")
Result = TypeVar("Result")

TIMEOUT_S = 10.0
"""Seconds to reach the scheduler, and for its first worker to be there."""
RETRIES = 3

_thread: ThreadPoolExecutor | None = None
"""In a worker: the one thread that draws. A GL context belongs to the thread that made it, and a
worker has several."""


class Cluster:
    """The workers at a scheduler's address, in place of Processes (vegtool/workers.py).

    Raises CapabilityError without the extra, UsageError where nobody answers, or nobody works.
    """

    def __init__(self, address: str) -> None:
        try:
            from distributed import Client
        except ImportError as error:
            raise CapabilityError(
                "--dask: expected Dask, found none; install it with: pip install 'vegtool[cluster]'"
            ) from error
        try:
            connect: Any = Client  # untyped
            self._client: Any = connect(address, timeout=TIMEOUT_S, set_as_default=False)
        except (OSError, ValueError, TimeoutError) as error:
            raise UsageError(
                f"--dask {address}: expected a Dask scheduler, found none that answers ({error}); "
                "start one with: dask scheduler"
            ) from error
        try:
            self._client.wait_for_workers(1, timeout=TIMEOUT_S)
        except TimeoutError as error:
            self._close()
            raise UsageError(
                f"--dask {address}: expected workers, found none; start some with: dask worker "
                f"{address}"
            ) from error

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self._close()

    def _close(self) -> None:
        close: Any = self._client.close  # untyped
        close()

    def each(
        self, function: Callable[[Item], Result], items: Sequence[Item]
    ) -> Iterator[tuple[Item, Result | None]]:
        """As `Processes.each`. Raises VegtoolError where the scheduler is lost."""
        import distributed

        as_completed: Any = distributed.as_completed  # untyped

        futures = [
            self._client.submit(_alone, function, item, pure=False, retries=RETRIES)
            for item in items
        ]
        of = {future.key: item for future, item in zip(futures, items, strict=True)}
        for future in as_completed(futures, loop=self._client.loop):
            try:
                result = future.result()
            except distributed.KilledWorker:
                yield of[future.key], None
            except CancelledError as error:
                raise VegtoolError(
                    "--dask: expected the scheduler to be there all the time, lost it; start it "
                    "again: the same command goes on where this one ended"
                ) from error
            else:
                yield of[future.key], result
            future.release()


def _alone(function: Callable[[Item], Result], item: Item) -> Result:
    """In a worker: the result, of the one thread that draws."""
    global _thread
    if _thread is None:
        _thread = ThreadPoolExecutor(1)
    return _thread.submit(function, item).result()
