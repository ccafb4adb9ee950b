#!/usr/bin/env python3
"""Makes random sequences of calls of the Python package, some with wrong arguments: none may crash the interpreter.

    fuzz/python_calls.py [--sequences N] [--seed N] [--first N] [--calls N] [--jobs N]
    fuzz/python_calls.py --lines N

Each sequence opens a line and calls functions of the package, with valid and with invalid values: wrong types, NaN,
closed lines, unknown names, times in the past. A call returns, or raises an exception that its documentation names.
Line time never goes back, and a refused call does not advance it. A process that dies, or another exception, is a
finding: its sequence is printed, and `--first N --sequences 1 --verbose` repeats it.

`--lines N` makes N lines instead, one after the other, some of them in four threads, runs each for a short time and
drops it. The memory of the process after the last line may be at most 8 MB more than after a tenth of the lines.

SERVODROME_LIBRARY is the C library. Exit status: 0 nothing found, 1 something found.
"""

from __future__ import annotations

import argparse
import gc
import logging
import math
import multiprocessing
import os
import pathlib
import random
import sys
import threading
import time
from typing import Any, Callable, Dict, List, Optional

ROOT = pathlib.Path(__file__).resolve().parents[1]
sys.path.append(str(ROOT / "python"))

import servodrome  # noqa: E402

if not (pathlib.Path(servodrome.__file__).parent / "_lib").exists():
    os.environ.setdefault("SERVODROME_LIBRARY", str(ROOT / "build/release/src/capi/libservodrome.so"))

try:
    import can
    import servodrome.can_bus  # noqa: F401
except ImportError:
    can = None  # type: ignore[assignment]
try:
    import serial
    import servodrome.serial_port
except (ImportError, servodrome.MissingPackage):
    serial = None  # type: ignore[assignment]

logging.disable(logging.CRITICAL)  # python-can warns about each bus that the garbage collector deletes
PRODUCTS = ("generic402", "generic402-ec", "ismc", "ismk", "ismk-ea", "pronet", "jmc_ec")
SIGNALS = ("position_counts", "velocity_rpm", "torque_nm", "current_a", "supply_v", "DI0", "6041:00", "606C:00", "nothing", "")
OBJECTS: List[Any] = [0x6040, 0x6060, 0x607A, 0x60FF, 0x6041, 0x6064, (0x607D, 1), (0x607D, 9), "6081", "607D:02", 0x1018,
                      "Target position", "no such object", 0x100C, 0x1010, (0x1010, 1), 0x5FFF, -1, 0x10000, (1, 2, 3), None]
VALUES: List[Any] = [0, 1, -1, 6, 7, 15, 31, 47, 128, 1000, 2**31 - 1, -(2**31), 2**31, 2**64, 2**80, -(2**80), 0.5, 1e300, -0.0,
                     float("nan"), float("inf"), True, False, None, "", "text", "\ud800", b"", b"\0\1", b"x" * 3000, [], {}, (), object()]
DURATIONS: List[Any] = [0.0, 1e-9, 62.5e-6, 0.001, 0.01, 0.05, 0.1, 1, True, -1.0, -1e-12, float("nan"), float("inf"), 1e300, "1", None,
                        [], 2**70]
FAULTS: List[Any] = ["encoder_loss", "open_phase_u", "supply_loss", "brake_stuck", "nothing", "", 0x7380, 0x8611, 0, -1, 2**40, None, 1.5]
JOBS = ("enable", "disable", "stop", "quick_stop", "reset_fault", "home", "move", "velocity", "torque", "jog", "sweep", "nothing", "")
PLANT = ("load_torque_nm", "load_inertia_kgm2", "friction_nm", "supply_v", "ambient_c", "position_counts", "locked_rotor")
PATHS = ("axes", "axes/x", "axes/x/geometry", "buses", "clock", "nothing", "", "/", "axes/%zz", "axes/x/objects?x=\0", "a" * 5000, "\u00e4")

# The exceptions that the documentation names: the package's own, and those of the interfaces that it implements.
EXPECTED: Any = (servodrome.Error,)
if can is not None:
    EXPECTED += (can.CanError, can.CanInitializationError)
if serial is not None:
    EXPECTED += (serial.SerialException,)


