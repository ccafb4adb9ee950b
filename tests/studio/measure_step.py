#!/usr/bin/env python3
"""Measures an axis on its bus, as another maker's master would, and compares it with the report of its commissioning.

On CAN the master is python-can with the package canopen, on EtherCAT it is pysoem. The line is in virtual time: this
program lets the time pass, a fraction of a millisecond at a time, so the figures do not depend on the computer. It commands the move and the velocity step of the report and measures both by 6064h and 606Ch.

    measure_step.py REPORT.html --api URL --can HOST:PORT/CHANNEL --node 2
    measure_step.py REPORT.html --api URL --ethercat INTERFACE
"""

import argparse
import http.client
import json
import pathlib
import re
import struct
import sys
import time
import urllib.parse

SETTLED = 0.02  # of the way, as in the report
PATIENCE_S = 60
SIZES = {0x6040: "H", 0x6041: "H", 0x6060: "b", 0x6061: "b", 0x6064: "i", 0x606C: "i", 0x607A: "i", 0x6081: "I", 0x6083: "I", 0x6084: "I", 0x60FF: "i", 0x6502: "I"}


class CanDrive:
    """Sets up by the package canopen while the line's time runs; samples by python-can in steps of the line's time."""

    step_ms = 0.5  # from a request to the next; its answer has the exact time of its frame

    def __init__(self, address, node, clock):
        import canopen

        host, port, channel = re.match(r"([\d.]+):(\d+)/(\w+)", address).groups()
        self.network = canopen.Network()
        self.network.connect(interface="socketcand", host=host, port=int(port), channel=channel)
        self.sdo = self.network.add_node(node, canopen.ObjectDictionary()).sdo
        self.sdo.RESPONSE_TIMEOUT = PATIENCE_S
        self.node = node
        self.clock = clock

    def read(self, index):
        data = self.sdo.upload(index, 0)
        return struct.unpack("<" + SIZES[index], data[: struct.calcsize(SIZES[index])])[0]

    def write(self, index, value):
        self.sdo.download(index, 0, struct.pack("<" + SIZES[index], value))

    def begin_sampling(self):
        """canopen's thread would take the answers: from here on the frames are ours."""
        self.network.notifier.stop()
        while self.network.bus.recv(0.2):
            pass

    def ask(self, index):
        self.send(bytes([0x40, index & 0xFF, index >> 8, 0, 0, 0, 0, 0]))
        answer, at = self.answer()
        return struct.unpack("<" + SIZES[index], answer[4 : 4 + struct.calcsize(SIZES[index])])[0], at

    def tell(self, index, value):
        data = struct.pack("<" + SIZES[index], value)
        self.send(bytes([0x23 | (4 - len(data)) << 2, index & 0xFF, index >> 8, 0]) + data.ljust(4, b"\0"))
        answer, _ = self.answer()
        assert answer[0] == 0x60, f"{index:04X}h: {answer.hex(' ')}"

    def send(self, data):
        import can

        self.network.bus.send(can.Message(arbitration_id=0x600 + self.node, data=data, is_extended_id=False))

    def answer(self):
        """The answer and the line's time of its frame. The frames of an advance are in the socket when it is over."""
        deadline = time.monotonic() + PATIENCE_S
        while time.monotonic() < deadline:
            self.clock.advance(self.step_ms)
            while message := self.network.bus.recv(0):
                if message.arbitration_id == 0x580 + self.node:
                    return bytes(message.data), message.timestamp
        raise AssertionError("no answer of the drive")

    def close(self):
        self.network.disconnect()


