#!/usr/bin/env python3
"""A master with pysoem: moves every drive of an EtherCAT segment 3 revolutions and back, in mode CSP.

    pysoem_master.py INTERFACE [--slaves N]

It has the usual structure of a pysoem program: scan, configuration in Pre-Operational, Safe-Operational, Operational
with process data in a loop, checks of the working counter and of the AL states, disabling, Init. Exit status 0: every
drive reported the whole motion; 1: an error, whose reason is printed in one line.
"""

import argparse
import math
import os
import signal
import struct
import sys
import time

import pysoem

CYCLE_S = 0.004
REVOLUTIONS = 3
MOTION_S = 8  # there and back
WATCHDOG_MS = 200  # of the slaves; a PC without a real-time kernel is late at times
STATE_TIMEOUT_S = 5
STATE_ATTEMPTS = 5
ENABLE_TIMEOUT_S = 4
WRONG_COUNTERS = 10  # cycles in a row with a wrong working counter that the program tolerates
AL_CHECK_CYCLES = 25
FOLLOWING_LIMIT_TURNS = 0.25
TOLERANCE_TURNS = 0.02
CSP = 8
SYNC0 = 2
SYNC_ERROR_LIMIT = 600  # 10F1h:02; 3 for each cycle without outputs

# (vendor, product): name, counts of a revolution
KNOWN = {
    (0x53455256, 0x34303245): ("generic402-ec", 131072),
    (0x66668888, 0x45430502): ("JMC EC", 4000),
}
OUTPUTS = [0x60400010, 0x607A0020, 0x60600008]
INPUTS = [0x60410010, 0x60640020, 0x60610008, 0x603F0010]

STATE_NAMES = {0: "no answer", 1: "Init", 2: "Pre-Operational", 3: "Bootstrap", 4: "Safe-Operational", 8: "Operational"}


class MasterFailure(Exception):
    pass


class Drive:
    def __init__(self, number, slave):
        self.number = number
        self.slave = slave
        identity = (slave.man, slave.id)
        if identity not in KNOWN:
            raise MasterFailure(f"slave {number} is an unknown device: vendor {slave.man:08X}h, product {slave.id:08X}h")
        self.product, self.turn = KNOWN[identity]
        self.control = 0
        self.target = None
        self.statusword = self.position = self.mode = self.error_code = 0
        self.start = self.furthest = None
        slave.add_emergency_callback(self.on_emergency)

    def __str__(self):
        return f"slave {self.number} ({self.product})"

    def on_emergency(self, emergency):
        print(f"{self}: emergency {emergency.error_code:04X}h, register {emergency.error_reg:02X}h", flush=True)

    def configure(self):
        """Configures the process data and SYNC0, in Pre-Operational."""
        for assignment, mapping, entries in ((0x1C12, 0x1600, OUTPUTS), (0x1C13, 0x1A00, INPUTS)):
            self.slave.sdo_write(assignment, 0, b"\0")
            self.slave.sdo_write(mapping, 0, b"\0")
            for sub, entry in enumerate(entries, 1):
                self.slave.sdo_write(mapping, sub, struct.pack("<I", entry))
            self.slave.sdo_write(mapping, 0, bytes([len(entries)]))
            self.slave.sdo_write(assignment, 1, struct.pack("<H", mapping))
            self.slave.sdo_write(assignment, 0, b"\1")
        self.slave.sdo_write(0x60C2, 1, bytes([round(CYCLE_S * 1000)]))
        self.slave.sdo_write(0x60C2, 2, struct.pack("<b", -3))
        self.slave.sdo_write(0x10F1, 2, struct.pack("<H", SYNC_ERROR_LIMIT))
        self.slave.set_watchdog("processdata", WATCHDOG_MS)
        self.slave.dc_sync(True, round(CYCLE_S * 1e9))

    def report_synchronisation(self):
        try:
            kind = int.from_bytes(self.slave.sdo_read(0x1C32, 1), "little")
        except pysoem.SdoError as problem:
            print(f"{self}: 1C32h:01 cannot be read ({problem.desc})", flush=True)
            return
        if kind != SYNC0:
            print(f"{self} does not run by SYNC0: 1C32h:01 is {kind}", flush=True)

    def put(self):
        target = self.position if self.target is None else self.target
        self.slave.output = struct.pack("<Hib", self.control, target, CSP)

    def get(self):
        self.statusword, self.position, self.mode, self.error_code = struct.unpack("<HibH", self.slave.input)

    @property
    def state(self):
        """Returns the CiA 402 state from the statusword."""
        if self.statusword & 0x4F == 0x40:
            return "switch on disabled"
        if self.statusword & 0x4F == 0x08:
            return "fault"
        states = {0x21: "ready to switch on", 0x23: "switched on", 0x27: "operation enabled", 0x07: "quick stop active"}
        return states.get(self.statusword & 0x6F, "in between")

    def step_towards_enabled(self):
        """Returns the next controlword on the way to Operation enabled (CiA 402)."""
        before = self.control
        if self.state == "fault":
            self.control = 0x80 if before != 0x80 else 0x00
        else:
            words = {"switch on disabled": 0x06, "ready to switch on": 0x07, "switched on": 0x0F, "operation enabled": 0x0F}
            self.control = words.get(self.state, 0x00)

    def turns_from_start(self):
        return (self.position - self.start) / self.turn


