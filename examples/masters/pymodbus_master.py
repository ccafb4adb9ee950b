#!/usr/bin/env python3
"""A Modbus master for a generic402 drive, with pymodbus: three revolutions forth and back in profile position.

    servodrome trial --scenarios scenarios/modbus -- python examples/masters/pymodbus_master.py {link}

The link is `pty:PATH` (Modbus RTU) or `tcp:HOST:PORT`; without an argument it comes from SERVODROME_LINK. The exit status is
0 only if the drive has reported both motions as done and has been disabled.
"""

import os
import signal
import sys
import time

from pymodbus import FramerType, ModbusException
from pymodbus.client import ModbusSerialClient, ModbusTcpClient

STATION = 1
TIMEOUT_S = 0.7  # for one answer
PAUSE_S = 0.1    # after a failed exchange; answers that arrive in this time are discarded at its end
QUIET_S = 0.02   # before a request over RTU; a second answer that arrives in this time is discarded
ATTEMPTS = 4

# Registers of the drive (`servodrome export modbus generic402`); 32 bits have their high word first.
CONTROLWORD, MODE, TARGET = 0x0000, 0x0001, 0x0002
STATUSWORD, MODE_DISPLAY, POSITION, ERROR_CODE = 0x0100, 0x0101, 0x0102, 0x0107
VELOCITY, ACCELERATION, DECELERATION = 0x605D, 0x6061, 0x6063
ENCODER_INCREMENTS, ENCODER_REVOLUTIONS = 0x606C, 0x606E

PROFILE_POSITION = 1
SHUTDOWN, SWITCH_ON, ENABLE, NEW_SET_POINT, QUICK_STOP, DISABLE_VOLTAGE, RESET_FAULT = 0x06, 0x07, 0x0F, 0x1F, 0x02, 0x00, 0x80
FAULT, TARGET_REACHED, ACKNOWLEDGED = 1 << 3, 1 << 10, 1 << 12
STATE_MASK, READY, SWITCHED_ON, ENABLED = 0x6F, 0x21, 0x23, 0x27

READ, WRITE = 0x03, 0x10  # function codes
ACKNOWLEDGE, BUSY = 5, 6  # exception codes (MODBUS Application Protocol, clause 7)


class DriveError(Exception):
    pass


class Refused(DriveError):
    """The drive has answered with an exception."""


def client_of(link):
    scheme, _, place = link.partition(":")
    options = {"timeout": TIMEOUT_S, "retries": 0}
    if scheme == "tcp":
        host, _, port = place.rpartition(":")
        return ModbusTcpClient(host, port=int(port), **options)
    if scheme in ("pty", "serial"):
        return ModbusSerialClient(place, framer=FramerType.RTU, baudrate=115200, parity="N", **options)
    raise DriveError(f"the link {link!r} is neither pty:PATH nor tcp:HOST:PORT")


def words_of(value):
    return [value >> 16 & 0xFFFF, value & 0xFFFF]


def number_of(words):
    value = words[0] << 16 | words[1]
    return value - (1 << 32) if value >> 31 else value


