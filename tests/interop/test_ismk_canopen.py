"""A third-party master operates the Kinco iSMK by the procedures of its manual (chapters 5 and 9)."""

import struct

import pytest
from drive402 import Drive402
from line import wait_for

pytestmark = pytest.mark.once  # the behaviour of drives does not depend on the link

TURN = 65536
LINE = """
[[bus]]
name = "can0"

[[axis]]
name = "one"
product = "ismk"
bus = "can0"
node = 1

[[axis]]
name = "two"
product = "ismk"
model = "40-010"
bus = "can0"
node = 2
"""
POSITION, SPEED, TORQUE, IMMEDIATE_SPEED, HOMING, INTERPOLATION = 1, 3, 4, -3, 6, 7
REACHED, BIT_12, HOME_FOUND = 1 << 10, 1 << 12, 1 << 15
LOW_BYTES = {"Disable": 0x70, "Ready": 0x31, "Running": 0x33, "Enabled": 0x37, "Quick stop": 0x50, "Fault": 0x38}


def speed(rpm):
    """The internal unit of speed (ch. 7.2, appendix II)."""
    return round(rpm * 512 * TURN / 1875)


def acceleration(rps_s):
    return round(rps_s * 65536 * TURN / 4_000_000)


class Ismk(Drive402):
    def __init__(self, network, node_id, line, eds):
        super().__init__(network.add_node(node_id, eds), line.bench, {1: "one", 2: "two"}[node_id])
        self.network = network

    @property
    def low_byte(self):
        return self.statusword & 0xFF

    def command(self, word, state):
        self.control(word)
        wait_for(lambda: self.low_byte == LOW_BYTES[state], lambda: f"{state}, is {self.statusword:04X}h")

    def commission(self):
        """Sets gains for a stiff axis: the factory gains are slow (Table 6-2)."""
        self.write(0x2FF0, 100, 0x0A)

    def raw_sdo(self, request):
        """Checks the answer to a frame of the manual, byte by byte."""
        self.network.seen.clear()
        self.network.send(0x600 + self.node.id, bytes.fromhex(request))
        return self.network.seen.wait(0x580 + self.node.id)[0].hex(" ").upper()


@pytest.fixture
def ismk_line(start_line):
    return start_line(LINE)


@pytest.fixture
def drives(ismk_line, connect, eds):
    network = connect(ismk_line)
    return [Ismk(network, node, ismk_line, eds("ismk")) for node in (1, 2)]


@pytest.fixture
def drive(drives):
    drives[0].commission()
    return drives[0]


def test_the_eds_names_what_the_manual_names(drive):
    sdo = drive.node.sdo
    assert sdo["Digital inputs and outputs"]["Zero_Speed_Window"].raw == 3
    assert sdo["Controlword"].raw == 6
    assert sdo["Modes of operation"].raw == -4
    assert sdo["Position loop"]["Kpp[0]"].raw == 1000
    assert sdo["Equipment station number"].raw == 1
    assert drive.low_byte == LOW_BYTES["Ready"]


def test_states_of_table_5_2(drive):
    for word, state in ((0x07, "Running"), (0x0F, "Enabled"), (0x07, "Running"), (0x06, "Ready"), (0x00, "Disable"),
                        (0x06, "Ready"), (0x0F, "Enabled"), (0x0B, "Disable"), (0x06, "Ready")):
        drive.command(word, state)
    drive.write(0x605A, 6)
    drive.command(0x0F, "Enabled")
    drive.command(0x02, "Quick stop")
    drive.command(0x0F, "Enabled")
    drive.command(0x02, "Quick stop")
    drive.command(0x06, "Ready")


