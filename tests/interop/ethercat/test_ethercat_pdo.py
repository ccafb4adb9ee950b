"""PDO assignment and mapping: valid and refused combinations, and the layout of the process data."""

import struct

import pysoem
import pytest
from line import COUNTS
from master import OP


@pytest.fixture
def drive(drives):
    return drives[0]


def aborts(code, function, *arguments):
    with pytest.raises(pysoem.SdoError) as refusal:
        function(*arguments)
    assert refusal.value.abort_code == code, f"{refusal.value.abort_code:08X}h"


def test_layouts(drive, drives, master):
    """Two PDOs in each direction, with odd lengths and gaps: every object is at the place that the mapping gives."""
    drive.download(0x1C12, 0)
    drive.download(0x1C13, 0)
    for mapping, entries in (
        (0x1600, [0x60600008, 0x60400010]),
        (0x1601, [0x00000004, 0x607A0020, 0x0000000C]),
        (0x1A00, [0x60610008, 0x00000003, 0x60410010]),
        (0x1A01, [0x00000005, 0x60640020, 0x60FD0020]),
    ):
        drive.download(mapping, 0)
        for sub, entry in enumerate(entries, 1):
            drive.download(mapping, entry, sub)
        drive.download(mapping, len(entries))
    for assignment, first in ((0x1C12, 0x1600), (0x1C13, 0x1A00)):
        drive.download(assignment, first, 1)
        drive.download(assignment, first + 1, 2)
        drive.download(assignment, 2)
    for each in drives:
        each.learn_mapping()
    master.run()
    assert (len(drive.slave.output), len(drive.slave.input)) == (9, 12)
    assert drive.outputs == {(0x6060, 0): (0, 8), (0x6040, 0): (8, 16), (0x607A, 0): (28, 32)}
    assert drive.inputs == {(0x6061, 0): (0, 8), (0x6041, 0): (11, 16), (0x6064, 0): (32, 32), (0x60FD, 0): (64, 32)}
    assert (len(drives[1].slave.output), len(drives[1].slave.input)) == (14, 14)  # the default lengths

    drive.write(0x6060, 8)
    master.wait(lambda: drive.get(0x6061) == 8, "the mode")
    drive.write(0x607A, drive.get(0x6064))
    drive.enable()
    assert drive.upload(0x607A) == drive.values[0x607A, 0]
    assert drive.get(0x6064) == drive.upload(0x6064) == pytest.approx(2 * COUNTS, abs=COUNTS // 100)
    drive.bench.put(f"axes/{drive.name}/inputs", {"DI0": True, "DI1": True})
    master.wait(lambda: drive.get(0x60FD) == drive.upload(0x60FD) != 0, "the inputs")


def test_refusals_in_pre_operational(drive):
    """Invalid mappings: sub-index 0 is not 0, objects that cannot be mapped, do not exist, or are too long."""
    aborts(0x06010003, drive.download, 0x1600, 0x60400010, 1)
    aborts(0x06010003, drive.download, 0x1C12, 0x1601, 1)
    drive.download(0x1C12, 0)
    drive.download(0x1600, 0)
    aborts(0x06040041, drive.download, 0x1600, 0x60410010, 1)  # read-only
    aborts(0x06040041, drive.download, 0x1600, 0x60400020, 1)  # not its own length
    aborts(0x06020000, drive.download, 0x1600, 0x5FFF0010, 1)
    aborts(0x06090011, drive.download, 0x1600, 0x60FE0520, 1)
    drive.download(0x1600, 0x60400010, 1)
    aborts(0x06090031, drive.download, 0x1600, 17)  # the maximum is 16
    drive.download(0x1600, 1)
    with pytest.raises(pysoem.SdoError):
        drive.download(0x1C12, 0x1A00, 1)
    drive.download(0x1C12, 0x1600, 1)
    drive.download(0x1C12, 1)


def test_refusals_while_process_data_run(drive, master):
    master.run()
    for number, value, sub in ((0x1C12, 0, 0), (0x1C13, 0, 0), (0x1600, 0, 0), (0x1A00, 0, 0)):
        aborts(0x08000022, drive.download, number, value, sub)
    assert master.states() == [(OP, 0)] * 2


def test_process_data_back_and_forth(master):
    """Operational, new scan, another mapping, Operational again, without a power cycle."""
    master.run()
    assert len(master.slaves[0].input) == 14
    master.stop_cycle()
    assert master.scan() == 2
    slave = master.slaves[0]
    slave.sdo_write(0x1C13, 0, b"\0")
    slave.sdo_write(0x1C13, 1, struct.pack("<H", 0x1A01))
    slave.sdo_write(0x1C13, 0, b"\1")
    master.run()
    assert len(slave.input) == 6
    assert master.states() == [(OP, 0)] * 2


def test_inputs_while_safe_operational(drives, master):
    """The slave sends inputs and does not accept outputs: the controlword is unchanged."""
    for drive in drives:
        drive.learn_mapping()
    master.map()
    master.start_cycle()
    master.wait(lambda: drives[0].get(0x6041) & 0x4F == 0x40, "the statusword")
    drives[0].values[0x6040, 0] = 0x0006
    master.pass_cycles(20)
    assert drives[0].get(0x6041) & 0x4F == 0x40
    assert drives[0].upload(0x6040) == 0
    master.go_operational()
    master.wait(lambda: drives[0].get(0x6041) & 0x6F == 0x21, "Ready to switch on")
