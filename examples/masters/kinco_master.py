#!/usr/bin/env python3
"""A master for a Kinco iSMK with its 10-byte protocol, with pyserial: three revolutions forth and back in position mode.

    servodrome trial --scenarios scenarios/serial10 -- python examples/masters/kinco_master.py {link}

The link is `pty:PATH` or `serial:PATH`; without an argument it comes from SERVODROME_LINK. A second argument is the id of the
drive (default 1). The exit status is 0 only if the drive has reported both motions as done and has been disabled.
"""

import os
import signal
import sys
import time

import serial

ALL = 127        # every drive accepts this id, and answers with its own
TIMEOUT_S = 0.6  # for one answer
PAUSE_S = 0.1    # after a failed exchange: the drive drops a part of a frame after 50 ms
ATTEMPTS = 3
FRAME_BYTES = 10

# Frames (iSMK manual, ch. 8.4.1): id, command, index, sub-index, four bytes of data, checksum.
WRITE = {1: 0x2F, 2: 0x2B, 4: 0x23}
READ = 0x40
VALUE = {1: 0x4F, 2: 0x4B, 4: 0x43}
WRITTEN, ERROR = 0x60, 0x80

CONTROLWORD, STATUSWORD, MODE, TARGET, POSITION = 0x6040, 0x6041, 0x6060, 0x607A, 0x6063
VELOCITY, ACCELERATION, DECELERATION, ALARM = 0x6081, 0x6083, 0x6084, 0x603F

POSITION_MODE = 1
SHUTDOWN, SWITCH_ON, ENABLE, QUICK_STOP, DISABLE_VOLTAGE, RESET_FAULT = 0x06, 0x07, 0x0F, 0x0B, 0x00, 0x86
ABSOLUTE, ABSOLUTE_START = 0x2F, 0x3F
FAULT, TARGET_REACHED, ACKNOWLEDGED = 1 << 3, 1 << 10, 1 << 12
STATE_MASK, READY, SWITCHED_ON, ENABLED = 0x6F, 0x21, 0x23, 0x27

TURN = 65536                                       # increments
RPM = 512 * TURN / 1875                            # internal units of velocity (iSMK manual, appendix II)
RPS_PER_S = 65536 * TURN / 4_000_000               # internal units of acceleration


class DriveError(Exception):
    pass


def frame_of(drive_id, command, index, data=0, sub=0):
    body = bytes((drive_id, command)) + index.to_bytes(2, "little") + bytes((sub,)) + (data & 0xFFFFFFFF).to_bytes(4, "little")
    return body + bytes((-sum(body) & 0xFF,))


def answer_in(received, request, commands):
    """Returns the first intact answer to the request among the characters; skips wrong characters before it."""
    for first in range(len(received) - FRAME_BYTES + 1):
        frame = received[first:first + FRAME_BYTES]
        if request[0] not in (frame[0], ALL) or sum(frame) & 0xFF != 0:
            continue
        if frame[2:5] == request[2:5] and frame[1] in commands:
            return frame
    return None


