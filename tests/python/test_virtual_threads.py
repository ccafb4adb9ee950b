"""virtual_time: threads, deadlocks, its begin and its end."""
# ruff: noqa: F811 (the fixtures of virtual_fixtures)

import concurrent.futures
import queue
import subprocess
import sys
import threading
import time
from time import monotonic as bound_monotonic

import pytest
import servodrome
from servodrome.virtual_time import VirtualDeadlock, VirtualTimeEnded, virtual_time
from virtual_fixtures import ORIGINALS, line, present, small, started  # noqa: F401


# ---- Threads ----


def test_join(line):
    thread = started(time.sleep, 3)
    thread.join(1)
    assert thread.is_alive() and line.now == 1
    thread.join()
    assert not thread.is_alive() and line.now == 3
    thread.join()
    with pytest.raises(RuntimeError):
        threading.current_thread().join()
    with pytest.raises(RuntimeError):
        threading.Thread().join()
    with pytest.raises(RuntimeError):
        thread.start()


def test_a_subclass_and_threads_that_start_threads(line):
    ends = []

    class Worker(threading.Thread):
        def __init__(self, depth):
            super().__init__()
            self.depth = depth

        def run(self):
            if self.depth:
                inner = Worker(self.depth - 1)
                inner.start()
                inner.join()
            time.sleep(1)
            ends.append((self.depth, line.now, threading.current_thread() is self))

    worker = Worker(2)
    worker.start()
    worker.join()
    assert ends == [(0, 1, True), (1, 2, True), (2, 3, True)]
    assert "run" not in vars(worker) or worker.run.__func__ is Worker.run


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_an_exception_in_a_thread_is_reported_and_ends_only_that_thread(line, monkeypatch):
    seen = []
    monkeypatch.setattr(threading, "excepthook", lambda arguments: seen.append(arguments.exc_type))
    thread = started(lambda: 1 // 0)
    thread.join()
    assert seen == [ZeroDivisionError]
    time.sleep(1)


def test_a_thread_pool(line):
    with concurrent.futures.ThreadPoolExecutor(3) as pool:
        futures = [pool.submit(lambda delay=delay: (time.sleep(delay), line.now)[1]) for delay in (3, 1, 2, 4)]
        assert futures[1].result() == 1
        done = [future.result() for future in concurrent.futures.as_completed(futures)]
    assert done == [1, 2, 3, 5]
    pool = concurrent.futures.ThreadPoolExecutor(1)  # never shut down; the end of a program would do this
    pool.submit(time.sleep, 1).result()


def test_asyncio(line):
    asyncio = pytest.importorskip("asyncio")
    order = []

    async def task(name, delay):
        await asyncio.sleep(delay)
        order.append((name, round(line.now, 6)))

    async def main():
        loop = asyncio.get_running_loop()
        started(lambda: (time.sleep(0.15), loop.call_soon_threadsafe(order.append, "from a thread")), daemon=True)
        await asyncio.gather(task("b", 0.2), task("a", 0.1))
        await loop.run_in_executor(None, time.sleep, 1)
        with pytest.raises(asyncio.TimeoutError):
            await asyncio.wait_for(asyncio.sleep(60), 2)

    asyncio.run(main())
    assert order == [("a", 0.1), "from a thread", ("b", 0.2)]
    assert line.now == pytest.approx(3.2, abs=0.001)


def test_subprocesses_wait_in_real_time(line):
    run = subprocess.run([sys.executable, "-c", "print(6 * 7)"], capture_output=True, timeout=60, check=True)
    assert run.stdout.split() == [b"42"] and line.now == 0


# ---- Deadlocks ----


def test_a_deadlock_tells_what_every_thread_waits_for(line):
    lock, items = threading.Lock(), queue.Queue()

    def takes_the_lock():
        with lock:
            items.get()

    started(takes_the_lock, daemon=True, name="taker")
    started(lambda: (time.sleep(1), lock.acquire()), daemon=True, name="second")
    with pytest.raises(VirtualDeadlock) as caught:
        threading.Event().wait()
    text = str(caught.value)
    assert "MainThread" in text and "taker" in text and "second" in text
    assert "test_virtual_threads.py" in text and "takes_the_lock" in text
    if sys.version_info >= (3, 11):
        assert "Queue.get" in text and "Lock.acquire" in text and "Event.wait" in text
    assert line.now == 1
    items.put(1)  # the program may continue
    time.sleep(1)
    assert lock.locked()


def test_a_lock_that_its_own_thread_wants_again(line):
    lock = threading.Lock()
    with lock, pytest.raises(VirtualDeadlock):
        lock.acquire()
    assert not lock.locked()


def test_a_lock_of_an_older_condition_is_a_deadlock_too(small):
    condition = threading.Condition(threading.Lock())
    with virtual_time(small):
        with condition, pytest.raises(VirtualDeadlock):
            with condition:
                pass


def test_a_deadlock_of_threads_is_raised_in_the_main_thread_only(small):
    ends = []

    def waits():
        try:
            threading.Event().wait()
        except BaseException as error:
            ends.append(type(error))
            raise

    with pytest.raises(VirtualDeadlock), virtual_time(small):
        thread = started(waits)
        thread.join()
    assert ends == [VirtualTimeEnded] and not thread.is_alive()


def test_a_line_that_is_closed_meanwhile(small):
    with virtual_time(small):
        time.sleep(1)
        small.close()
        assert time.monotonic() == 1
        with pytest.raises(servodrome.Closed):
            time.sleep(1)


# ---- Begin and end ----


def test_everything_is_as_before_after_an_exception(small):
    with pytest.raises(ZeroDivisionError), virtual_time(small):
        assert present() != ORIGINALS
        raise ZeroDivisionError
    assert present() == ORIGINALS
    before = time.monotonic()
    time.sleep(0.001)
    assert time.monotonic() > before and small.now == 0


def test_a_module_that_is_loaded_in_the_block_gets_the_originals_back(small, tmp_path, monkeypatch):
    (tmp_path / "loaded_in_virtual_time.py").write_text(
        "import threading, typing\nfrom time import monotonic, sleep\nfrom threading import Lock\n"
        "class Timeout:\n    clock = monotonic\n    lock: typing.Optional[Lock] = None\n"
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    with virtual_time(small):
        import loaded_in_virtual_time as module

        module.sleep(1)
        assert module.monotonic() == module.Timeout().clock() == small.now == 1
    assert (module.monotonic, module.sleep, module.Lock) == (bound_monotonic, time.sleep, threading.Lock)
    before = bound_monotonic()
    assert before <= module.Timeout().clock() <= bound_monotonic()


def test_nesting(small):
    with virtual_time(small) as outer:
        assert outer is small
        with virtual_time(small) as inner:
            assert inner is small
            thread = started(lambda: nested(small))
            time.sleep(1)
        time.sleep(1)
        thread.join()
        with servodrome.Line(axes=[servodrome.Axis("z", "jmc_ec")]) as other:
            with pytest.raises(servodrome.Refused, match="virtual time is active"):
                virtual_time(other).__enter__()
    assert small.now == 2 and present() == ORIGINALS


def nested(line):
    with virtual_time(line):
        time.sleep(0.5)


def test_a_thread_from_outside_cannot_enter(small):
    go, errors = threading.Event(), []

    def enters():
        assert go.wait(60)
        try:
            with virtual_time(small):
                pass
        except servodrome.Refused as error:
            errors.append(error)

    thread = started(enters)
    with virtual_time(small):
        go.set()
        thread.join()  # in real time
    assert len(errors) == 1


def test_in_a_thread_that_is_not_the_main_one(small):
    seen = []

    def program():
        with virtual_time(small):
            time.sleep(10)
            seen.append(time.monotonic())
        with pytest.raises(VirtualDeadlock), virtual_time(small):
            threading.Event().wait()

    thread = started(program)
    thread.join(60)
    assert seen == [10]


def test_closed_lines_are_refused(small):
    small.close()
    with pytest.raises(servodrome.Closed), virtual_time(small):
        pass
    assert present() == ORIGINALS


def test_the_end_waits_for_threads_that_are_no_daemons_and_ends_the_others(small):
    events = []

    def works():
        time.sleep(5)
        events.append(("done", small.now))

    def for_ever(number, lock):
        try:
            with lock:
                time.sleep(10_000)
        finally:
            events.append((number, small.now))

    with virtual_time(small):
        lock = threading.Lock()
        threads = [started(works), started(for_ever, 1, lock, daemon=True), started(for_ever, 2, lock, daemon=True)]
    assert not any(thread.is_alive() for thread in threads)
    assert events == [("done", 5), (1, 5), (2, 5)]


def test_the_end_with_conditions_stubborn_threads_and_threads_that_never_ran(small):
    events = []

    def waits(condition):
        with condition:
            condition.wait()

    def holds(condition):
        with condition:
            time.sleep(1000)

    def stubborn():
        while len(events) < 3:
            try:
                time.sleep(1000)
            except SystemExit:
                events.append("again")

    with pytest.raises(ZeroDivisionError), virtual_time(small):
        condition = threading.Condition()
        threads = [started(waits, condition), started(holds, condition), started(stubborn)]
        time.sleep(1)
        threads.append(started(events.append, "never"))
        raise ZeroDivisionError
    assert not any(thread.is_alive() for thread in threads) and events == ["again"] * 3
    assert condition._lock.acquire(False), "nobody holds it"


def test_an_exception_by_a_signal_in_the_main_thread(small):
    signal = pytest.importorskip("signal")
    if not hasattr(signal, "setitimer"):
        pytest.skip("the system has no setitimer")

    class Alarm(Exception):
        pass

    def handler(_number, _frame):
        raise Alarm

    def busy():
        while True:
            time.sleep(0.001)

    before = signal.signal(signal.SIGALRM, handler)
    try:
        with pytest.raises(Alarm), virtual_time(small):
            started(busy, daemon=True)
            signal.setitimer(signal.ITIMER_REAL, 0.05)
            threading.Event().wait()  # for ever
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
    assert present() == ORIGINALS


@pytest.mark.skipif(not hasattr(__import__("os"), "fork"), reason="the system has no fork")
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_a_forked_child_has_the_real_clock(line):
    os = __import__("os")
    time.sleep(5)
    child = os.fork()
    if child == 0:
        os._exit(0 if time.time() > 1_767_225_700 and threading.Lock().acquire() else 1)
    assert os.waitpid(child, 0)[1] == 0
    assert line.now == 5


def test_the_end_of_a_program(tmp_path):
    """After an exception, too, nothing prevents the interpreter from ending."""
    text = f"""
import sys, threading, time
sys.path[:0] = {sys.path!r}
import servodrome
from servodrome.virtual_time import virtual_time
with servodrome.Line() as line, virtual_time(line):
    threading.Thread(target=lambda: time.sleep(1e5)).start()
    threading.Thread(target=threading.Event().wait, daemon=True).start()
    time.sleep(1)
    sys.exit(int(line.now) + 6)
"""
    program = tmp_path / "program.py"
    program.write_text(text)
    run = subprocess.run([sys.executable, str(program)], capture_output=True, text=True, timeout=300, check=False)
    assert (run.returncode, run.stdout, run.stderr) == (7, "", "")