class Sequence:
    """One sequence: its random numbers, its line, and the objects that it has opened."""

    def __init__(self, number: int, seed: int, verbose: bool) -> None:
        self.random = random.Random(f"{seed}:{number}")
        self.verbose = verbose
        self.line: Optional[servodrome.Line] = None
        self.other: Optional[servodrome.Line] = None
        self.opened: List[Any] = []
        self.told: List[str] = []
        self.last_ns = 0

    def pick(self, values: Any) -> Any:
        return self.random.choice(values)

    def some(self, *values: Any) -> Any:
        """Returns a value that is mostly valid."""
        return self.pick(values) if self.random.random() < 0.7 else self.pick(VALUES)

    def time(self, *values: Any) -> Any:
        """Returns a time or a number of ticks, mostly valid, and short enough that a sequence does not take minutes."""
        return self.pick(values) if self.random.random() < 0.7 else self.pick(DURATIONS)

    # ---- Calls ----

    def open_line(self) -> servodrome.Line:
        draw = self.random.random()
        if draw < 0.1:
            return servodrome.Line()
        if draw < 0.2:
            text = self.pick(["", "[[axis]]", "[[axis]]\nname = 1", "[[axis]]\nname = 'x'\nproduct = 'jmc_ec'\n", "\0", "[" * 500, "a = 1",
                              "[[axis]]\nname='x'\nproduct='jmc_ec'\nbus='q'", "\ud800", 7])
            return servodrome.Line.from_text(text)
        count = self.random.randint(1, 3)
        axes = [servodrome.Axis(self.some("x", "y", "z"), self.some(*PRODUCTS)) for _ in range(count)]
        if self.random.random() < 0.7:
            axes = [servodrome.Axis(name, self.pick(PRODUCTS)) for name in ("x", "y", "z")[:count]]
        return servodrome.Line(axes=axes)

    def axis(self) -> servodrome.LiveAxis:
        line = self.line
        assert line is not None
        names = list(line.axes)
        return line.axes[self.some(*names, "nothing")]

    def bus(self) -> servodrome.LiveBus:
        line = self.line
        assert line is not None
        return line.buses[self.some(*line.buses, "nothing")]

    def calls(self) -> Dict[str, Callable[[], Any]]:
        line = self.line
        assert line is not None
        return {
            "advance": lambda: line.advance(self.pick(DURATIONS)),
            "advance a little": lambda: line.advance(self.random.random() * 0.02),
            "run_until": lambda: line.run_until(self.time(line.now, line.now + 0.01, line.now - 0.01, 0)),
            "run_ticks": lambda: line.run_ticks(self.time(0, 1, 16, 160)),
            "wait_for": lambda: line.wait_for(lambda: self.random.random() < 0.2, self.time(0.01, 0.1, 0)),
            "read object": lambda: self.axis().objects[self.pick(OBJECTS)],
            "write object": lambda: self.axis().objects.__setitem__(self.pick(OBJECTS), self.pick(VALUES)),
            "read objects": lambda: self.axis().objects.read(*[self.pick(OBJECTS) for _ in range(self.random.randint(0, 4))]),
            "object info": lambda: self.axis().objects.info(self.pick(OBJECTS)),
            "view": lambda: self.axis().view(),
            "state": lambda: self.axis().state,
            "position": lambda: self.axis().position,
            "positions": lambda: line.positions(),
            "input": lambda: self.axis().inputs.__setitem__(self.some("DI0", "DI1", "nothing"), self.some(True, False)),
            "inputs": lambda: dict(self.axis().inputs),
            "release": lambda: self.axis().inputs.release(*self.pick([(), ("DI0",), ("nothing",), (7,)])),
            "plant": lambda: setattr(self.axis().plant, self.pick(PLANT), self.some(0, 0.1, 1e-4, True, 310)),
            "plant view": lambda: self.axis().plant.view(),
            "inject": lambda: self.axis().inject(self.pick(FAULTS)),
            "remove": lambda: self.axis().remove(*self.pick([(), ("encoder_loss",), (0x7380,), (None,)])),
            "power": lambda: self.axis().power(self.some("on", "off", "cycle")),
            "job": lambda: self.axis().job(self.pick(JOBS), wait=False, to=self.some(None, 100), velocity=self.some(None, 100)),
            "job to its end": lambda: self.axis().job(self.pick(JOBS), timeout=self.time(0.2, 0)),
            "stop_all": lambda: line.stop_all(),
            "signal": lambda: line.read([self.axis().signal(self.pick(SIGNALS))]),
            "signal of another line": lambda: line.read([(self.other or line).axes["x"].signal("torque_nm")]),
            "record": lambda: self.opened.append(line.record({"v": self.axis().signal(self.pick(SIGNALS))}, self.some(1000, 16000, 4000, 7))),
            "recorded": lambda: [one.numpy() for one in self.opened if isinstance(one, servodrome.Recording)],
            "close something": lambda: self.close_one(),
            "disturb": lambda: self.bus().disturb(drop=self.some(0.0, 0.5, 1.0, 2.0), cut=self.some(None, True), seed=self.some(None, 1)),
            "calm": lambda: self.bus().calm(),
            "traffic": lambda: (self.bus().record(self.some(True, False)), self.bus().traffic.rows(), self.bus().capture(self.some("pcap", "candump"))),
            "links": lambda: self.bus().link,
            "ethercat": lambda: self.opened.append(line.ethercat(self.some(*line.buses), self.some(True, False))),
            "can": self.open_can,
            "serial": self.open_serial,
            "send": self.send,
            "receive": self.receive,
            "request": lambda: line.request(self.some("GET", "PUT", "POST", "DELETE", "", "\0"), self.pick(PATHS), self.pick([None, {}, {"a": 1}, {"x": math.nan}])),
            "virtual_time": self.virtual_time,
            "close": lambda: line.close() if self.random.random() < 0.1 else None,
            "collect": lambda: gc.collect(0),
            "fork": self.fork,
        }

    def open_can(self) -> None:
        if can is not None:
            self.opened.append(can.Bus(interface="servodrome", channel=self.some(*self.line.buses), line=self.line))  # type: ignore[union-attr]

    def open_serial(self) -> None:
        if serial is not None:
            port = servodrome.serial_port.SerialPort(line=self.line, timeout=self.pick([0, 0.01]))
            port.port = f"servodrome://{self.pick([*self.line.buses, 'nothing'])}"  # type: ignore[union-attr]
            port.baudrate = self.pick([115200, 9600, 300])
            port.open()
            self.opened.append(port)

    def close_one(self) -> None:
        if self.opened:
            one = self.opened.pop(self.random.randrange(len(self.opened)))
            close = getattr(one, "shutdown", None) or getattr(one, "stop", None) or one.close
            close()
            close()

    def send(self) -> None:
        for one in self.opened:
            if isinstance(one, servodrome.EthercatPort):
                one.send(self.pick([b"", b"\0" * 14, b"\xff" * 60, bytes(self.random.randrange(256) for _ in range(64)), b"x" * 1514, b"x" * 1515, None]))
            elif can is not None and isinstance(one, can.BusABC):
                data = bytes(self.random.randrange(256) for _ in range(self.random.randint(0, 8)))
                one.send(can.Message(arbitration_id=self.pick([0, 0x80, 0x181, 0x601, 0x602, 0x7FF]), is_extended_id=False, data=data))
            elif serial is not None and isinstance(one, serial.SerialBase):
                one.write(bytes(self.random.randrange(256) for _ in range(self.random.randint(0, 40))))

    def receive(self) -> None:
        for one in self.opened:
            if isinstance(one, servodrome.EthercatPort):
                one.receive(self.pick([0, 0.001]))
            elif can is not None and isinstance(one, can.BusABC):
                one.recv(self.pick([0, 0.001, 0.01]))
            elif serial is not None and isinstance(one, serial.SerialBase):
                one.read(self.pick([1, 100]))

    def virtual_time(self) -> None:
        assert self.line is not None
        with self.line.virtual_time():
            time.sleep(self.pick([0, 0.001, 0.02]))
            if self.random.random() < 0.2:
                self.line.close()
                time.sleep(0.001)

    def fork(self) -> None:
        """A child process must not use the line, and must not change the parent's line when it ends."""
        if self.random.random() > 0.05:
            return
        child = os.fork()
        if child == 0:
            result = 1
            try:
                self.line.advance(0.001)  # type: ignore[union-attr]
            except (servodrome.Forked, servodrome.Closed):
                result = 0
            finally:
                os._exit(result)
        _, status = os.waitpid(child, 0)
        if status != 0:
            raise AssertionError(f"a forked child ended with status {status}")

    # ---- The sequence ----

    def run(self, calls: int) -> None:
        try:
            self.line = self.open_line()
        except EXPECTED:
            self.line = servodrome.Line(axes=[servodrome.Axis("x", self.pick(PRODUCTS))])
        if self.random.random() < 0.1:
            self.other = servodrome.Line(axes=[servodrome.Axis("x", "generic402")])
        try:
            offered = self.calls()
            names = sorted(offered)
            for _ in range(self.random.randint(1, calls)):
                self.call(self.pick(names), offered)
        finally:
            opened, self.opened = self.opened, []
            if self.random.random() < 0.5:  # otherwise the garbage collector deletes all objects
                for one in opened:
                    (getattr(one, "shutdown", None) or getattr(one, "stop", None) or one.close)()
                self.line.close()
            if self.other is not None:
                self.other.close()

    def call(self, name: str, offered: Dict[str, Callable[[], Any]]) -> None:
        assert self.line is not None
        self.told.append(name)
        if self.verbose:
            print("  ", name, flush=True)
        refused = False
        try:
            offered[name]()
        except EXPECTED as error:
            refused = not isinstance(error, (servodrome.Timeout, servodrome.JobTimeout, servodrome.JobFailed))
            str(error), repr(error)
        if self.line.closed:
            return
        now = self.line.now_ns
        if now < self.last_ns:
            raise AssertionError(f"line time goes back: {self.last_ns} to {now} ns")
        if refused and name in ("advance", "run_until", "run_ticks", "write object", "plant") and now != self.last_ns:
            raise AssertionError(f"{name} is refused, and time passes")
        self.last_ns = now


