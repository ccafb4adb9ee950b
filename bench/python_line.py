#!/usr/bin/env python3
"""Measures the cost of the Python package: ticks that are advanced by one call each, compared with the same ticks in
one call; reading the positions of 64 axes; and a canopen master in the process that polls the default line.

    bench/python_line.py [BUILD_DIRECTORY]

The baseline is the line in C++, run_ticks(N): its ticks are the same as in bench/tick_bench, with drives that are
switched on and not enabled. Figures are processor time of this thread, the fastest of several runs.
"""

import os
import pathlib
import sys
import time

ROOT = pathlib.Path(__file__).resolve().parents[1]
BUILD = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else ROOT / "build/release").resolve()
os.environ.setdefault("SERVODROME_LIBRARY", str(BUILD / "src/capi/libservodrome.so"))
sys.path.append(str(ROOT / "python"))

import canopen  # noqa: E402
import servodrome  # noqa: E402
import servodrome.can_bus  # noqa: E402, F401  (registers the interface of python-can)

TICK_S = 62.5e-6


def quickest_ns(calls, act):
    """Returns the nanoseconds of one call of `act`."""
    best = float("inf")
    for _ in range(7):
        start = time.thread_time_ns()
        for _ in range(calls):
            act()
        best = min(best, (time.thread_time_ns() - start) / calls)
    return best


def real_s():
    """The time of the machine's clock, also inside virtual_time()."""
    with servodrome.real_time():
        return time.monotonic()


def main():
    with servodrome.Line(axes=[servodrome.Axis("x", "generic402", node=2)]) as line:
        line.advance(0.1)
        in_cpp = quickest_ns(5, lambda: line.run_ticks(100_000)) / 100_000
        for name, act in (("run_ticks(1)", lambda: line.run_ticks(1)), ("advance(62.5e-6)", lambda: line.advance(TICK_S))):
            each = quickest_ns(50_000, act)
            print(f"{name:34} {each:7.0f} ns a tick   {each - in_cpp:6.0f} ns above the {in_cpp:.0f} ns in C++ (limit 1000)")
        x = line.axes["x"]
        print(f"{'axis.position':34} {quickest_ns(50_000, lambda: x.position):7.0f} ns")
    axes = [servodrome.Axis(f"a{n}", "jmc_ec") for n in range(64)]
    with servodrome.Line(axes=axes) as line:
        each = quickest_ns(20_000, line.positions)
        print(f"{'positions() of 64 axes, numpy':34} {each:7.0f} ns                (limit 20000)")

    seconds = 1000
    with servodrome.Line() as line:
        start = time.monotonic()
        line.run_until(seconds)
        alone_s = time.monotonic() - start
    with servodrome.Line() as line, line.virtual_time():
        network = canopen.Network()
        network.connect(interface="servodrome", channel="can0")
        start = real_s()
        polls = 0
        node = network.add_node(2, canopen.ObjectDictionary())
        while line.now < seconds:
            node.sdo.upload(0x6041, 0)
            polls += 1
            time.sleep(0.01)
        polled_s = real_s() - start
        network.disconnect()
    print(f"{seconds} s of the default line: {alone_s:.1f} s alone, {polled_s:.1f} s with {polls} SDO uploads of canopen (limit 20 s)")


main()
