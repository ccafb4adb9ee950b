"""pymodbus, mbpoll and pyserial as masters of drives on an RS485 line: over a pty (RTU) and over Modbus TCP."""

import contextlib
import json
import re
import subprocess
import threading

import pytest
import serial
from line import PATIENCE, Line, servodrome, wait_for
from pymodbus.client import ModbusSerialClient, ModbusTcpClient
from pymodbus.exceptions import ModbusException

pytestmark = pytest.mark.once  # the behaviour of drives does not depend on the link

FOUR_DRIVES = """
[[bus]]
name = "can0"

[[bus]]
name = "rs"
type = "rs485"
""" + "".join(
    f"""
[[axis]]
name = "{name}"
product = "{product}"
bus = "can0"
serial = "rs"
node = {node}
{'serial_protocol = "modbus"' if product == "ismk" else ""}
"""
    for name, product, node in (("k1", "ismk", 1), ("r2", "generic402", 2), ("k3", "ismk", 3), ("r4", "generic402", 4))
)
JMC = """
[[bus]]
name = "rs"
type = "rs485"

[[axis]]
name = "j1"
product = "jmc_ec"
serial = "rs"
"""

FACTORY_ISMK = """
[[bus]]
name = "rs"
type = "rs485"

[[axis]]
name = "k1"
product = "ismk"
serial = "rs"
"""
RPM = 512 * 65536 / 1875  # the iSMK's velocity unit (ch. 7.2)

# Registers of the iSMK (ch. 7, 'Object list') ...
ISMK = {"controlword": 0x3100, "statusword": 0x3200, "mode": 0x3500, "position": 0x3700, "target_position": 0x4000,
        "profile_velocity": 0x4A00, "homing_method": 0x4D00, "homing_speed": 0x5010, "zero_speed": 0x5020,
        "target_velocity": 0x6F00}


def reference_registers():
    """... and of the reference drive, from its export: {"6081:0": address}."""
    rows = servodrome("export", "modbus", "generic402").splitlines()[1:]
    registers = {}
    for row in rows:
        address, _, index, sub = row.split(",")[:4]
        registers.setdefault(f"{int(index, 16):04X}:{int(sub, 16)}", int(address, 16))
    return registers


@pytest.fixture
def start_serial_line(tmp_path, lines):
    """start_serial_line(TOML): starts a line whose RS485 line `rs` is on a pty and on a TCP port."""

    def start(text=FOUR_DRIVES, buses=()):
        folder = tmp_path / f"serial{len(lines)}"
        folder.mkdir()
        line = Line(folder, text, [f"rs=pty:{folder}/rs", "rs=tcp:127.0.0.1:0", *buses])
        lines.append(line)
        return line

    return start


@pytest.fixture
def serial_line(start_serial_line):
    return start_serial_line()


def pty_of(line):
    return line.links["rs"][0].removeprefix("pty:")


def port_of(line):
    return int(line.links["rs"][1].rpartition(":")[2])


@contextlib.contextmanager
def modbus(line, link):
    """A pymodbus client of the line."""
    if link == "pty":
        client = ModbusSerialClient(pty_of(line), baudrate=115200, parity="N", timeout=PATIENCE, retries=0)
    else:
        client = ModbusTcpClient("127.0.0.1", port=port_of(line), timeout=PATIENCE, retries=0)
    assert client.connect()
    try:
        yield client
    finally:
        client.close()


class Station:
    """Registers of a station; 32-bit numbers have the product's word order."""

    def __init__(self, client, station, low_word_first):
        self.client = client
        self.station = station
        self.low_word_first = low_word_first

    def read(self, address, words=1):
        response = self.client.read_holding_registers(address, count=words, device_id=self.station)
        assert not response.isError(), response
        return response.registers

    def read32(self, address):
        first, second = self.read(address, 2)
        value = second << 16 | first if self.low_word_first else first << 16 | second
        return value - (1 << 32) if value >> 31 else value

    def write(self, address, value):
        response = self.client.write_register(address, value, device_id=self.station)
        assert not response.isError(), response

    def write32(self, address, value):
        words = [value & 0xFFFF, value >> 16 & 0xFFFF]
        response = self.client.write_registers(
            address, words if self.low_word_first else words[::-1], device_id=self.station)
        assert not response.isError(), response


LINKS = pytest.mark.parametrize("link", ["pty", "tcp"])