def run_some(first: int, count: int, seed: int, calls: int, verbose: bool, place: Any) -> None:
    """Runs in its own process; `place` shows which sequence runs."""
    for number in range(first, first + count):
        place.value = number
        sequence = Sequence(number, seed, verbose)
        try:
            sequence.run(calls)
        except BaseException as error:
            print(f"sequence {number}: {type(error).__name__}: {error}\n   after {', '.join(sequence.told)}", flush=True)
            if verbose:
                raise
            os._exit(3)
    os._exit(0)


def resident_mb() -> float:
    with open("/proc/self/statm", encoding="ascii") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6


def make_and_drop(count: int) -> None:
    for number in range(count):
        line = servodrome.Line(axes=[servodrome.Axis("x", PRODUCTS[number % len(PRODUCTS)])])
        line.advance(0.002)
        recording = line.record({"v": line.axes["x"].signal("velocity_rpm")}, 16000)
        line.advance(0.001)
        assert recording.samples == 16
        if number % 2:
            line.close()


def lines(count: int) -> int:
    """Makes and drops lines. Returns the exit status."""
    start = time.monotonic()
    make_and_drop(count // 10)
    before = resident_mb()
    make_and_drop(count // 2 - count // 10)
    threads = [threading.Thread(target=make_and_drop, args=((count - count // 2) // 4,)) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    gc.collect()
    after = resident_mb()
    print(f"{count} lines in {time.monotonic() - start:.0f} s: {before:.1f} MB after a tenth of them, {after:.1f} MB at the end")
    return 1 if after > before + 8 else 0


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sequences", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--calls", type=int, default=40, help="the most calls of a sequence")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--verbose", action="store_true", help="prints each call before it is made")
    parser.add_argument("--lines", type=int, default=0, metavar="N", help="makes and drops N lines instead")
    given = parser.parse_args()
    if given.lines:
        return lines(given.lines)
    context = multiprocessing.get_context("spawn")
    if given.verbose:
        run_some(given.first, given.sequences, given.seed, given.calls, True, context.Value("q"))
    start = time.monotonic()
    piece = 200  # sequences per process, so that leaks do not add up over the whole run
    work = [(number, min(piece, given.first + given.sequences - number))
            for number in range(given.first, given.first + given.sequences, piece)]
    running: Dict[Any, Any] = {}
    found = 0
    done = 0
    while work or running:
        while work and len(running) < given.jobs:
            first, count = work.pop(0)
            place = context.Value("q", first)
            process = context.Process(target=run_some, args=(first, count, given.seed, given.calls, False, place))
            process.start()
            running[process.sentinel] = process, place, first, count
        for sentinel in multiprocessing.connection.wait(list(running)):
            process, place, first, count = running.pop(sentinel)
            process.join()
            if process.exitcode == 0:
                done += count
                continue
            found += 1
            if process.exitcode != 3:
                print(f"sequence {place.value}: the process ended with {process.exitcode}", flush=True)
            rest = first + count - place.value - 1
            done += count - rest
            if rest > 0 and found < 20:
                work.insert(0, (place.value + 1, rest))
    seconds = time.monotonic() - start
    print(f"{done} sequences of seed {given.seed} in {seconds:.0f} s: {found} findings")
    return 1 if found else 0


if __name__ == "__main__":
    import multiprocessing.connection

    sys.exit(main())