class EtherCatDrive:
    """pysoem: the slave in Pre-Operational, and SDOs by CoE. The mailbox answers while the line's time stands.

    pysoem waits 2 ms for a frame, and a busy computer can be later. A start with lost frames would leave a mailbox that
    is set up wrong, so it gets longer timeouts; later accesses are repeated until they succeed.
    """

    step_ms = 0.5

    def __init__(self, interface, clock):
        import pysoem

        timeouts_us = pysoem.settings.timeouts
        timeouts_us.ret = 200_000
        timeouts_us.safe = timeouts_us.eeprom = timeouts_us.tx_mailbox = timeouts_us.rx_mailbox = timeouts_us.state = 5_000_000
        self.clock = clock
        self.errors = (pysoem.WkcError, pysoem.PacketError, pysoem.MailboxError)
        self.master = pysoem.Master()
        self.master.open(interface)
        wait(lambda: self.master.config_init() == 1 and self.master.state_check(pysoem.PREOP_STATE, 1_000_000) == pysoem.PREOP_STATE, "Pre-Operational")
        [self.slave] = self.master.slaves

    def patiently(self, access):
        deadline = time.monotonic() + PATIENCE_S
        while True:
            try:
                return access()
            except self.errors:
                if time.monotonic() > deadline:
                    raise

    def ask(self, index):
        self.clock.advance(self.step_ms)
        data = self.patiently(lambda: self.slave.sdo_read(index, 0, struct.calcsize(SIZES[index])))
        return struct.unpack("<" + SIZES[index], data)[0], self.clock.now_s()

    def tell(self, index, value):
        self.patiently(lambda: self.slave.sdo_write(index, 0, struct.pack("<" + SIZES[index], value)))

    def read(self, index):
        return self.ask(index)[0]

    write = tell

    def begin_sampling(self):
        pass

    def close(self):
        self.master.close()


class Clock:
    """The line's virtual time, over one connection."""

    def __init__(self, api):
        self.address = urllib.parse.urlsplit(api)
        self.http = http.client.HTTPConnection(self.address.netloc, timeout=PATIENCE_S)
        self.used = time.monotonic()
        self.time_ms = 0.0
        self.runs = False

    def call(self, method, path, body):
        if time.monotonic() > self.used + 1:  # the server closes a connection that is idle
            self.http.close()
        self.http.request(method, f"{self.address.path}/{path}", json.dumps(body))
        answer = self.http.getresponse()
        self.used = time.monotonic()
        content = answer.read()
        assert answer.status < 300, f"{path}: {answer.status} {content.decode()}"
        return json.loads(content) if content else None

    def run(self, speed):
        self.call("PUT", "clock", {"speed": float(speed)})
        self.runs = speed > 0

    def advance(self, ms):
        if self.runs:
            time.sleep(0.001)
        else:
            self.time_ms = self.call("POST", "clock/advance", {"ms": ms})["time_ms"]

    def now_s(self):
        return self.time_ms / 1000


def wait(condition, what):
    deadline = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < deadline, f"waited for {what}"


def enable(drive, mode):
    """By the state machine of CiA 402, with the targets that hold the axis."""
    drive.write(0x6040, 0x06)
    drive.write(0x60FF, 0)
    drive.write(0x6060, mode)
    for word, mask, state in ((0x06, 0x6F, 0x21), (0x07, 0x6F, 0x23), (0x0F, 0x6F, 0x27)):
        drive.write(0x6040, word)
        wait(lambda: drive.read(0x6041) & mask == state, f"state {state:02X}h")
    wait(lambda: drive.read(0x6061) == mode, f"mode {mode}")


def sample(drive, index, seconds, begin=None):
    """[(time, value)]; after a tenth of the time `begin` commands the motion."""
    samples = [drive.ask(index)[::-1]]
    start = samples[0][0]
    while samples[-1][0] < start + 0.1 * seconds:
        samples.append(drive.ask(index)[::-1])
    if begin:
        begin()
    while samples[-1][0] < start + 1.1 * seconds:
        samples.append(drive.ask(index)[::-1])
    return samples


def figures(samples, begin_share=0.05, end_share=0.05):
    """Rise time from 10 to 90 % and settling time from 10 % until the value stays within 2 %, in ms."""
    start, end = samples[0][0], samples[-1][0]
    first = [value for at, value in samples if at <= start + begin_share * (end - start)]
    last = [value for at, value in samples if at >= end - end_share * (end - start)]
    low, high = sum(first) / len(first), sum(last) / len(last)
    assert high != low, "the axis did not move"
    parts = [(at, (value - low) / (high - low)) for at, value in samples]

    def crossing(level):
        for (at0, part0), (at1, part1) in zip(parts, parts[1:]):
            if part0 < level <= part1:
                return at0 + (at1 - at0) * (level - part0) / (part1 - part0)
        raise AssertionError(f"{level:.0%} is not reached")

    begin = crossing(0.1)
    outside = max(i for i, (_, part) in enumerate(parts) if abs(part - 1) > SETTLED)
    return {
        "rise_ms": 1000 * (crossing(0.9) - begin),
        "settling_ms": 1000 * (parts[min(outside + 1, len(parts) - 1)][0] - begin),
        "overshoot_percent": 100 * (max(part for _, part in parts) - 1),
        "way": high - low,
        "samples": len(samples),
    }


