"""virtual_time: one thread at a time, in the time of a line: the clock, conditions, locks."""
# ruff: noqa: F811 (the fixtures of virtual_fixtures)

import queue
import sched
import threading
import time
from time import monotonic as bound_monotonic

import pytest
import servodrome
from servodrome.virtual_time import real_time, virtual_time
from virtual_fixtures import line, small, started  # noqa: F401


# ---- The clock ----


def test_sleep_is_line_time(line):
    assert (line.now, time.monotonic(), time.perf_counter()) == (0, 0, 0)
    time.sleep(1000)
    assert line.now == time.monotonic() == time.perf_counter() == bound_monotonic() == queue.time() == 1000
    time.sleep(0.0100003)
    assert line.now_ns == time.monotonic_ns() == time.perf_counter_ns() == 1_000_010_000_300
    assert time.time_ns() == 1_767_225_600_000_000_000 + line.now_ns
    assert time.gmtime(time.time())[:6] == (2026, 1, 1, 0, 16, 40)


def test_errors_of_sleep_are_those_of_python(line):
    with pytest.raises(ValueError, match="non-negative"):
        time.sleep(-1)
    with pytest.raises(TypeError):
        time.sleep("1")
    with pytest.raises(ValueError):
        time.sleep(float("nan"))
    assert line.now == 0


def test_other_threads_keep_the_real_clock(small):
    seen = {}
    go, over = threading.Event(), threading.Event()

    def stranger():
        assert go.wait(60)
        seen["clock"] = time.monotonic(), time.time(), time.monotonic()
        time.sleep(0.001)
        seen["lock"] = type(threading.Lock())
        seen["condition"] = threading.Event().wait(0.001)
        thread = threading.Thread(target=lambda: seen.update(inner=time.monotonic()))
        thread.start()
        thread.join(60)
        over.set()

    thread = started(stranger)
    before = time.monotonic(), time.time()
    with virtual_time(small):
        go.set()
        with real_time():
            assert over.wait(60)
        assert small.now == 0
    thread.join()
    assert before[0] <= seen["clock"][0] <= seen["clock"][2] <= seen["inner"] <= time.monotonic()
    assert before[1] <= seen["clock"][1] <= time.time()
    assert seen["lock"] is type(threading.Lock()) and seen["condition"] is False


def test_a_loop_that_only_reads_the_clock_ends(line):
    end = time.monotonic() + 0.01
    readings = 0
    while time.monotonic() < end:
        readings += 1
    assert 0.01 <= line.now <= 0.0101 and readings == pytest.approx(16000, rel=0.02)


@pytest.mark.parametrize("poll", [lambda: time.sleep(0), lambda: threading.Event().wait(0)])
def test_a_loop_that_polls_ends(line, poll):
    done = []
    thread = started(lambda: (time.sleep(0.01), done.append(True)))
    polls = 0
    while not done:
        poll()
        polls += 1
        assert polls < 100_000
    thread.join()


def test_advance_lets_the_others_run(line):
    stamps = []

    def ticker():
        for _ in range(5):
            time.sleep(0.1)
            stamps.append(line.now)

    thread = started(ticker)
    line.advance(0.25)
    assert stamps == pytest.approx([0.1, 0.2]) and line.now == 0.25
    line.run_ticks(1600)
    assert stamps == pytest.approx([0.1, 0.2, 0.3]) and line.now == 0.35
    line.run_until(0.45)
    line.wait_for(lambda: len(stamps) == 5)
    assert line.now == pytest.approx(0.5, abs=0.002)
    with pytest.raises(servodrome.BadValue):
        line.run_until(0.1)
    thread.join()


def test_the_sched_module(line):
    calls = []
    for scheduler in (sched.scheduler(), sched.scheduler(time.time, time.sleep)):
        scheduler.enter(5, 1, lambda: calls.append(line.now))
        scheduler.enter(2, 1, lambda: calls.append(line.now))
        scheduler.run()
    assert calls == pytest.approx([2, 5, 7, 10])


# ---- Order ----


def test_deadlines_come_in_order_and_equal_ones_in_that_of_their_waits(line):
    order = []
    delays = [0.3, 0.1, 0.2, 0.1, 0.1, 0.3]

    def waits(number, delay):
        time.sleep(delay)
        order.append((round(line.now, 9), number))

    threads = [started(waits, number, delay) for number, delay in enumerate(delays)]
    assert order == [] and line.now == 0, "starting a thread does not wait for it"
    for thread in threads:
        thread.join()
    assert order == [(0.1, 1), (0.1, 3), (0.1, 4), (0.2, 2), (0.3, 0), (0.3, 5)]


def test_computing_costs_no_time_and_is_not_interrupted(line):
    shared = []

    def compute(name):
        for _ in range(3):
            for _ in range(20_000):
                shared.append(name)
            time.sleep(0.01)

    threads = [started(compute, name) for name in "ab"]
    for thread in threads:
        thread.join()
    changes = [first for first, second in zip(shared, shared[1:]) if first != second]
    assert "".join(changes) == "ababa" and line.now == pytest.approx(0.03)