def test_answers_repeat_the_request_and_uploads_the_sign(drive):
    assert drive.raw_sdo("23 99 60 01 03 9D 36 00") == "60 99 60 01 03 9D 36 00"
    assert drive.raw_sdo("2F 60 60 00 06 00 00 00") == "60 60 60 00 06 00 00 00"
    drive.write(0x2FF0, 600, 9)
    assert drive.raw_sdo("40 F0 2F 09 00 00 00 00") == "4B F0 2F 09 58 02 00 00"
    drive.write(0x2FF0, -600, 9)
    assert drive.raw_sdo("40 F0 2F 09 00 00 00 00") == "4B F0 2F 09 A8 FD FF FF"
    assert drive.raw_sdo("2B 41 60 00 00 00 00 00") == "80 41 60 00 02 00 01 06"


def home(drive, method=33):
    drive.write(0x6060, HOMING)
    drive.write(0x6098, method)
    drive.write(0x6099, speed(200), 1)
    drive.write(0x6099, speed(100), 2)
    drive.command(0x0F, "Enabled")
    drive.control(0x1F)
    drive.wait_bits(HOME_FOUND | BIT_12, HOME_FOUND)


def move(drive, target, start):
    """2Fh to 3Fh is absolute, 4Fh to 5Fh relative (Table 5-4)."""
    drive.write(0x607A, target)
    drive.control(start)
    drive.wait_bits(BIT_12, 0)
    drive.control(start | 0x10)
    drive.wait_bits(BIT_12 | REACHED, BIT_12 | REACHED)
    drive.control(start)


def test_homing_then_positions(drive):
    home(drive)
    index = drive.true_position
    assert index % TURN in (*range(66), *range(TURN - 65, TURN)), "at the index of the encoder"
    drive.control(0x2F)
    drive.write(0x6060, POSITION)
    drive.write(0x6081, speed(600))
    drive.write(0x6083, acceleration(100))
    drive.write(0x6084, acceleration(100))
    for target, start, place in ((50000, 0x2F, 50000), (50000, 0x4F, 100000), (-20000, 0x2F, -20000)):
        move(drive, target, start)
        assert abs(drive.read(0x6063) - place) <= 327
        assert abs(drive.true_position - index - place) <= 2 * 327
    # 103Fh: the axis follows every write of the target.
    drive.control(0x103F)
    for target in (30000, 5000):
        drive.write(0x607A, target)
        wait_for(lambda: abs(drive.read(0x6063) - target) <= 327, f"{target}")


def test_speeds(drive):
    drive.write(0x6060, SPEED)
    drive.write(0x60FF, speed(-100))
    drive.command(0x2F, "Enabled")
    drive.wait_bits(REACHED | BIT_12, REACHED)
    wait_for(lambda: abs(drive.read(0x606C) - speed(-100)) < speed(10), "-100 rpm")
    drive.write(0x2FF0, 300, 9)
    wait_for(lambda: abs(drive.read(0x606C) - speed(300)) < speed(10), "300 rpm")
    drive.write(0x6060, IMMEDIATE_SPEED)
    drive.write(0x60FF, 0)
    drive.wait_bits(BIT_12, BIT_12)


def test_pdos_of_the_example(drive):
    """TPDO 1: 6063h and 6041h, 6 bytes; RPDO 1 acts immediately (ch. 9.3.3.3)."""
    drive.write(0x1800, 0x80000181, 1)
    drive.write(0x1A00, 0, 0)
    drive.write(0x1A00, 0x60630020, 1)
    drive.write(0x1A00, 0x60410010, 2)
    drive.write(0x1A00, 2, 0)
    drive.write(0x1800, 1, 2)  # at every SYNC
    drive.write(0x1800, 0x181, 1)
    drive.write(0x6060, IMMEDIATE_SPEED)
    drive.write(0x60FF, speed(60))
    drive.network.nmt.state = "OPERATIONAL"
    drive.network.send(0x201, struct.pack("<H", 0x0F))
    wait_for(lambda: drive.low_byte == LOW_BYTES["Enabled"], "enabled by RPDO")
    drive.network.seen.clear()
    for count in range(1, 6):
        drive.network.send_sync()
        drive.network.seen.wait(0x181, count)
    positions = [struct.unpack("<iH", data)[0] for data in drive.network.seen.data(0x181)]
    assert len(positions) == 5 and positions == sorted(positions)


