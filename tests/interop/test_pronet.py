"""A third-party master operates the ESTUN ProNet by the procedures of its manual (chapters 7, 9 and 10)."""

import struct

import canopen
import pytest
from drive402 import (
    BIT_12,
    BIT_13,
    HOMING,
    INTERPOLATED_POSITION,
    PROFILE_POSITION,
    PROFILE_VELOCITY,
    TARGET_REACHED,
    Drive402,
)
from line import servodrome, wait_for

pytestmark = pytest.mark.once  # the behaviour of drives does not depend on the link

TURN = 10_000  # the incremental encoder of the manual's examples
SWITCH = (int(1.2 * TURN), int(2.4 * TURN))
AXIS = """
[[axis]]
name = "{name}"
product = "pronet"
bus = "can0"
node = {node}

  [axis.encoder]
  counts_per_revolution = 10000
  index_position_counts = 2500

  [axis.travel]
  counts_per_unit = 10000
  low_stop = -31
  high_stop = 31
  negative_limit = -30
  positive_limit = 30
  home = {{ from = 1.2, to = 2.4 }}
"""
PRONETS = '[[bus]]\nname = "can0"\n' + AXIS.format(name="one", node=1) + AXIS.format(name="two", node=2)
CLOSE = 8  # counts: the errors of the encoder (some arc seconds) and of its control


class Pronet(Drive402):
    def __init__(self, network, node_id, line, eds):
        super().__init__(network.add_node(node_id, eds), line.bench, {1: "one", 2: "two"}[node_id])
        self.network = network

    def rpdo(self, number, data):
        self.network.send(0x100 + 0x100 * number + self.node.id, data)

    def map(self, index, *objects):
        """Sets sub 0 to 0, then the objects, then sub 0 to their number, as in the manual (ch. 3.3)."""
        self.write(index, 0, 0)
        for sub, entry in enumerate(objects, 1):
            self.write(index, entry, sub)
        self.write(index, len(objects), 0)

    def silence(self):
        """Bit 31 switches off the TPDOs that the drive sends each 10 ms by factory setting (ch. 10.2)."""
        for index in range(0x1800, 0x1804):
            self.write(index, self.read(index, 1) | 0x80000000, 1)

    def enable(self):
        # Bit 9 "remote" is never set; the states are those of the standard.
        super().enable()
        assert not self.statusword & 0x0300


@pytest.fixture
def pronets(start_line):
    return start_line(PRONETS)


@pytest.fixture
def drive(pronets, connect, eds):
    return Pronet(connect(pronets), 1, pronets, eds("pronet"))


@pytest.fixture
def pair(pronets, connect, eds):
    network = connect(pronets)
    return [Pronet(network, node, pronets, eds("pronet")) for node in (1, 2)]


def test_objects_by_the_names_of_the_eds(drive):
    sdo = drive.node.sdo
    sdo["Pn118"].raw = 0xFC18
    assert sdo["Pn118"].raw == 0xFC18
    sdo["Pn505"].raw = -2000
    assert sdo["Pn505"].raw == -2000
    assert sdo["TPDO 1 transmit mask"]["Transmit mask low"].raw == 0xFFFFFFFF
    assert sdo["Profile acceleration"].raw == 100_000
    sdo["Homing speeds"]["Speed during search for switch"].raw = 1000
    assert sdo[0x6099][1].raw == 1000
    sdo["Sync time period"].raw = 2000
    assert sdo[0x2105].raw == 2000
    assert sdo[0x1800][0].raw == 4
    with pytest.raises(canopen.SdoAbortedError) as refused:
        sdo["Modes of operation"].raw = 8
    assert refused.value.code == 0x06090030
    with pytest.raises(canopen.SdoAbortedError) as refused:
        sdo["Position factor"][2].raw = 0
    assert refused.value.code == 0x06090032


def test_profile_position_over_two_rpdos(drive):
    """Ch. 9.2 and 9.3: 6040h in RPDO 1, 607Ah and 6081h in RPDO 2."""
    drive.map(0x1600, 0x60400010)
    drive.map(0x1601, 0x607A0020, 0x60810020)
    drive.network.nmt.send_command(1)
    drive.set_mode(PROFILE_POSITION)
    drive.enable()
    start = drive.true_position
    drive.rpdo(2, struct.pack("<iI", 2 * TURN, 3000))
    drive.rpdo(1, struct.pack("<H", 0x0F))
    drive.rpdo(1, struct.pack("<H", 0x1F))
    drive.wait_bits(TARGET_REACHED | BIT_12, TARGET_REACHED | BIT_12)
    drive.wait_standstill()
    assert abs(drive.true_position - start - 2 * TURN) <= CLOSE
    drive.rpdo(1, struct.pack("<H", 0x0F))
    drive.wait_bits(BIT_12, 0)
    drive.rpdo(1, struct.pack("<H", 0x5F))  # relative
    drive.wait_bits(TARGET_REACHED | BIT_12, TARGET_REACHED | BIT_12)
    drive.wait_standstill()
    assert abs(drive.true_position - start - 4 * TURN) <= CLOSE
    drive.rpdo(1, struct.pack("<H", 0x0F))
    drive.rpdo(2, struct.pack("<iI", -TURN, 3000))
    drive.wait_bits(BIT_12, 0)
    drive.rpdo(1, struct.pack("<H", 0x1F))
    drive.wait_bits(TARGET_REACHED | BIT_12, TARGET_REACHED | BIT_12)
    drive.wait_standstill()
    assert abs(drive.true_position - start + TURN) <= CLOSE


