"""Each error of a master, and the AL status code of the refusal (ETG.1000.6 6.4, ETG.1020 11)."""

import signal
import struct
import time

import pytest
from line import wait_for
from master import BOOT, ERROR, INIT, OP, PREOP, SAFEOP
from segment import segment

AL_CONTROL, AL_STATUS, AL_STATUS_CODE = 0x0120, 0x0130, 0x0134
MAILBOX_OUT, MAILBOX_IN, OUTPUTS, INPUTS = 0x0800, 0x0808, 0x0810, 0x0818  # sync managers
START, LENGTH, CONTROL, ACTIVATE = 0, 2, 4, 6
TIMEOUT_US = 1_000_000
SYNC_ACTIVATION, SYNC0_START, SYNC0_CYCLE = 0x0981, 0x0990, 0x09A0


def read(slave, register, size=2):
    return int.from_bytes(slave._fprd(register, size, TIMEOUT_US), "little")


def write(slave, register, value, size=2):
    slave._fpwr(register, value.to_bytes(size, "little"), TIMEOUT_US)


def status(slave):
    return read(slave, AL_STATUS), read(slave, AL_STATUS_CODE)


def request(slave, state):
    """Returns AL status and code when the state is reached or refused."""
    write(slave, AL_CONTROL, state)
    wait_for(lambda: status(slave)[0] & 0x0F == state & 0x0F or status(slave)[0] & ERROR, lambda: f"{status(slave)}")
    return status(slave)


def acknowledge(slave, state):
    assert request(slave, state | ERROR) == (state, 0)


@pytest.mark.parametrize(
    "begin, wanted, code",
    [
        (INIT, SAFEOP, 0x0011),
        (INIT, OP, 0x0011),
        (PREOP, OP, 0x0011),
        (PREOP, BOOT, 0x0011),
        (PREOP, 0, 0x0012),
        *((PREOP, state, 0x0012) for state in (5, 6, 7, 9, 10, 11, 12, 13, 14, 15)),
    ],
)
def test_changes_that_do_not_exist(slave, begin, wanted, code):
    assert request(slave, begin) == (begin, 0)
    write(slave, AL_CONTROL, wanted)
    wait_for(lambda: status(slave)[0] & ERROR, "a refusal")
    assert status(slave) == (begin | ERROR, code)
    # The slave accepts only an acknowledgement (and Init); afterwards it works as before.
    write(slave, AL_CONTROL, PREOP)
    assert status(slave) == (begin | ERROR, code)
    acknowledge(slave, begin)
    assert request(slave, INIT) == (INIT, 0)


def test_bootstrap_where_there_is_none(start_line, open_master):
    start_line(segment(1, product="jmc_ec", travel=""))
    master = open_master()
    assert master.scan() == 1
    slave = master.slaves[0]
    assert request(slave, INIT) == (INIT, 0)
    assert request(slave, BOOT) == (INIT | ERROR, 0x0013)


@pytest.mark.parametrize(
    "register, value, size",
    [
        (MAILBOX_OUT + START, 0x1001, 2),
        (MAILBOX_OUT + LENGTH, 33, 2),
        (MAILBOX_OUT + LENGTH, 257, 2),
        (MAILBOX_OUT + CONTROL, 0x22, 1),  # read by the master
        (MAILBOX_OUT + CONTROL, 0x64, 1),  # three buffers
        (MAILBOX_OUT + ACTIVATE, 0, 1),
        (MAILBOX_IN + START, 0x1180, 2),
        (MAILBOX_IN + LENGTH, 0, 2),
        (MAILBOX_IN + CONTROL, 0x26, 1),
        (MAILBOX_IN + ACTIVATE, 0, 1),
    ],
)
def test_mailbox_configured_wrong(slave, register, value, size):
    assert request(slave, INIT) == (INIT, 0)
    manager, good = register & ~7, slave._fprd(register & ~7, 8, TIMEOUT_US)
    slave._fpwr(manager + ACTIVATE, b"\0", TIMEOUT_US)
    if register & 7 != ACTIVATE:
        write(slave, register, value, size)
        slave._fpwr(manager + ACTIVATE, b"\1", TIMEOUT_US)
    assert request(slave, PREOP) == (INIT | ERROR, 0x0016)
    slave._fpwr(manager + ACTIVATE, b"\0", TIMEOUT_US)
    slave._fpwr(manager, good, TIMEOUT_US)
    assert request(slave, PREOP | ERROR) == (PREOP, 0)
    assert slave.sdo_read(0x1018, 4)


def test_mailbox_switched_off_while_it_is_used(slave):
    slave._fpwr(MAILBOX_IN + ACTIVATE, b"\0", TIMEOUT_US)
    wait_for(lambda: status(slave) == (INIT | ERROR, 0x0016), lambda: f"{status(slave)}")