@LINKS
def test_pymodbus_reads_and_writes_an_ismk(serial_line, link):
    with modbus(serial_line, link) as client:
        drive = Station(client, 1, low_word_first=True)
        assert drive.read(ISMK["statusword"])[0] & 0x6F == 0x21
        word, extension = drive.read(ISMK["statusword"], 2)
        assert extension == (0xFFFF if word & 0x8000 else 0)
        assert drive.read(ISMK["mode"]) == [0xFFFC]
        drive.write(ISMK["mode"], 3)
        assert drive.read(ISMK["mode"], 2) == [3, 0]
        drive.write32(ISMK["target_velocity"], 0x0028F5C3)  # 150 rpm (Table 8-1)
        assert drive.read(ISMK["target_velocity"], 2) == [0xF5C3, 0x0028]
        assert serial_line.bench.get("axes/k1/objects/60FF/0")["value"] == 0x0028F5C3
        for refused in (
            client.write_register(ISMK["mode"], 8, device_id=1),
            client.write_register(ISMK["statusword"], 1, device_id=1),
            client.write_register(0x1234, 1, device_id=1),
            client.read_input_registers(ISMK["statusword"], count=1, device_id=1),
        ):
            assert refused.isError()
        # The other drives have not received it.
        assert serial_line.bench.get("axes/k3/objects/6060/0")["value"] == -4


def home(drive, line, axis):
    """The manual's procedure (Table 8-1)."""
    drive.write(ISMK["mode"], 6)
    drive.write(ISMK["homing_method"], 33)
    drive.write32(ISMK["homing_speed"], round(200 * RPM))
    drive.write32(ISMK["zero_speed"], round(150 * RPM))
    drive.write(ISMK["controlword"], 0x0F)
    drive.write(ISMK["controlword"], 0x1F)
    homed = 1 << 15
    wait_for(lambda: drive.read(ISMK["statusword"])[0] & homed, lambda: f"homing: {line.bench.axis(axis)}")
    drive.write(ISMK["controlword"], 0x0F)
    assert not drive.read(ISMK["statusword"])[0] & 1 << 12, "homing error"
    wait_for(lambda: abs(drive.read32(ISMK["position"])) < 100, "position 0 at the index")


def move(drive):
    """The manual's procedure (Table 8-1): moves to 50000, then by 50000."""
    drive.write(ISMK["mode"], 1)
    drive.write32(ISMK["target_position"], 50000)
    drive.write32(ISMK["profile_velocity"], round(300 * RPM))
    drive.write(ISMK["controlword"], 0x0F)
    drive.write(ISMK["controlword"], 0x2F)
    drive.write(ISMK["controlword"], 0x3F)
    wait_for(lambda: abs(drive.read32(ISMK["position"]) - 50000) < 100, "position 50000")
    drive.write(ISMK["controlword"], 0x4F)
    drive.write(ISMK["controlword"], 0x5F)
    wait_for(lambda: abs(drive.read32(ISMK["position"]) - 100000) < 100, "50000 more")
    drive.write(ISMK["controlword"], 0x06)


@LINKS
def test_pymodbus_homes_and_moves_an_ismk(serial_line, link):
    with modbus(serial_line, link) as client:
        drive = Station(client, 1, low_word_first=True)
        home(drive, serial_line, "k1")
        move(drive)
        other = Station(client, 3, low_word_first=True)
        assert abs(other.read32(ISMK["position"])) < 100, "the other iSMK has not moved"


def test_an_ismk_from_the_factory_speaks_the_ten_byte_protocol(start_serial_line):
    line = start_serial_line(FACTORY_ISMK)

    def frame(text):
        return bytes.fromhex(text)

    with serial.Serial(pty_of(line), 115200, timeout=PATIENCE) as port:

        def ask(request):
            port.write(request)
            return port.read(10)

        assert ask(frame("01 2B F0 2F 09 58 02 00 00 52")) == frame("01 60 F0 2F 09 58 02 00 00 1D")
        assert ask(frame("01 40 F0 2F 09 00 00 00 00 97")) == frame("01 4B F0 2F 09 58 02 00 00 32")  # ch. 8.4.2
        assert ask(frame("7F 40 0B 10 00 00 00 00 00 26")) == frame("01 4B 0B 10 00 01 00 00 00 98")  # id 127
        # 6510.0C = 0 changes to Modbus immediately; the answer still uses the present protocol.
        assert ask(frame("01 2F 10 65 0C 00 00 00 00 4F")) == frame("01 60 10 65 0C 00 00 00 00 1E")
    with modbus(line, "tcp") as client:
        assert Station(client, 1, True).read(0x86C0) == [0]
    with modbus(line, "pty") as client:
        drive = Station(client, 1, low_word_first=True)
        assert drive.read(0x86C0) == [0]
        drive.write(0x86C0, 1)  # and back (ch. 8.1)
        client.comm_params.timeout_connect = 1  # for an answer that must not come
        with contextlib.suppress(ModbusException):
            assert client.read_holding_registers(0x86C0, count=1, device_id=1).isError()
    with modbus(line, "tcp") as client:
        response = client.read_holding_registers(0x86C0, count=1, device_id=1)
        assert response.exception_code == 0x0B, "nobody behind the gateway speaks Modbus"


