"""Common parts of the tests of virtual_time: the functions that it replaces, and lines."""

import datetime
import queue
import sched
import subprocess
import threading
import time
from time import monotonic as bound_monotonic

import pytest
import servodrome
from servodrome.virtual_time import virtual_time

def present():
    return (
        time.sleep,
        time.time,
        time.time_ns,
        time.monotonic,
        time.monotonic_ns,
        time.perf_counter,
        time.perf_counter_ns,
        time.localtime,
        time.gmtime,
        time.ctime,
        time.strftime,
        datetime.datetime,
        datetime.date,
        threading.Lock,
        threading.RLock,
        threading.Condition.wait,
        threading.Condition.__enter__,
        threading.Thread.start,
        threading.Thread.join,
        threading.Thread.is_alive,
        queue.SimpleQueue,
        queue.time,
        sched.scheduler.__init__.__defaults__,
        subprocess.Popen.wait,
        bound_monotonic,
    )


ORIGINALS = present()


@pytest.fixture
def small():
    """A line without motion: two drives."""
    with servodrome.Line(axes=[servodrome.Axis("x", "generic402", node=2), servodrome.Axis("z", "jmc_ec")]) as line:
        yield line


@pytest.fixture
def line(small):
    with virtual_time(small):
        yield small
    assert present() == ORIGINALS


def started(function, *arguments, daemon=False, name=None):
    thread = threading.Thread(target=function, args=arguments, daemon=daemon, name=name)
    thread.start()
    return thread