class Drive:
    def __init__(self, link):
        self.client = client_of(link)

    def close(self):
        self.client.close()

    # ---- One request and its answer

    def request(self, function, register, send, fits, attempts=ATTEMPTS):
        """Every request of this program may be carried out twice, so the program repeats it if the answer is lost or
        wrong."""
        said = ""
        for _ in range(attempts):
            if said:
                self.recover()
            elif isinstance(self.client, ModbusSerialClient):
                time.sleep(QUIET_S)
            try:
                answer = send()
            except (ModbusException, OSError) as error:
                said = str(error)
                continue
            if answer.function_code & 0x7F != function:
                said = f"an answer to function {answer.function_code & 0x7F:02X}h"
            elif not answer.isError():
                if fits(answer):
                    if said:
                        self.recover()  # the answer to the previous request may still arrive
                    return answer
                said = "an answer that does not fit the request"
            elif answer.exception_code == ACKNOWLEDGE and function == WRITE:
                return answer  # accepted, but not complete yet: reading back shows the result
            elif answer.exception_code == BUSY:
                said = "the drive is busy"
            else:
                raise Refused(f"function {function:02X}h at register {register:04X}h: exception {answer.exception_code:02X}h")
        raise DriveError(f"function {function:02X}h at register {register:04X}h: {said}, {attempts} times")

    def recover(self):
        """Waits for late answers and discards them, because RTU does not number its requests."""
        time.sleep(PAUSE_S)
        if isinstance(self.client, ModbusTcpClient):
            self.client.close()
        elif self.client.socket:
            self.client.socket.reset_input_buffer()

    def read(self, register, count):
        return self.request(
            READ, register, lambda: self.client.read_holding_registers(register, count=count, device_id=STATION),
            lambda answer: len(answer.registers) == count).registers

    def write(self, register, words, attempts=ATTEMPTS):
        self.request(
            WRITE, register, lambda: self.client.write_registers(register, words, device_id=STATION),
            lambda answer: (answer.address, answer.count) == (register, len(words)), attempts)

    # ---- The drive

    def set(self, register, words):
        """Writes a parameter and reads it back."""
        self.write(register, words)
        until = time.monotonic() + 1
        while (found := self.read(register, len(words))) != words and time.monotonic() < until:
            time.sleep(0.05)
        if found != words:
            raise DriveError(f"register {register:04X}h holds {found} after {words} was written")

    def status(self):
        word = self.read(STATUSWORD, 1)[0]
        if word & FAULT:
            raise DriveError(f"the drive has a fault: {self.read(ERROR_CODE, 1)[0]:04X}h")
        return word

    def wait_for(self, what, holds, patience_s):
        until = time.monotonic() + patience_s
        while not holds(word := self.status()):
            if time.monotonic() > until:
                raise DriveError(f"{what} did not come, the statusword is {word:04X}h")
            time.sleep(0.05)

    def position(self):
        return number_of(self.read(POSITION, 2))

    def enable(self):
        if self.read(STATUSWORD, 1)[0] & FAULT:
            self.write(CONTROLWORD, [DISABLE_VOLTAGE])
            self.write(CONTROLWORD, [RESET_FAULT])
            time.sleep(0.1)
        for command, state in ((SHUTDOWN, READY), (SWITCH_ON, SWITCHED_ON), (ENABLE, ENABLED)):
            self.write(CONTROLWORD, [command])
            self.wait_for(f"state {state:02X}h", lambda word: word & STATE_MASK == state, 3)

    def move_to(self, target, window):
        self.set(TARGET, words_of(target))
        self.write(CONTROLWORD, [NEW_SET_POINT])
        self.wait_for("the acknowledgement", lambda word: word & ACKNOWLEDGED, 1)
        self.write(CONTROLWORD, [ENABLE])
        self.wait_for("the end of the motion", lambda word: word & TARGET_REACHED and not word & ACKNOWLEDGED, 8)
        position = self.position()
        if abs(position - target) > window:
            raise DriveError(f"the drive reports its target {target} as reached at {position}")

    def disable(self):
        self.write(CONTROLWORD, [SHUTDOWN])
        self.wait_for("the end of power", lambda word: word & STATE_MASK == READY, 3)
        self.write(CONTROLWORD, [DISABLE_VOLTAGE])

    def stop(self, patience_s):
        """Commands a quick stop, and after the time of the ramp power off. The drive may receive the words even if no
        answer
        arrives."""
        until = time.monotonic() + patience_s
        for word in (QUICK_STOP, DISABLE_VOLTAGE):
            for _ in range(ATTEMPTS * 4):
                try:
                    self.write(CONTROLWORD, [word], attempts=1)
                    break
                except Refused:
                    break
                except DriveError:
                    if time.monotonic() > until:
                        break
                    self.recover()
            time.sleep(min(1, patience_s))


def run(drive):
    turn = number_of(drive.read(ENCODER_INCREMENTS, 2)) // number_of(drive.read(ENCODER_REVOLUTIONS, 2))
    drive.set(MODE, [PROFILE_POSITION])
    drive.wait_for("profile position", lambda _: drive.read(MODE_DISPLAY, 1)[0] == PROFILE_POSITION, 1)
    for register, turns in ((VELOCITY, 1), (ACCELERATION, 4), (DECELERATION, 4)):  # per second, per second squared
        drive.set(register, words_of(turn * turns))
    start = drive.position()
    drive.enable()
    for target in (start + 3 * turn, start):
        drive.move_to(target, turn // 100)
        print(f"at {drive.position()}")
    drive.disable()


def main():
    link = sys.argv[1] if len(sys.argv) > 1 else os.environ.get("SERVODROME_LINK", "")
    patience_s = 8

    def terminate(*_):
        nonlocal patience_s
        patience_s = 0.2
        raise DriveError("terminated")

    signal.signal(signal.SIGTERM, terminate)
    try:
        drive = Drive(link)
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