def measure_move(drive, stated):
    """The move of the report, as an absolute target: the velocities in the drive are those that the guide wrote."""
    enable(drive, 1)
    for index, key in ((0x6081, "velocity"), (0x6083, "acceleration"), (0x6084, "acceleration")):
        assert drive.read(index) == stated[key], f"{index:04X}h is not what the report states"
    seconds = 1.5 * (stated["by"] / stated["velocity_per_position"] + stated["ramp_s"])
    position = drive.read(0x6064)

    def begin():
        drive.tell(0x607A, position + stated["by"])
        drive.tell(0x6040, 0x0F)
        drive.tell(0x6040, 0x1F)

    def work():
        drive.step_ms *= 2
        return sample(drive, 0x6064, seconds, begin)

    return work


def steepest(drive, index):
    """The steepest ramp that the drive accepts."""
    ramp = 0x7FFFFFFF
    while True:
        try:
            drive.write(index, ramp)
            return
        except Exception:
            ramp //= 2
            assert ramp > 0


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("report", type=pathlib.Path)
    parser.add_argument("--api", required=True)
    parser.add_argument("--can", help="HOST:PORT/CHANNEL of socketcand")
    parser.add_argument("--node", type=int, default=1)
    parser.add_argument("--ethercat", help="network interface at the other end of the line's raw link")
    options = parser.parse_args()
    stated = json.loads(re.search(r'id="stated">(.*?)</script>', options.report.read_text(), re.S).group(1))
    clock = Clock(options.api)
    units = stated["units"]
    found = {}

    def session(work):
        clock.run(10)
        drive = CanDrive(options.can, options.node, clock) if options.can else EtherCatDrive(options.ethercat, clock)
        try:
            return work(drive)
        finally:
            drive.close()
            clock.run(10)

    def move(drive):
        cycle = dict(stated["cycle"])
        speed = cycle["velocity"] / units["velocity"]  # revolutions per second
        cycle["ramp_s"] = speed / (cycle["acceleration"] / units["acceleration"])
        cycle["velocity_per_position"] = speed * units["position"]
        work = measure_move(drive, cycle)
        clock.run(0)
        drive.begin_sampling()
        return figures(work())

    def step(drive):
        amplitude = stated["step"]["amplitude"]
        cyclic = drive.read(0x6502) >> 8 & 1 if stated["product"] != "pronet" else 0
        before = {index: drive.read(index) for index in (0x6083, 0x6084)}
        enable(drive, 9 if cyclic else 3)
        if not cyclic:
            for index in before:
                steepest(drive, index)
        clock.run(0)
        drive.begin_sampling()
        samples = sample(drive, 0x606C, 0.2, lambda: drive.tell(0x60FF, amplitude))
        drive.tell(0x60FF, 0)
        clock.advance(300)
        drive.tell(0x6040, 0x06)
        for index, value in before.items():
            drive.tell(index, value)
        return figures(samples)

    found["cycle"] = session(move)
    found["step"] = session(step)

    # Tolerances: 3 % of the time and the period of the samples, 0.4 ms on CAN and 1.5 ms by mailbox, at both ends.
    period_ms = 0.8 if options.can else 3.0
    failures = []
    for what in ("cycle", "step"):
        for key in ("rise_ms", "settling_ms"):
            promised, measured = stated[what][key], found[what][key]
            if promised is None:
                failures.append(f"{what}, {key}: the report states no value, measured {measured:.2f}")
            elif abs(measured - promised) > 0.03 * promised + period_ms:
                failures.append(f"{what}, {key}: the report states {promised:.2f}, measured {measured:.2f}")
    # What the motions ended at: the promised distance and speed, within 1 %.
    for what, key in (("cycle", "by"), ("step", "amplitude")):
        promised, measured = stated[what][key], found[what]["way"]
        if abs(measured - promised) > 0.01 * abs(promised):
            failures.append(f"{what}, {key}: the report states {promised:.2f}, measured {measured:.2f}")
        promised, measured = stated[what]["overshoot_percent"], found[what]["overshoot_percent"]
        if abs(measured - promised) > 2 + 0.1 * promised:
            failures.append(f"{what}, overshoot: the report states {promised:.2f} %, measured {measured:.2f} %")
    print(json.dumps({"stated": {key: stated[key] for key in ("cycle", "step")}, "measured": found, "failures": failures}))
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