@pytest.fixture
def mapped(master):
    """Both slaves with sync managers and FMMUs set up, in Pre-Operational."""
    master.map()
    for slave in master.slaves:
        assert request(slave, PREOP) == (PREOP, 0)
        for manager in (OUTPUTS, INPUTS):
            slave._fpwr(manager + ACTIVATE, b"\1", TIMEOUT_US)
    return master


@pytest.mark.parametrize(
    "register, value, size, code",
    [
        (OUTPUTS + START, 0x1204, 2, 0x001D),
        (OUTPUTS + LENGTH, 4, 2, 0x001D),
        (OUTPUTS + LENGTH, 200, 2, 0x001D),
        (OUTPUTS + CONTROL, 0x20, 1, 0x001D),  # read by the master
        (OUTPUTS + CONTROL, 0x26, 1, 0x001D),  # mailbox
        (OUTPUTS + ACTIVATE, 0, 1, 0x001D),
        (INPUTS + START, 0x1504, 2, 0x001E),
        (INPUTS + LENGTH, 1, 2, 0x001E),
        (INPUTS + CONTROL, 0x64, 1, 0x001E),
        (INPUTS + ACTIVATE, 0, 1, 0x001E),
    ],
)
def test_process_data_configured_wrong(mapped, register, value, size, code):
    slave = mapped.slaves[0]
    manager, good = register & ~7, slave._fprd(register & ~7, 8, TIMEOUT_US)
    slave._fpwr(manager + ACTIVATE, b"\0", TIMEOUT_US)
    if register & 7 != ACTIVATE:
        write(slave, register, value, size)
        slave._fpwr(manager + ACTIVATE, b"\1", TIMEOUT_US)
    assert request(slave, SAFEOP) == (PREOP | ERROR, code)
    slave._fpwr(manager + ACTIVATE, b"\0", TIMEOUT_US)
    slave._fpwr(manager, good, TIMEOUT_US)
    assert request(slave, SAFEOP | ERROR) == (SAFEOP, 0)


@pytest.mark.parametrize("manager, code", [(OUTPUTS, 0x001D), (INPUTS, 0x001E)])
def test_process_data_switched_off_while_they_are_used(master, manager, code):
    master.run()
    master.slaves[1]._fpwr(manager + ACTIVATE, b"\0", TIMEOUT_US)
    wait_for(lambda: status(master.slaves[1]) == (PREOP | ERROR, code), lambda: f"{status(master.slaves[1])}")
    assert status(master.slaves[0]) == (OP, 0)


@pytest.mark.parametrize("assignment, mapping, code", [(0x1C12, 0x1600, 0x0025), (0x1C13, 0x1A00, 0x0024)])
def test_mapping_that_grew_too_long(mapped, assignment, mapping, code):
    """Two PDOs are assigned and then enlarged: each one fits, but both together do not (256 bytes)."""
    slave = mapped.slaves[0]
    slave.sdo_write(assignment, 0, b"\0")
    slave.sdo_write(assignment, 1, struct.pack("<H", mapping))
    slave.sdo_write(assignment, 2, struct.pack("<H", mapping + 1))
    slave.sdo_write(assignment, 0, b"\2")
    for pdo in (mapping, mapping + 1):
        slave.sdo_write(pdo, 0, b"\0")
        for sub in range(1, 7):
            slave.sdo_write(pdo, sub, struct.pack("<I", 0x000000F8))  # a gap of 31 bytes
        slave.sdo_write(pdo, 0, b"\6")
    assert request(slave, SAFEOP) == (PREOP | ERROR, code)


def test_no_outputs(master):
    """Requests Operational and sends no outputs."""
    master.map()
    assert request(master.slaves[0], OP) == (SAFEOP | ERROR, 0x0019)


def test_watchdog_of_process_data(master):
    """The master sends nothing for longer than the watchdog of one slave; the watchdog of the other one is longer."""
    master.run(watchdog_ms=6000)
    master.slaves[0].set_watchdog("processdata", 20)
    assert master.slaves[0].get_watchdog("processdata") == pytest.approx(20, abs=0.1)
    master.stop_cycle()
    wait_for(lambda: status(master.slaves[0])[0] != OP, "the watchdog")
    assert status(master.slaves[0]) == (SAFEOP | ERROR, 0x001B)
    assert read(master.slaves[0], 0x0440) & 1 == 0  # expired
    assert read(master.slaves[0], 0x0442, 1) >= 1  # its counter
    master.start_cycle()
    master.slaves[0].set_watchdog("processdata", 6000)
    master.pass_cycles(5)
    assert request(master.slaves[0], SAFEOP | ERROR) == (SAFEOP, 0)
    assert request(master.slaves[0], OP) == (OP, 0)


