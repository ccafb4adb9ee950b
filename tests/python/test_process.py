"""A line in a process with threads, signals and forks; and the C library itself."""

import gc
import os
import pathlib
import re
import signal
import subprocess
import sys
import threading
import time

import pytest
import servodrome
from conftest import COUNTS, axes

FORK = pytest.mark.skipif(not hasattr(os, "fork"), reason="this system has no fork")


def run_python(code, *arguments, **variables):
    """Runs a program in another Python; returns its output. Fails if the program does not end properly."""
    environment = {"PYTHONPATH": str(pathlib.Path(servodrome.__path__[0]).parent), **os.environ, **variables}
    result = subprocess.run(
        [sys.executable, "-W", "error", "-c", code, *map(str, arguments)],
        capture_output=True,
        text=True,
        env=environment,
        timeout=300,
        check=False,
    )
    assert result.returncode == 0, result.stdout + result.stderr
    assert result.stderr == ""
    return result.stdout


# ---- Threads ----


def test_lines_in_threads_give_the_bits_of_one_thread():
    def positions(found, place):
        with servodrome.Line(axes=axes()) as line:
            x = line.axes["x"]
            x.enable()
            x.velocity(3, units="revolutions")
            with line.record({"p": x.signal("current_a")}, rate=16000) as recording:
                line.advance(0.5)
            found[place] = recording.numpy().tobytes()

    found = {}
    positions(found, "alone")
    threads = [threading.Thread(target=positions, args=(found, place)) for place in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(found) == 5 and set(found.values()) == {found["alone"]}


def test_threads_on_one_line(line):
    """Runs all operations at the same time; the sum of the ticks is exact."""
    errors = []
    rounds = 200

    def repeat(act):
        try:
            for _ in range(rounds):
                act()
        except BaseException as error:
            errors.append(error)

    x = line.axes["x"]
    signals = [axis.signal("velocity_rpm") for axis in line.axes.values()]

    def record():
        with line.record({"v": signals[0]}, rate=16000) as recording:
            line.run_ticks(3)
        assert recording.samples >= 3

    acts = [
        lambda: line.run_ticks(7),
        lambda: line.advance(5 / 16000),
        record,
        lambda: line.read(signals),
        lambda: line.positions(),
        lambda: x.objects["Target position"],
        lambda: x.view(),
        lambda: x.signal("torque_nm"),
        lambda: line.now,
    ]
    threads = [threading.Thread(target=repeat, args=(act,)) for act in acts]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert errors == []
    assert line.now_ns == 15 * rounds * 62_500


def test_threads_that_advance_the_same_line(line):
    """A thread may find that another thread has advanced the line further."""
    errors = []

    def advance(step):
        try:
            end = 3.0
            while line.now < end:
                line.run_until(max(line.now, min(end, line.now + step)))
        except servodrome.BadValue as error:
            if "past" not in str(error):
                errors.append(error)
        except BaseException as error:
            errors.append(error)

    def far():
        try:
            line.advance(3)
        except BaseException as error:
            errors.append(error)

    threads = [threading.Thread(target=advance, args=(step,)) for step in (0.001, 0.1)] + [threading.Thread(target=far)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert errors == []
    assert line.now >= 3


def test_others_get_their_turn_during_a_long_advance(line):
    over = threading.Event()

    def advance():
        line.advance(300)
        over.set()

    thread = threading.Thread(target=advance)
    thread.start()
    seen = set()
    while not over.is_set():
        seen.add(line.now)
    thread.join()
    assert len(seen) > 5  # of about 50 slices


def test_closing_in_another_thread_ends_an_advance(line):
    errors = []

    def advance():
        try:
            line.advance(100_000)
        except servodrome.Error as error:
            errors.append(error)

    thread = threading.Thread(target=advance)
    thread.start()
    while line.now == 0:
        pass
    line.close()
    thread.join()
    assert [type(error) for error in errors] == [servodrome.Closed]


# ---- Signals ----


def interrupt_soon(seconds):
    timer = threading.Timer(seconds, os.kill, (os.getpid(), signal.SIGINT))
    timer.start()
    return timer


def test_ctrl_c_ends_an_advance(line):
    interrupt_soon(0.3)
    with pytest.raises(KeyboardInterrupt):
        line.advance(1e6)  # would take many minutes
    stands = line.now
    assert 0 < stands < 1e6
    line.run_ticks(1)
    assert line.now > stands


def test_ctrl_c_ends_many_ticks(line):
    interrupt_soon(0.3)
    with pytest.raises(KeyboardInterrupt):
        line.run_ticks(2**40)
    assert line.now > 0


def test_ctrl_c_ends_a_job(line, x):
    x.enable()
    interrupt_soon(0.3)
    with pytest.raises(KeyboardInterrupt):
        x.velocity(100_000, acceleration=1, timeout=3600)  # would take some minutes
    line.advance(1)
    assert line.request("GET", "jobs")["jobs"][-1]["state"] == "cancelled"


def test_slices_are_short(line):
    """Python handles a signal between two slices of a long advance."""
    times = []

    def handler(number, frame):
        times.append(time.perf_counter())

    before = signal.signal(signal.SIGALRM, handler)
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.01, 0.01)
        line.advance(100)
        signal.setitimer(signal.ITIMER_REAL, 0)
    finally:
        signal.signal(signal.SIGALRM, before)
    # The median does not depend on pauses of the machine.
    gaps = sorted(after - earlier for earlier, after in zip(times, times[1:]))
    assert gaps[len(gaps) // 2] < 0.1


def test_requests_of_a_signal_handler(line, x):
    """An answer in C is valid until the next request of the thread: a request of a signal handler must not invalidate
    it."""
    seen = []

    def handler(number, frame):
        seen.append(x.view()["product"])

    before = signal.signal(signal.SIGALRM, handler)
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.001, 0.001)
        while len(seen) < 200:
            assert x.objects.read("Statusword", "Target position") == [x.statusword, 0]
            assert line.axes["y"].view()["product"] == "ismc"
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
    assert set(seen) == {"generic402"}


# ---- Forks ----


@FORK
def test_a_forked_child_cannot_use_the_line(line, x):
    signal_of_x = x.signal("velocity_rpm")
    recording = line.record({"v": signal_of_x})
    line.advance(0.1)
    uses = [
        lambda: line.advance(1),
        lambda: line.now,
        lambda: line.run_ticks(1),
        lambda: line.positions(),
        lambda: x.position,
        lambda: x.view(),
        lambda: signal_of_x.value,
        lambda: recording.samples,
        lambda: line.record({"v": signal_of_x}),
    ]
    child = os.fork()
    if child == 0:
        signal.alarm(120)  # a child that waits forever fails the test
        status = 1
        try:
            for use in uses:
                try:
                    use()
                except servodrome.Forked as error:
                    assert "parent" in str(error) and not isinstance(error, servodrome.Closed)
                else:
                    os._exit(2)
            assert line.closed
            line.close()  # no effect
            del line, x, signal_of_x, recording, uses
            gc.collect()
            with servodrome.Line(axes=axes()) as own:
                own.advance(0.1)
                assert own.axes["x"].position == 2 * COUNTS
            try:
                own.now
            except servodrome.Closed:
                status = 0
        finally:
            os._exit(status)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
    line.advance(0.1)
    assert line.now == 0.2
    assert recording.samples == 200


MULTIPROCESSING = """
import multiprocessing, servodrome

def work(seed):
    with servodrome.Line() as line:
        line.advance(seed / 10)
        return line.now

if __name__ == "__main__":
    with servodrome.Line() as line:
        line.advance(1)
        with multiprocessing.get_context("fork").Pool(2) as pool:
            print(pool.map(work, [1, 2, 3]))
        print(line.now)
"""


@FORK
def test_processes_of_multiprocessing():
    assert run_python(MULTIPROCESSING) == "[0.1, 0.2, 0.3]\n1.0\n"


# ---- Memory, and the end of the interpreter ----


def resident_bytes():
    text = pathlib.Path("/proc/self/status").read_text()
    return int(re.search(r"VmRSS:\s+(\d+) kB", text)[1]) * 1024


@pytest.mark.skipif(not os.path.exists("/proc/self/status"), reason="needs /proc")
def test_closed_lines_leave_nothing():
    def one():
        with servodrome.Line(axes=axes()) as line:
            x = line.axes["x"]
            with line.record({"v": x.signal("velocity_rpm")}, rate=16000):
                x.enable()
            line.buses["can0"].record()
            line.advance(0.05)
            len(x.objects)

    def many(count):
        for _ in range(count):
            one()
        gc.collect()
        return resident_bytes()

    def system_threads():
        return len(os.listdir("/proc/self/task"))

    before, threads = many(30), system_threads()
    after = many(200)
    assert after - before < 20_000_000  # 100 kB of each would be kept
    assert system_threads() <= threads  # a line's threads would add up; pytest-xdist has its own threads


def test_a_line_that_is_not_closed_is_collected():
    before = len(gc.get_objects())
    for _ in range(50):
        servodrome.Line(axes=axes()).axes["x"].view()
    gc.collect()
    assert len(gc.get_objects()) - before < 500


def test_the_end_of_the_interpreter():
    code = """
import servodrome, threading
line = servodrome.Line()
line.axes["reference"].enable()
recording = line.record({"v": line.axes["ismc"].signal("velocity_rpm")})
job = line.axes["reference"].velocity(1, units="revolutions", wait=False)
threading.Thread(target=line.advance, args=(1e5,), daemon=True).start()
while line.now < 0.5: pass
print("end")
"""
    assert run_python(code) == "end\n"


# ---- The library ----


def test_a_missing_library():
    code = """
import servodrome
try:
    servodrome.Line()
except servodrome.LibraryError as error:
    assert isinstance(error, ImportError)
    print(error.where, "SERVODROME_LIBRARY" in error.hint)
"""
    assert run_python(code, SERVODROME_LIBRARY="/nowhere/lib.so") == "/nowhere/lib.so True\n"
    assert run_python(code, SERVODROME_LIBRARY=sys.executable).endswith(" True\n")


def test_every_exception_is_an_error():
    for name in set(servodrome.__all__) - {"VirtualTimeEnded"}:  # that exception ends a thread, and is a SystemExit
        thing = getattr(servodrome, name)
        if isinstance(thing, type) and issubclass(thing, BaseException):
            assert issubclass(thing, servodrome.Error), name
    error = servodrome.Error("what", "where", "hint")
    assert (error.what, error.where, error.hint, str(error)) == ("what", "where", "hint", "where: what; hint")
    assert str(servodrome.Error("what")) == "what"
    assert str(servodrome.UnknownName("what", "where")) == "where: what"


def test_the_signatures_are_those_of_the_header():
    header = pathlib.Path(__file__).parents[2] / "src/capi/servodrome.h"
    from servodrome import _library

    text = re.sub(r"/\*.*?\*/", "", header.read_text(), flags=re.DOTALL)
    found = dict(re.findall(r"SERVODROME_API int (servodrome_\w+)\((.*?)\);", text, flags=re.DOTALL))
    del found["servodrome_interface"]
    assert set(found) <= set(_library._SIGNATURES)
    for name, arguments in found.items():
        assert len(arguments.split(",")) == len(_library._SIGNATURES[name]), name
    assert f"SERVODROME_TICK_NS {_library.TICK_NS}" in text
    for number in re.findall(r"SERVODROME_(OK|NOTHING|CLOSED|BAD_\w+|UNKNOWN|REFUSED|FAILED) = (-?\d)", text):
        assert getattr(_library, number[0]) == int(number[1])