# ---- Event, Semaphore and others that use a Condition ----


def test_events(line):
    event = threading.Event()
    assert event.wait(2) is False and line.now == 2
    timer = threading.Timer(3, event.set)
    timer.start()
    assert event.wait(100) is True and line.now == 5
    timer.join()


def test_queues(line):
    for kind in (queue.Queue, queue.LifoQueue, queue.PriorityQueue, queue.SimpleQueue):
        items, begin = kind(), line.now
        with pytest.raises(queue.Empty):
            items.get(timeout=0.5)
        assert line.now == pytest.approx(begin + 0.5)
        thread = started(lambda items=items: [(time.sleep(1), items.put(number)) for number in range(3)])
        assert [items.get() for _ in range(3)] == [0, 1, 2]
        assert line.now == pytest.approx(begin + 3.5)
        thread.join()
    full = queue.Queue(1)
    full.put(1)
    begin = line.now
    with pytest.raises(queue.Full):
        full.put(2, timeout=0.25)
    assert line.now == pytest.approx(begin + 0.25)


def test_semaphores_barriers_conditions_and_reentrant_locks(line):
    semaphore = threading.Semaphore(1)
    assert semaphore.acquire() and not semaphore.acquire(timeout=1) and line.now == 1
    barrier = threading.Barrier(3)
    passed = []

    def party(delay):
        time.sleep(delay)
        barrier.wait()
        passed.append(line.now)

    threads = [started(party, delay) for delay in (1, 2, 3)]
    for thread in threads:
        thread.join()
    assert passed == [4, 4, 4]
    condition = threading.Condition()
    with pytest.raises(RuntimeError, match="un-acquired"):
        condition.wait()
    with condition, condition:  # a reentrant lock, twice
        thread = started(lambda: notify(condition))
        assert condition.wait(10) is True
        assert line.now == 5
    thread.join()
    with condition:
        assert condition.wait_for(lambda: False, timeout=1.5) is False
    assert line.now == 6.5


def notify(condition):
    time.sleep(1)
    with condition:
        condition.notify_all()


def test_objects_that_are_older_than_the_block(small):
    event, items, condition, executed = threading.Event(), queue.Queue(), threading.Condition(), []
    plain = threading.Condition(threading.Lock())

    def holds():
        with condition, plain:
            executed.append(("held", small.now))
            time.sleep(1)

    with virtual_time(small):
        threads = [started(holds), started(lambda: (time.sleep(0.5), event.set(), items.put(7)))]
        assert event.wait() and items.get() == 7
        with condition:
            with plain:
                executed.append(("free", small.now))
                assert not plain.wait(0.5)
            assert not condition.wait(0.5)
        for thread in threads:
            thread.join()
    assert executed == [("held", 0), ("free", 1)] and small.now == pytest.approx(2)


# ---- Locks ----


def test_a_lock_that_is_held_over_a_wait(line):
    lock = threading.Lock()
    order = []

    def user(name, delay):
        time.sleep(delay)
        with lock:
            order.append((name, line.now))
            time.sleep(1)

    threads = [started(user, *arguments) for arguments in (("a", 0.1), ("b", 0.2), ("c", 0.3))]
    time.sleep(0.5)
    assert lock.locked() and not lock.acquire(False) and not lock.acquire(timeout=0.1) and line.now == 0.6
    with lock:
        order.append(("main", line.now))
    assert order == [("a", 0.1), ("b", 1.1), ("c", 2.1), ("main", 3.1)]
    for thread in threads:
        thread.join()
    with pytest.raises(RuntimeError):
        lock.release()
    with pytest.raises(ValueError):
        lock.acquire(False, 1)
    lock.acquire()
    with pytest.raises(ValueError):
        lock.acquire(timeout=-2)


def test_a_lock_is_fair(line):
    lock, count = threading.Lock(), []

    def greedy():
        while not count:
            with lock:
                time.sleep(0.01)

    thread = started(greedy)
    time.sleep(0.005)
    with lock:
        count.append(line.now)
    thread.join()
    assert count == [0.01]


def test_reentrant_locks(line):
    lock = threading.RLock()
    with lock, lock:
        thread = started(lambda: lock.acquire() and lock.release())
        time.sleep(1)
        assert thread.is_alive()
    thread.join()
    with pytest.raises(RuntimeError):
        lock.release()


def test_locks_serve_other_threads_and_live_on(small):
    with virtual_time(small):
        lock, items = threading.Lock(), queue.SimpleQueue()
    counts = []

    def count():
        for _ in range(1000):
            with lock:
                counts.append(len(counts))
        items.put("done")

    threads = [started(count) for _ in range(3)]
    for thread in threads:
        thread.join()
    assert counts == list(range(3000)) and [items.get() for _ in range(3)] == ["done"] * 3