@LINKS
def test_pymodbus_uses_every_function_of_the_reference_drive(serial_line, link):
    registers = reference_registers()
    with modbus(serial_line, link) as client:
        drive = Station(client, 2, low_word_first=False)
        velocity = registers["6081:0"]
        drive.write32(velocity, 123456)
        assert drive.read32(velocity) == 123456
        both = client.read_input_registers(velocity, count=2, device_id=2)
        assert both.registers == drive.read(velocity, 2)
        # Read and write in one request: controlword, and the cyclic block of actual values.
        answer = client.readwrite_registers(
            read_address=0x0100, read_count=8, write_address=0, values=[0x0006], device_id=2)
        assert not answer.isError() and len(answer.registers) == 8
        wait_for(lambda: drive.read(0x0100)[0] & 0x6F == 0x21, "ready to switch on")
        identity = client.read_device_information(read_code=2, device_id=2).information
        assert identity[0] == b"Servodrome" and identity[1] == b"generic402"
        assert client.read_holding_registers(0xFFF0, count=1, device_id=2).exception_code == 2
        assert client.write_register(0x0100, 1, device_id=2).exception_code == 2
        assert client.write_register(velocity, 1, device_id=2).exception_code == 3, "half of a number"
        assert client.read_coils(0, count=1, device_id=2).exception_code == 1


def test_a_broadcast_reaches_all(serial_line):
    with modbus(serial_line, "pty") as client:
        client.write_register(0x3500, 3, device_id=0, no_response_expected=True)
        for axis in ("k1", "k3"):
            wait_for(lambda name=axis: serial_line.bench.get(f"axes/{name}/objects/6060/0")["value"] == 3, axis)