def test_interpolation_on_sync(drive):
    """9.5: 607Ah with every SYNC, here only as fast as the link can transfer it."""
    drive.write(0x3011, 3, 1)  # 8 ms
    drive.write(0x3011, 1, 2)
    drive.write(0x6060, INTERPOLATION)
    drive.write(0x1401, 0x80000301, 1)
    drive.write(0x1601, 0, 0)
    drive.write(0x1601, 0x607A0020, 1)
    drive.write(0x1601, 1, 0)
    drive.write(0x1401, 0x301, 1)
    drive.network.nmt.state = "OPERATIONAL"
    drive.command(0x0F, "Enabled")
    drive.command(0x1F, "Enabled")
    start = drive.read(0x6063)
    for step in range(1, 101):
        drive.network.send(0x301, struct.pack("<i", start + 200 * step))
        drive.network.send_sync()
    wait_for(lambda: abs(drive.read(0x6063) - start - 20000) <= 327, "the last target")
    drive.command(0x06, "Ready")


def test_torque_of_two_sizes(drives):
    """6071h has units of a thousandth of the rated torque, 60F6h:08 of 1/2048 of the peak current (ch. 7.3, appendix
    II)."""
    for drive, peak in zip(drives, (48, 18)):
        assert drive.read(0x6510, 3) == peak
        drive.bench.put(f"axes/{drive.name}/plant", {"locked_rotor": True})
        drive.write(0x6060, TORQUE)
        drive.write(0x60F6, 512, 8)
        drive.command(0x0F, "Enabled")
        wait_for(lambda d=drive: abs(d.read(0x6078) - 512) < 10, "a quarter of the peak current")
        drive.command(0x06, "Ready")


def test_tables_by_inputs(drive):
    """Ch. 5.2.1.1 and 5.4.1.1: inputs select the values in 2020h; the bus only enables."""

    def inputs(first, second):
        drive.bench.put(f"axes/{drive.name}/inputs", {"DI0": first, "DI1": second})

    inputs(False, False)
    drive.write(0x6081, speed(300))
    for number, target in enumerate((0, 40000, -20000, 70000)):
        drive.write(0x2020, target, 1 + number)
        drive.write(0x2020, speed(300), 5 + number)
    drive.write(0x2010, 0x0400, 3)  # input 1: position index 0
    drive.write(0x2010, 0x0800, 4)  # input 2: position index 1
    home(drive, 35)
    drive.write(0x6060, POSITION)
    drive.command(0x2F, "Enabled")
    for first, second, target in ((True, False, 40000), (True, True, 70000), (False, True, -20000), (False, False, 0)):
        inputs(first, second)
        wait_for(lambda t=target: abs(drive.read(0x6063) - t) <= 327, f"position {target}")

    for number, rpm in enumerate((0, 60, -120, 240)):
        drive.write(0x2020, speed(rpm), 5 + number)
    drive.write(0x2010, 0x0100, 3)  # speed index 0
    drive.write(0x2010, 0x0200, 4)  # speed index 1
    drive.write(0x6060, SPEED)
    for first, second, rpm in ((True, False, 60), (False, True, -120), (True, True, 240), (False, False, 0)):
        inputs(first, second)
        wait_for(lambda v=rpm: abs(drive.read(0x606C) - speed(v)) < speed(5), f"{rpm} rpm")
    drive.command(0x06, "Ready")


def test_storing_and_restarting(drive):
    drive.write(0x6083, 12345)
    drive.write(0x6081, 12345)
    drive.write(0x2FF0, 1, 1)
    drive.network.seen.clear()
    drive.write(0x2FFF, 0xAA55)
    drive.network.seen.wait(0x701)
    assert drive.read(0x6083) == 12345
    assert drive.read(0x6081) == 0
    assert drive.read(0x6060) == -4