def test_pdos_configured_by_the_canopen_package(drive):
    """The package's own procedure with names: it disables, maps, sets and enables."""
    node = drive.node
    tpdo = node.tpdo[1]
    tpdo.read()
    tpdo.clear()
    tpdo.add_variable("Statusword")
    tpdo.add_variable("Velocity actual value")
    tpdo.trans_type = 254
    tpdo.event_timer = 0
    tpdo.enabled = True
    tpdo.save()
    rpdo = node.rpdo[1]
    rpdo.read()
    rpdo.clear()
    rpdo.add_variable("Controlword")
    rpdo.add_variable("Target velocity")
    rpdo.save()
    drive.set_mode(PROFILE_VELOCITY)
    drive.network.nmt.send_command(1)
    drive.enable()
    rpdo["Controlword"].raw = 0x0F
    rpdo["Target velocity"].raw = -2000
    rpdo.transmit()

    def told_speed():
        frames = drive.network.seen.data(0x181)
        return bool(frames) and abs(struct.unpack("<Hi", frames[-1])[1] + 2000) <= 20

    wait_for(told_speed, "TPDO 1 with -200 rpm")
    wait_for(lambda: abs(drive.bench.axis("one")["velocity_rpm"] + 200) < 2, "-200 rpm")
    drive.wait_bits(TARGET_REACHED | BIT_12, TARGET_REACHED)
    rpdo["Target velocity"].raw = 0
    rpdo.transmit()
    drive.wait_bits(TARGET_REACHED | BIT_12, TARGET_REACHED | BIT_12)


def test_default_pdos_come_by_themselves(drive):
    drive.network.nmt.send_command(1)
    for identifier in (0x181, 0x281, 0x381, 0x481):
        frames = drive.network.seen.wait(identifier, 5)
        assert all(len(frame) == 6 for frame in frames)
    drive.set_mode(PROFILE_POSITION)
    wait_for(lambda: drive.network.seen.data(0x281)[-1][4:] == b"\x01\x00", "6061h with 16 bits in TPDO 2")


def interpolation(drive, period_ms):
    """The manual's example (ch. 7.5.4)."""
    drive.silence()
    drive.map(0x1600, 0x60400010)
    drive.map(0x1601, 0x60C10120)
    drive.write(0x1400, 1, 2)
    drive.write(0x1401, 1, 2)
    drive.write(0x2105, period_ms * 1000)
    drive.write(0x60C2, period_ms, 1)
    drive.write(0x60C2, -3, 2)
    drive.write(0x1006, period_ms * 1000)
    drive.network.nmt.send_command(0x82)
    drive.network.seen.wait(0x701)
    assert drive.read(0x1401, 2) == 1, "the setup is kept"
    drive.set_mode(INTERPOLATED_POSITION)
    drive.enable()
    drive.network.nmt.send_command(1)


def test_interpolated_position_and_alarm_a69(drive):
    interpolation(drive, 200)
    start = drive.position
    seen = drive.network.seen
    target = start

    def cycle(position):
        drive.rpdo(2, struct.pack("<i", position))
        drive.rpdo(1, struct.pack("<H", 0x1F))
        drive.network.send_sync()

    clock = lambda: drive.bench.get("clock")["time_ms"]
    due = clock()
    for step in range(15):
        target = start + 400 * step
        cycle(target)
        due += 200
        wait_for(lambda: clock() >= due, "the next period")
    assert drive.statusword & BIT_12, "ip mode active"
    assert not seen.of(0x081)
    assert abs(drive.true_position - target) <= 400 + CLOSE
    # Two periods without data: alarm A 69, and the drive coasts.
    emergency = seen.wait(0x081)[0]
    assert emergency == bytes([0x69, 0x81, 0x11, 0, 0, 0, 0, 0])
    drive.wait_state("Fault")
    assert drive.read(0x603F) == 0x8169
    drive.reset_fault()
    assert seen.wait(0x081, 2)[1] == bytes(8)


@pytest.mark.parametrize("method, home", [(1, -30 * TURN + 2500), (4, TURN + 2500), (17, -30 * TURN), (19, SWITCH[0])])
def test_homing(drive, method, home):
    """Ch. 9.5, with the two speeds and the acceleration that the example omits."""
    drive.home(method, fast=6000, slow=300, acceleration=20_000)
    assert abs(drive.true_position - drive.position - home) <= 8


