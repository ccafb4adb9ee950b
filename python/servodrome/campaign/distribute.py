"""Distributes the runs of a campaign: to Dask workers, or to this process."""

from __future__ import annotations

import asyncio
import concurrent.futures
import importlib
import itertools
import sys
import time
from typing import Any, Callable, Iterable, Iterator, List, Optional, Sequence

from ..errors import MissingPackage
from .plan import Plan
from .store import Store
from .work import execute_batch

_BATCH = 25
_IN_FLIGHT = 3  # batches for each worker
_RECONNECT_S = 1.0

Progress = Callable[[int, int, int], None]
"""Called with the runs done, all runs, and the runs that failed."""


def batches(numbers: Iterable[int], size: int) -> Iterator[List[int]]:
    """Lists of at most `size` numbers."""
    rest = iter(numbers)
    while batch := list(itertools.islice(rest, size)):
        yield batch


class Counter:
    """Stores rows and counts them."""

    def __init__(self, plan: Plan, store: Store, progress: Optional[Progress]) -> None:
        self.plan, self.store, self.progress = plan, store, progress
        self.done = store.done()
        self.failed = 0

    def missing(self) -> Iterator[int]:
        """The runs that are not in the store, in order."""
        return (number for number in range(self.plan.size) if number not in self.done)

    def take(self, rows: Sequence[Any]) -> None:
        """Stores the rows of runs that are not stored yet."""
        new = [row for row in rows if row["run"] not in self.done]
        if not new:
            return
        self.store.add(new)
        self.done.update(row["run"] for row in new)
        self.failed += sum(row["outcome"] in ("failed", "error") for row in new)
        if self.progress is not None:
            self.progress(len(self.done), self.plan.size, self.failed)


def run_here(plan: Plan, store: Store, progress: Optional[Progress] = None, batch: int = _BATCH) -> None:
    """Carries out the missing runs in this process."""
    counter = Counter(plan, store, progress)
    for numbers in batches(list(counter.missing()), batch):
        counter.take(execute_batch(plan, numbers))


def run_on_dask(
    plan: Plan,
    store: Store,
    workers: int = 2,
    scheduler: str = "",
    progress: Optional[Progress] = None,
    batch: int = _BATCH,
) -> None:
    """Carries out the missing runs on a local cluster of `workers` processes, or on the cluster at `scheduler`.

    A worker that dies loses the runs that it was given, and others get them. If the scheduler disappears, this waits for
    it and goes on with the runs that are missing.
    """
    try:
        distributed = importlib.import_module("distributed")
    except ImportError as error:
        raise MissingPackage("distributed is not installed", "campaign", "pip install servodrome[campaign]") from error
    counter = Counter(plan, store, progress)
    if len(counter.done) >= plan.size:
        return
    if not scheduler:
        with distributed.LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address=None) as cluster:
            with distributed.Client(cluster) as client:
                _feed(distributed, client, counter, batch)
        return
    while len(counter.done) < plan.size:
        try:
            with distributed.Client(scheduler, timeout="5s") as client:
                _feed(distributed, client, counter, batch)
        except (OSError, TimeoutError, _Lost) as error:
            print(f"campaign: the scheduler is lost ({error}); trying again", file=sys.stderr)
            time.sleep(_RECONNECT_S)


class _Lost(Exception):
    """The scheduler has forgotten a batch."""


def _feed(distributed: Any, client: Any, counter: Counter, batch: int) -> None:
    """Keeps some batches in flight for each worker (backpressure) until no run is missing."""
    waiting = batches(list(counter.missing()), batch)
    retries = 20  # of a batch whose worker dies

    def submit() -> Any:
        numbers = next(waiting, None)
        if numbers is None:
            return None
        return client.submit(execute_batch, counter.plan, numbers, pure=False, retries=retries)

    flight = max(len(client.scheduler_info()["workers"]), 1) * _IN_FLIGHT
    begun = [future for future in (submit() for _ in range(flight)) if future is not None]
    done = distributed.as_completed(begun)
    for future in done:
        try:
            counter.take(future.result())
        except (asyncio.CancelledError, concurrent.futures.CancelledError) as error:
            raise _Lost("a batch was cancelled") from error
        except distributed.KilledWorker as error:
            raise _Lost("workers died") from error
        finally:
            future.release()
        following = submit()
        if following is not None:
            done.add(following)