def test_a_line_that_gets_no_processor_keeps_its_slaves(line, master, bench):
    """Time in which the line could not run does not count as silence of the master, which continues to send."""
    master.run(watchdog_ms=1000)
    line.process.send_signal(signal.SIGSTOP)
    time.sleep(3)
    line.process.send_signal(signal.SIGCONT)
    master.pass_cycles(20)
    clock = bench.get("clock")
    assert clock["lag_ms"] > 2900 and clock["lag_count"] >= 1
    assert [status(slave) for slave in master.slaves] == [(OP, 0)] * 2


def test_a_watchdog_of_zero_never_expires(master, bench):
    master.run(watchdog_ms=0)
    for slave in master.slaves:
        write(slave, 0x0420, 0)
    master.stop_cycle()
    begin = bench.get("clock")["time_ms"]
    wait_for(lambda: bench.get("clock")["time_ms"] > begin + 1000, "a second of the line's")
    assert [status(slave) for slave in master.slaves] == [(OP, 0)] * 2


class TestDistributedClocks:
    CYCLE_NS = 2_000_000

    @pytest.fixture
    def clocked(self, mapped):
        assert mapped.soem.config_dc()
        return mapped

    @pytest.mark.parametrize("cycle_ns, code", [(100_000, 0x0036), (0, 0x0036)])
    def test_cycle_too_short(self, clocked, cycle_ns, code):
        slave = clocked.slaves[0]
        if cycle_ns:
            slave.dc_sync(True, cycle_ns)
        else:
            write(slave, SYNC0_START, (1 << 63), 8)
            write(slave, SYNC0_CYCLE, 0, 4)
            write(slave, SYNC_ACTIVATION, 3, 1)
        assert request(slave, SAFEOP) == (PREOP | ERROR, code)
        slave.dc_sync(False, self.CYCLE_NS)
        assert request(slave, SAFEOP | ERROR) == (SAFEOP, 0)

    def test_wanted_but_not_started(self, clocked):
        slave = clocked.slaves[0]
        slave.sdo_write(0x1C32, 1, b"\2\0")
        assert request(slave, SAFEOP) == (PREOP | ERROR, 0x0030)
        slave.dc_sync(True, self.CYCLE_NS)
        assert request(slave, SAFEOP | ERROR) == (SAFEOP, 0)
        assert slave.sdo_read(0x1C32, 0x0A) == struct.pack("<I", self.CYCLE_NS)

    def test_pulses_that_never_come(self, clocked):
        """SYNC0 starts in an hour; outputs arrive."""
        slave = clocked.slaves[0]
        slave.dc_sync(False, self.CYCLE_NS)
        write(slave, SYNC0_CYCLE, self.CYCLE_NS, 4)
        write(slave, SYNC0_START, read(slave, 0x0910, 8) + 3600 * 10**9, 8)
        write(slave, SYNC_ACTIVATION, 3, 1)
        assert request(slave, SAFEOP) == (SAFEOP, 0)
        assert request(clocked.slaves[1], SAFEOP) == (SAFEOP, 0)
        clocked.start_cycle()
        assert request(slave, OP) == (SAFEOP | ERROR, 0x002D)

    def test_pulses_that_end(self, master):
        for slave in master.slaves:
            slave.sdo_write(0x10F1, 2, b"\0\0")  # cycles that a busy machine loses must not cause an error
        master.run(dc_cycle_ns=self.CYCLE_NS)
        slave = master.slaves[0]
        write(slave, SYNC_ACTIVATION, 0, 1)
        wait_for(lambda: status(slave)[0] != OP, "the end of the synchronous operation")
        assert status(slave) == (SAFEOP | ERROR, 0x002C)
        assert status(master.slaves[1]) == (OP, 0)

    def test_cycles_without_outputs(self, master):
        """10F1h: each missed cycle adds 3 to a counter; above the limit the slave leaves Operational. The limit of the
        other
        slave is 0, which disables the check."""
        for slave, limit in zip(master.slaves, (200, 0)):
            slave.sdo_write(0x10F1, 2, struct.pack("<H", limit))
        master.run(dc_cycle_ns=self.CYCLE_NS, watchdog_ms=6500)
        master.stop_cycle()
        wait_for(lambda: status(master.slaves[0])[0] != OP, "the counter to exceed its limit")
        assert status(master.slaves[0]) == (SAFEOP | ERROR, 0x001A)
        missed = int.from_bytes(master.slaves[0].sdo_read(0x1C32, 0x0B), "little")
        assert missed >= 67  # 200 / 3
        assert master.slaves[0].sdo_read(0x1C32, 0x20) == b"\1"
        assert status(master.slaves[1]) == (OP, 0)


def test_damaged_information_memory(line, open_master):
    """A wrong checksum is detected when the controller loads the memory: at the next power-on."""
    master = open_master()
    master.scan()
    master.slaves[0].eeprom_write(7, b"\0\0")
    line.bench.post("axes/drive1/power", {"action": "cycle"})
    master.scan()
    master.soem.read_state()
    slave = master.slaves[0]
    assert status(slave) == (INIT | ERROR, 0x0051)