def test_homing_that_is_not_possible(start_line, connect, eds):
    """Methods with the index need an incremental encoder (ch. 7.2)."""
    line = start_line(PRONETS.replace("counts_per_revolution = 10000\n", "counts_per_revolution = 131072\n"))
    drive = Pronet(connect(line), 1, line, eds("pronet"))
    drive.set_mode(HOMING)
    drive.write(0x6098, 4)
    drive.write(0x6099, 1000, 1)
    drive.write(0x6099, 100, 2)
    drive.write(0x609A, 10_000)
    drive.enable()
    before = drive.true_position
    drive.control(0x1F)
    drive.wait_bits(BIT_13 | BIT_12, BIT_13)
    assert drive.true_position == before
    with pytest.raises(canopen.SdoAbortedError) as refused:
        drive.write(0x6098, 33)
    assert refused.value.code == 0x06090030


def test_switches_committed_by_the_bus(drive):
    """Ch. 10.1: POT, NOT and the reference switch come from 60FEh:01."""
    drive.write(0x3084, 0x1100)  # Pn512: CN1_16, CN1_17
    drive.write(0x3085, 0x0001)  # Pn513: CN1_39
    for bit, input_bit in ((27, 0), (26, 1), (28, 2)):
        drive.write(0x60FE, 1 << bit, 1)
        wait_for(lambda: drive.read(0x60FD) == 1 << input_bit, f"input {input_bit}")
    drive.write(0x60FE, 0, 1)
    wait_for(lambda: drive.read(0x60FD) == 0, "no input")
    # Its positive limit stops the axis without an alarm.
    drive.set_mode(PROFILE_VELOCITY)
    drive.enable()
    drive.write(0x60FF, 1000)
    wait_for(lambda: drive.bench.axis("one")["velocity_rpm"] > 90, "100 rpm")
    drive.network.seen.clear()
    drive.write(0x60FE, 1 << 26, 1)
    assert drive.network.seen.wait(0x081)[0][:3] == bytes([0x81, 0x86, 0x21])
    drive.wait_standstill()
    assert drive.state == "Operation enabled"
    assert drive.statusword & 0x0880 == 0x0880
    drive.write(0x60FE, 0, 1)
    drive.wait_bits(0x0880, 0)


def test_one_frame_serves_two_drives(pair):
    """Ch. 10.2: each drive maps a dummy at the place of the other's set-point."""
    one, two = pair
    one.map(0x1600, 0x60FF0020, 0x00040020)
    two.map(0x1600, 0x00040020, 0x60FF0020)
    two.write(0x1400, 0x80000201, 1)
    two.write(0x1400, 0x00000201, 1)
    for drive in pair:
        drive.silence()
        drive.set_mode(PROFILE_VELOCITY)
        drive.enable()
    one.network.nmt.send_command(1)
    one.network.send(0x201, struct.pack("<ii", 1500, -2500))
    wait_for(lambda: abs(one.bench.axis("one")["velocity_rpm"] - 150) < 2, "150 rpm")
    wait_for(lambda: abs(one.bench.axis("two")["velocity_rpm"] + 250) < 2, "-250 rpm")


def test_parameters_outlive_the_power(drive):
    drive.write(0x3022, 4711)
    drive.write(0x6081, 4711)
    drive.bench.post("axes/one/power", {"action": "off"})
    drive.network.seen.clear()
    drive.bench.post("axes/one/power", {"action": "on"})
    drive.network.seen.wait(0x701)
    assert drive.read(0x3022) == 4711
    assert drive.read(0x6081) == 0


@pytest.mark.program("the program moves the axis")
def test_revolutions_are_those_of_the_encoder(drive, pronets):
    """Ch. 4: the command line reads the resolution of the connected motor."""
    before = drive.true_position
    servodrome("move", "--bus", pronets.links["can0"][0], "--node", 1, "--by", 1.5, "--revolutions", "--velocity", 5)
    wait_for(lambda: abs(drive.true_position - before - 1.5 * TURN) <= CLOSE, "one and a half turns")
    shown = servodrome("monitor", "--bus", pronets.links["can0"][0], "--node", 1, "--axis", "--units", "degrees", "--seconds", "0.2")
    assert "540.0" in shown or "539.9" in shown


@pytest.mark.remote_frames
def test_remote_frames_are_not_answered(drive):
    """Ch. 3. The heartbeat replaces node guarding."""
    drive.silence()
    drive.network.nmt.send_command(1)
    drive.network.settle(1)
    drive.network.seen.clear()
    for identifier in (0x181, 0x281, 0x701):
        drive.network.send(identifier, remote=True)
    drive.network.settle(1)
    drive.network.quiet()
    assert not [frame for identifier in (0x181, 0x281, 0x701) for frame in drive.network.seen.of(identifier) if not frame.is_remote_frame]
    drive.write(0x1017, 20)
    assert drive.network.seen.wait(0x701, 3)[-1] == b"\x05"
