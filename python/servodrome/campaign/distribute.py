"""Distributes the runs of a campaign: to Dask workers, or to this process."""

from __future__ import annotations

import asyncio
import collections
import concurrent.futures
import contextlib
import importlib
import itertools
import logging
import multiprocessing
import signal
import sys
import time
from multiprocessing import resource_tracker
from typing import Any, Callable, Deque, Dict, Iterable, Iterator, List, Optional, Sequence

from ..errors import MissingPackage
from .plan import Plan
from .store import Store
from .work import execute_batch, row_of

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

    A worker that dies loses the runs that it was given, and others get them; a run whose process dies again and again is an
    error. If the scheduler disappears, this waits for it and goes on with the runs that are missing.
    """
    try:
        distributed = importlib.import_module("distributed")
    except ImportError as error:
        raise MissingPackage("distributed is not installed", "campaign", "pip install servodrome[campaign]") from error
    counter = Counter(plan, store, progress)
    if len(counter.done) >= plan.size:
        return
    if not scheduler:
        # The main thread only waits: Ctrl-C in a callback of the garbage collector, as Dask has one, would have no effect.
        with concurrent.futures.ThreadPoolExecutor(1) as feeder:
            with _local_cluster(distributed, workers) as cluster, distributed.Client(cluster) as client:
                try:
                    feeder.submit(_feed, distributed, client, counter, batch).result()
                except KeyboardInterrupt:
                    logging.disable(logging.CRITICAL)  # Dask logs what it cannot send any more
                    for process in multiprocessing.active_children():
                        process.kill()  # the workers: Dask waits some seconds for the end of their runs
                    raise
        return
    while len(counter.done) < plan.size:
        try:
            client = distributed.Client(scheduler, timeout="5s")
        except (OSError, TimeoutError) as error:
            _wait_for_scheduler(error)
            continue
        try:
            _feed(distributed, client, counter, batch)
        except (_Lost, distributed.comm.CommClosedError) as error:
            _wait_for_scheduler(error)
        finally:
            with contextlib.suppress(OSError, TimeoutError):
                client.close()


def _local_cluster(distributed: Any, workers: int) -> Any:
    """A cluster of processes that do not get Ctrl-C: the command ends them. Without logs: errors of tasks are exceptions here."""
    resource_tracker.ensure_running()  # its start would unblock the signal
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # Dask's thread, which starts the processes, inherits this
    try:
        return distributed.LocalCluster(
            n_workers=workers, threads_per_worker=1, dashboard_address="127.0.0.1:0", silence_logs=logging.CRITICAL
        )
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _wait_for_scheduler(error: Exception) -> None:
    print(f"campaign: the scheduler is lost ({error}); trying again", file=sys.stderr)
    time.sleep(_RECONNECT_S)


class _Lost(Exception):
    """The scheduler is gone, or has forgotten a batch."""


def _lost_row(plan: Plan, number: int) -> Dict[str, Any]:
    row = row_of(plan.run(number))
    row.update(outcome="error", error="the process of the run died each time that it was tried", line_time_s=0.0)
    return row


def _feed(distributed: Any, client: Any, counter: Counter, batch: int) -> None:
    """Keeps some batches in flight for each worker (backpressure) until no run is missing.

    Dask gives up a batch after several deaths of its workers, also if it only waited there. So the runs of such a batch are tried at the
    end, one at a time: a run that is given up then has killed its workers itself. Errors of the task and of the store are raised.
    """
    waiting = collections.deque(batches(list(counter.missing()), batch))
    doubtful: Deque[int] = collections.deque()
    flight = max(len(client.scheduler_info()["workers"]), 1) * _IN_FLIGHT
    flying: Dict[str, List[int]] = {}
    done = distributed.as_completed()

    def submit(numbers: List[int]) -> None:
        future = client.submit(execute_batch, counter.plan, numbers, pure=False)
        flying[future.key] = numbers
        done.add(future)

    def fill() -> bool:
        """Returns True if the next run to end is alone in flight."""
        while waiting and len(flying) < flight:
            submit(waiting.popleft())
        if flying or not doubtful:
            return False
        submit([doubtful.popleft()])
        return True

    is_alone = fill()
    for future in done:
        numbers = flying.pop(future.key)
        rows: List[Dict[str, Any]] = []
        try:
            rows = future.result()
        except (asyncio.CancelledError, concurrent.futures.CancelledError) as error:
            raise _Lost("a batch was cancelled") from error
        except distributed.KilledWorker:
            if is_alone:
                rows = [_lost_row(counter.plan, numbers[0])]
            else:
                doubtful.extend(numbers)
        finally:
            future.release()
        counter.take(rows)
        is_alone = fill()