class Program:
    def __init__(self, interface):
        self.interface = interface
        self.master = pysoem.Master()
        self.drives = []
        self.due = time.monotonic()
        self.cycles = self.wrong_counters = self.all_wrong = 0
        self.runs = False  # process data are exchanged

    # ---- Start

    def start(self, slaves):
        self.master.open(self.interface)
        found = self.master.config_init()
        if found != slaves:
            raise MasterFailure(f"{max(found, 0)} slaves are there, {slaves} are configured")
        self.drives = [Drive(number, slave) for number, slave in enumerate(self.master.slaves, 1)]
        self.wait_without_cycle(pysoem.PREOP_STATE)
        self.master.config_dc()
        for drive in self.drives:
            drive.configure()
        self.master.config_map()
        self.wait_without_cycle(pysoem.SAFEOP_STATE)
        for drive in self.drives:
            sizes = len(drive.slave.output), len(drive.slave.input)
            if sizes != (7, 9):
                raise MasterFailure(f"{drive} has {sizes[0]} bytes of outputs and {sizes[1]} of inputs, 7 and 9 are configured")
        for drive in self.drives:
            drive.report_synchronisation()
        self.go_operational()

    def states(self):
        self.master.read_state()
        return [drive.slave.state for drive in self.drives]

    def describe_states(self):
        texts = []
        for drive in self.drives:
            state, code = drive.slave.state, drive.slave.al_status
            text = f"{drive} is in {STATE_NAMES.get(state & 0xF, state)}"
            if state & pysoem.STATE_ERROR or code:
                text += f" with AL status code {code:04X}h ({pysoem.al_status_code_to_string(code)})"
            texts.append(text)
        return "; ".join(texts)

    def wait_without_cycle(self, state):
        if self.master.state_check(state, STATE_TIMEOUT_S * 1_000_000) != state:
            self.master.read_state()
            raise MasterFailure(f"not in {STATE_NAMES[state]}: {self.describe_states()}")

    def go_operational(self):
        self.runs = True
        self.due = time.monotonic()
        for _ in range(20):
            self.cycle(checks=False)
        for _ in range(STATE_ATTEMPTS):
            self.master.state = pysoem.OP_STATE
            self.master.write_state()
            end = time.monotonic() + STATE_TIMEOUT_S / STATE_ATTEMPTS
            while time.monotonic() < end:
                for _ in range(5):
                    self.cycle(checks=False)
                states = self.states()
                if all(state == pysoem.OP_STATE for state in states):
                    self.wrong_counters = 0
                    return
                if any(state & pysoem.STATE_ERROR for state in states):
                    print(f"refused: {self.describe_states()}", flush=True)
                    self.acknowledge()
                    break
        self.master.read_state()
        raise MasterFailure(f"not in Operational: {self.describe_states()}")

    def acknowledge(self):
        for drive in self.drives:
            if drive.slave.state & pysoem.STATE_ERROR:
                drive.slave.state = (drive.slave.state & 0xF) | pysoem.STATE_ACK
                drive.slave.write_state()
        for _ in range(5):
            self.cycle(checks=False)

    # ---- Cycle

    def cycle(self, checks=True):
        for drive in self.drives:
            drive.put()
        self.master.send_processdata()
        counter = self.master.receive_processdata(2000)
        self.cycles += 1
        if counter == self.master.expected_wkc:
            self.wrong_counters = 0
            for drive in self.drives:
                drive.get()
        elif checks:
            self.wrong_counters += 1
            self.all_wrong += 1
        if checks:
            self.check()
        self.due += CYCLE_S
        now = time.monotonic()
        if self.due < now - CYCLE_S:
            self.due = now  # late: continues from now, so that it does not send a burst of frames
        time.sleep(max(0.0, self.due - now))

    def check(self):
        if self.wrong_counters > WRONG_COUNTERS:
            self.master.read_state()
            raise MasterFailure(f"wrong working counter for {self.wrong_counters} cycles: {self.describe_states()}")
        if self.cycles % AL_CHECK_CYCLES != 0:
            return
        if all(state == pysoem.OP_STATE for state in self.states()):
            return
        time.sleep(0.001)
        if any(state != pysoem.OP_STATE for state in self.states()):  # a single lost answer does not count as a state
            raise MasterFailure(f"not in Operational any more: {self.describe_states()}")

    # ---- Motion

    def enable(self):
        for drive in self.drives:
            drive.target = None  # follows the actual position until the drive is enabled
        end = time.monotonic() + ENABLE_TIMEOUT_S
        while any(drive.state != "operation enabled" or drive.mode != CSP for drive in self.drives):
            if time.monotonic() > end:
                raise MasterFailure("not enabled: " + self.describe_drives())
            for drive in self.drives:
                drive.step_towards_enabled()
            self.cycle()
        for drive in self.drives:
            drive.start = drive.target = drive.furthest = drive.position
            drive.control = 0x0F
        for _ in range(25):
            self.cycle()

    def describe_drives(self):
        return "; ".join(
            f"{drive} is {drive.state} (6041h {drive.statusword:04X}h, 603Fh {drive.error_code:04X}h, mode {drive.mode})"
            for drive in self.drives
        )

    def move(self):
        steps = round(MOTION_S / CYCLE_S)
        for step in range(1, steps + 1):
            turns = REVOLUTIONS * (1 - math.cos(2 * math.pi * step / steps)) / 2
            for drive in self.drives:
                drive.target = drive.start + round(turns * drive.turn)
            self.cycle()
            for drive in self.drives:
                drive.furthest = max(drive.furthest, drive.position)
                if drive.state != "operation enabled":
                    raise MasterFailure("not enabled any more: " + self.describe_drives())
                if abs(drive.target - drive.position) > FOLLOWING_LIMIT_TURNS * drive.turn:
                    raise MasterFailure(f"{drive} does not follow: target {drive.target}, position {drive.position}")
        for _ in range(50):
            self.cycle()
        for drive in self.drives:
            top = (drive.furthest - drive.start) / drive.turn
            end = drive.turns_from_start()
            if abs(top - REVOLUTIONS) > TOLERANCE_TURNS or abs(end) > TOLERANCE_TURNS:
                raise MasterFailure(f"{drive} turned {top:.3f} revolutions and ended at {end:.3f}")

    # ---- End

    def stop(self):
        """Commands a quick stop, then removes the power, even with a wrong working counter, as the outputs may still
        arrive."""
        if not self.runs:
            return
        end = time.monotonic() + 1.5
        for control in (0x02, 0x00):
            for drive in self.drives:
                drive.control = control
            self.cycle(checks=False)
            while time.monotonic() < end and any(
                drive.statusword & 0x4F == 0x07 or drive.statusword & 0x6F == 0x27 for drive in self.drives
            ):
                self.cycle(checks=False)
        for _ in range(10):
            self.cycle(checks=False)

    def close(self):
        if self.drives:
            for state in (pysoem.SAFEOP_STATE, pysoem.PREOP_STATE, pysoem.INIT_STATE):
                self.master.state = state
                self.master.write_state()
                self.master.state_check(state, 200_000)
        self.master.close()