def test_several_tcp_clients_of_one_drive(serial_line):
    """Each client writes its own gain and reads it back unchanged, regardless of the others."""
    registers = reference_registers()
    failures = []

    def work(sub):
        try:
            with modbus(serial_line, "tcp") as client:
                drive = Station(client, 4, low_word_first=False)
                for i in range(100):
                    drive.write(registers[f"2010:{sub}"], 9 * i + sub)
                    assert drive.read(registers[f"2010:{sub}"]) == [9 * i + sub]
        except BaseException as error:  # a failure in a thread must fail the test
            failures.append(error)

    threads = [threading.Thread(target=work, args=(sub,)) for sub in (6, 7, 9, 10, 12, 13)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not failures
    bus = next(bus for bus in serial_line.bench.get("buses")["buses"] if bus["name"] == "rs")
    assert sum(link["to_bus"] for link in bus["links"]) >= 1200


def mbpoll(line, link, station, address, *values, words=1, kind="4"):
    """One poll; the values read."""
    where = ["-m", "rtu", "-b", "115200", "-P", "none", pty_of(line)]
    if link == "tcp":
        where = ["-m", "tcp", "-p", port_of(line), "127.0.0.1"]
    command = ["mbpoll", "-0", "-1", "-a", station, "-r", address, "-t", kind, "-o", "5"]
    if not values:
        command += ["-c", words]
    command += where + (["--", *values] if values else [])
    result = subprocess.run([str(word) for word in command], capture_output=True, text=True, timeout=60, check=False)
    assert result.returncode == 0, f"{command}: {result.stdout}{result.stderr}"
    return [int(value) for value in re.findall(r"^\[\d+\]:\s+(-?\d+)", result.stdout, re.MULTILINE)]


@LINKS
def test_mbpoll_moves_an_ismk(serial_line, link):
    def poll(*arguments, **options):
        return mbpoll(serial_line, link, 3, *arguments, **options)

    assert poll(ISMK["statusword"])[0] & 0x6F == 0x21
    poll(ISMK["mode"], 1)
    assert poll(ISMK["mode"]) == [1]
    poll(ISMK["target_position"], -40000, kind="4:int")  # the drive's word order: low word first
    assert poll(ISMK["target_position"], kind="4:int") == [-40000]
    poll(ISMK["profile_velocity"], round(300 * RPM), kind="4:int")
    poll(ISMK["controlword"], 0x0F)
    poll(ISMK["controlword"], 0x2F)
    poll(ISMK["controlword"], 0x3F)
    wait_for(lambda: abs(poll(ISMK["position"], kind="4:int")[0] + 40000) < 100, "position -40000")
    wait_for(lambda: abs(serial_line.bench.true_position("k3") + 40000) < 100, "the shaft as well")


@LINKS
def test_mbpoll_reads_the_reference_drive(serial_line, link):
    velocity = reference_registers()["6081:0"]
    mbpoll(serial_line, link, 2, velocity, 1, 2)
    assert serial_line.bench.get("axes/r2/objects/6081/0")["value"] == 0x10002
    assert mbpoll(serial_line, link, 2, velocity, words=2) == [1, 2]


@pytest.mark.program("the RS485 line is on a pty")
def test_four_drives_on_a_serial_line_and_a_can_bus(start_line, connect, tmp_path):
    """One client moves two of them over the serial line while another moves the other two over CAN."""
    line = start_line(FOUR_DRIVES, arguments=["--bus", f"rs=pty:{tmp_path}/rs"])
    network = connect(line)
    failures = []

    def serial_master():
        try:
            with modbus(line, "pty") as client:
                for station in (1, 3):
                    move(Station(client, station, low_word_first=True))
        except BaseException as error:
            failures.append(error)

    thread = threading.Thread(target=serial_master)
    thread.start()
    drives = [network.add_node(node) for node in (2, 4)]
    for node in drives:
        node.sdo.RESPONSE_TIMEOUT = PATIENCE
        for word in (6, 7, 15):
            node.sdo.download(0x6040, 0, word.to_bytes(2, "little"))
        node.sdo.download(0x6060, 0, bytes([1]))
    for target in (200000, -100000):
        for node in drives:
            node.sdo.download(0x607A, 0, target.to_bytes(4, "little", signed=True))
            node.sdo.download(0x6040, 0, (0x0F).to_bytes(2, "little"))
            node.sdo.download(0x6040, 0, (0x3F).to_bytes(2, "little"))
        for node in drives:
            position = lambda sdo=node.sdo: int.from_bytes(sdo.upload(0x6064, 0)[:4], "little", signed=True)
            wait_for(lambda: abs(position() - target) < 100, f"position {target}")
    thread.join()
    assert not failures
    buses = {bus["name"]: bus for bus in line.bench.get("buses")["buses"]}
    assert buses["rs"]["collisions"] == 0
    assert buses["can0"]["errors"] == 0


@LINKS
def test_the_commands_work_over_modbus(serial_line, link):
    bus = "modbus:" + serial_line.links["rs"][0 if link == "pty" else 1]
    ismk = ["--bus", bus, "--node", 1, "--product", "ismk"]
    reference = ["--bus", bus, "--node", 2]
    stations = json.loads(servodrome("scan", "--bus", bus, "--last", 5, "--timeout", 3, "--json"))["nodes"]
    assert [(station["node"], station["name"]) for station in stations] == [
        (1, ""), (2, "generic402"), (3, ""), (4, "generic402")]
    assert [(station["recognised_as"], station["recognised_by"]) for station in stations] == [
        ("ismk", "objects"), ("generic402", "identity")] * 2
    assert "Statusword" in servodrome("get", *reference, "6041")
    servodrome("set", *reference, "6081", 200000)
    assert json.loads(servodrome("get", *reference, "6081", "--json"))["value"] == 200000
    assert "homed" in servodrome("home", *reference, "--method", 35)
    assert "moved" in servodrome("move", *reference, "--by", 50000)
    assert "moved" in servodrome("move", *ismk, "--by", 30000, "--velocity", round(300 * RPM))
    wait_for(lambda: abs(serial_line.bench.true_position("k1") - 30000) < 100, "position 30000")
    assert "operation enabled" in servodrome("monitor", *ismk, "--axis", "--seconds", 0.2)
    scope = json.loads(servodrome("scope", *ismk, "--json", "--do", "enable", "--do", f"velocity {round(60 * RPM)}", "--do", "wait 0.5"))
    assert scope["way"] == "Modbus requests" and scope["rows"] > 3 and scope["problems"] == [], scope
    assert scope["channels"][0]["name"] == "position_actual_internal_value"
    positions = scope["channels"][0]["values"]
    assert max(positions) > positions[0] + 10000
    assert "give --product ismk" in servodrome("get", "--bus", bus, "--node", 1, "6041", status=2)
    watched = servodrome("monitor", *reference, "Target velocity", "6081", "--seconds", 0.3).splitlines()
    assert len(watched) == 2 and "6081:00 Profile velocity = 200000" in watched[1], watched
    assert "needs a CAN bus" in servodrome("nmt", "start", *reference, status=2)


def test_the_service_port_of_a_jmc_drive(start_serial_line, tmp_path):
    """Does the same as JmcServoPcControl: parameters by their numbers, monitoring items. The fieldbus moves the
    axis."""
    line = start_serial_line(JMC)
    plain = ["--bus", "modbus:" + line.links["rs"][1]]
    drive = [*plain, "--product", "jmc_ec"]
    assert "give --product jmc_ec" in servodrome("get", *plain, "P01-03", status=2)
    wait_for(lambda: "voltage = 36" in servodrome("get", *drive, "d23"), "a charged DC link")
    assert servodrome("get", *drive, "P01-03", "d23").splitlines() == [
        "2001:04 P01 Main control.P01-03 Rigidity level = 13 (000Dh)",
        "200D:18 d Monitoring items.d23 dcp main circuit voltage = 36",
    ]
    servodrome("set", *drive, "p01-03", 15)
    assert json.loads(servodrome("get", *drive, "2001:04", "--json"))["value"] == 15
    seen = [json.loads(row) for row in servodrome("monitor", *drive, "P01-03", "d08", "--json", "--seconds", 0.3).splitlines()]
    assert [(row["object"], row["value"], row["unit"]) for row in seen] == [("2001:04", 15, ""), ("200D:09", 0, "rpm")]
    for words in (["faults"], ["move", "--by", 1], ["home"], ["conform"], ["monitor", "--axis"]):
        said = servodrome(*words, *drive, status=2)
        assert "neither controlword nor statusword" in said and "on its EtherCAT" in said, said
    script = tmp_path / "j.script"
    script.write_text("axis j 1 product jmc_ec\nset P01-03 14\nexpect P01-03 == 14\nexpect d08 == 0\n")
    servodrome("run", *plain, script)
    script.write_text("axis j 1 product jmc_ec\nset P01-03 12\nenable\n")
    assert f"{script}:3:1: " in servodrome("run", *plain, script, status=2)
    assert "= 14" in servodrome("get", *drive, "P01-03 Rigidity level")
    script.write_text("axis j 1 product jcm\n")
    assert f"{script}:1:18: there is no product" in servodrome("run", *plain, script, status=2)
    assert "neither controlword" in servodrome("studio", *drive, status=2)
    assert "no object has this name" in servodrome("get", *drive, "P01-99", status=2)
    assert "not both" in servodrome("monitor", *drive, "d08", "--axis", status=2)


def test_the_commands_work_with_the_ten_byte_protocol(start_serial_line):
    line = start_serial_line(FACTORY_ISMK)
    bus = ["--bus", "serial10:" + line.links["rs"][0]]
    assert json.loads(servodrome("scan", *bus, "--last", 2, "--timeout", 3, "--json"))["nodes"][0]["node"] == 1
    servodrome("set", *bus, "6098", 33)
    assert json.loads(servodrome("get", *bus, "6098", "--json"))["value"] == 33
    assert "moved" in servodrome("move", *bus, "--by", 30000, "--velocity", round(300 * RPM))
    wait_for(lambda: abs(line.bench.true_position("k1") - 30000) < 100, "position 30000")
    assert "homed" in servodrome("home", *bus, "--method", 35), "by the status bits of the product that has this protocol"
    assert "refused" in servodrome("get", *bus, "5555", status=1)
    scope = json.loads(servodrome("scope", *bus, "position", "--rate", 20, "--seconds", 0.5, "--json"))
    assert scope["way"] == "requests of the 10-byte protocol" and scope["rows"] > 3