class Drive:
    def __init__(self, link, drive_id):
        self.id = drive_id
        scheme, _, place = link.partition(":")
        if scheme not in ("pty", "serial"):
            raise DriveError(f"the link {link!r} is not pty:PATH")
        try:
            self.port = serial.Serial(place, 115200, timeout=0.02)
        except serial.SerialException as error:
            raise DriveError(str(error)) from None
        time.sleep(PAUSE_S)

    def close(self):
        self.port.close()

    def exchange(self, request, command):
        self.port.reset_input_buffer()
        self.port.write(request)
        received = b""
        until = time.monotonic() + TIMEOUT_S
        while time.monotonic() < until:
            received += self.port.read(FRAME_BYTES)
            if answer := answer_in(received, request, (command, ERROR)):
                return answer
        return None

    def request(self, request, command, attempts=ATTEMPTS):
        """Every request of this program may be carried out twice, so the program repeats it if the answer is lost or
        wrong."""
        what = f"{'read' if request[1] == READ else 'write'} of {int.from_bytes(request[2:4], 'little'):04X}h"
        for attempt in range(attempts):
            if attempt > 0:
                time.sleep(PAUSE_S)
            try:
                answer = self.exchange(request, command)
            except (serial.SerialException, OSError) as error:
                raise DriveError(f"{what}: {error}") from None
            if answer and answer[1] == ERROR:
                raise DriveError(f"{what} is refused: {int.from_bytes(answer[5:9], 'little'):08X}h")
            if answer:
                return answer
        raise DriveError(f"{what}: no intact answer, {attempts} times; is the cable connected, and does the port speak this "
                         "protocol and not Modbus (6510h sub 0Ch)?")

    def read(self, index, size, sub=0):
        answer = self.request(frame_of(self.id, READ, index, sub=sub), VALUE[size])
        return int.from_bytes(answer[5:5 + size], "little", signed=True)

    def write(self, index, size, value, attempts=ATTEMPTS):
        self.request(frame_of(self.id, WRITE[size], index, value), WRITTEN, attempts)

    def command(self, word, attempts=ATTEMPTS):
        self.write(CONTROLWORD, 2, word, attempts)

    def set(self, index, size, value):
        """Writes a parameter and reads it back."""
        self.write(index, size, value)
        if (found := self.read(index, size)) != value:
            raise DriveError(f"{index:04X}h holds {found} after {value} was written")

    def status(self):
        word = self.read(STATUSWORD, 2) & 0xFFFF
        if word & FAULT:
            raise DriveError(f"the drive has a fault: {self.read(ALARM, 2) & 0xFFFF:04X}h")
        return word

    def wait_for(self, what, holds, patience_s):
        until = time.monotonic() + patience_s
        while not holds(word := self.status()):
            if time.monotonic() > until:
                raise DriveError(f"{what} did not come, the statusword is {word:04X}h")
            time.sleep(0.02)

    def enable(self):
        if self.read(STATUSWORD, 2) & FAULT:
            self.command(RESET_FAULT)
            time.sleep(0.1)
        for command, state in ((SHUTDOWN, READY), (SWITCH_ON, SWITCHED_ON), (ENABLE, ENABLED)):
            self.command(command)
            self.wait_for(f"state {state:02X}h", lambda word: word & STATE_MASK == state, 3)

    def move_to(self, target):
        self.set(TARGET, 4, target)
        self.command(ABSOLUTE)
        self.command(ABSOLUTE_START)
        self.wait_for("the acknowledgement", lambda word: word & ACKNOWLEDGED, 1)
        self.command(ABSOLUTE)
        self.wait_for("the end of the motion", lambda word: word & TARGET_REACHED, 8)
        position = self.read(POSITION, 4)
        if abs(position - target) > TURN // 100:
            raise DriveError(f"the drive reports its target {target} as reached at {position}")

    def disable(self):
        self.command(SHUTDOWN)
        self.wait_for("the end of power", lambda word: word & STATE_MASK == READY, 3)

    def stop(self, patience_s):
        """Commands a quick stop, and after the time of the ramp power off. The drive may receive the words even if no
        answer
        arrives."""
        until = time.monotonic() + patience_s
        for word in (QUICK_STOP, SHUTDOWN):
            for _ in range(ATTEMPTS):
                try:
                    self.command(word, attempts=1)
                    break
                except DriveError:
                    if time.monotonic() > until:
                        break
                    time.sleep(PAUSE_S)
            time.sleep(min(1, patience_s))


def run(drive):
    drive.set(MODE, 1, POSITION_MODE)
    for index, value in ((VELOCITY, 60 * RPM), (ACCELERATION, 4 * RPS_PER_S), (DECELERATION, 4 * RPS_PER_S)):
        drive.set(index, 4, round(value))
    start = drive.read(POSITION, 4)
    drive.enable()
    for target in (start + 3 * TURN, start):
        drive.move_to(target)
        print(f"at {drive.read(POSITION, 4)}")
    drive.disable()


def main():
    link = sys.argv[1] if len(sys.argv) > 1 else os.environ.get("SERVODROME_LINK", "")
    drive_id = int(sys.argv[2]) if len(sys.argv) > 2 else 1
    patience_s = 5

    def terminate(*_):
        nonlocal patience_s
        patience_s = 0.3
        raise DriveError("terminated")

    signal.signal(signal.SIGTERM, terminate)
    try:
        drive = Drive(link, drive_id)
    except DriveError as error:
        sys.exit(str(error))
    try:
        run(drive)
    except (DriveError, KeyboardInterrupt) as error:
        print(f"{link}: {error or 'interrupted'}", file=sys.stderr)
        drive.stop(patience_s)
        sys.exit(1)
    finally:
        drive.close()


if __name__ == "__main__":
    main()