def carry_out(program, slaves):
    try:
        program.start(slaves)
        program.enable()
        program.move()
        for drive in program.drives:
            drive.control = 0x07
        for _ in range(50):
            program.cycle()
    finally:
        try:
            program.stop()
        finally:
            program.close()


def end_by_signal(*_):
    raise MasterFailure("ended from outside")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("interface")
    # `servodrome trial` names the drives of the machine, with commas between them.
    products = os.environ.get("SERVODROME_PRODUCTS", "")
    parser.add_argument("--slaves", type=int, default=products.count(",") + 1, help="so many slaves must be there")
    arguments = parser.parse_args()
    pysoem.settings.always_release_gil = True
    # Real-time priority, for a PC with a high load.
    pysoem.settings.timeouts.ret = 20_000
    pysoem.settings.timeouts.safe = 100_000
    pysoem.settings.timeouts.tx_mailbox = 500_000
    signal.signal(signal.SIGTERM, end_by_signal)
    program = Program(arguments.interface)
    try:
        carry_out(program, arguments.slaves)
    except (MasterFailure, ConnectionError, IndexError, struct.error) as failure:
        print(f"failed: {failure}", file=sys.stderr)
        return 1
    except (pysoem.SdoError, pysoem.MailboxError, pysoem.PacketError, pysoem.WkcError, pysoem.EepromError,
            pysoem.ConfigMapError) as failure:
        print(f"failed: {type(failure).__name__} {failure}", file=sys.stderr)
        return 1
    print(f"moved {REVOLUTIONS} revolutions and back; {program.all_wrong} of {program.cycles} cycles had a wrong counter")
    return 0


if __name__ == "__main__":
    sys.exit(main())
