"""Masters on Linux operate drives in the program for Windows, and its commands are masters themselves."""

import contextlib
import json
import os
import pathlib
import socket
import struct
import subprocess
import urllib.request

import pytest
from bus import Network
from conftest import LINE
from drive402 import PROFILE_POSITION, Drive402
from line import COUNTS, PATIENCE, START, axis_text, bus_text, wait_for
from pymodbus.client import ModbusSerialClient, ModbusTcpClient
from wine import PROGRAM, ROOT, Cable, WindowsLine

CLOSE = 20  # counts between a target and the shaft at rest
LINUX_PROGRAM = pathlib.Path(os.environ.get("SERVODROME") or ROOT / "build/release/src/app/servodrome")


@pytest.fixture(scope="session")
def eds(wine, tmp_path_factory):
    """Returns the reference drive's EDS, exported by the program for Windows."""
    file = tmp_path_factory.mktemp("eds") / "generic402.eds"
    file.write_text(wine.run(PROGRAM, "export", "eds", "generic402"))
    return str(file)


@contextlib.contextmanager
def network_on(link):
    network = Network(link)
    try:
        yield network
    finally:
        network.disconnect()


def move(drive):
    """Enables the drive and moves it one revolution in each direction."""
    drive.wait_state("Switch on disabled")  # 6041h
    drive.set_mode(PROFILE_POSITION)
    drive.set_ramps()
    drive.enable()
    begin, true_begin = drive.position, drive.true_position
    for target in (COUNTS, 0):
        drive.move_to(begin + target)
        assert abs(drive.true_position - true_begin - target) <= CLOSE
    drive.disable()


def test_canopen_moves_a_drive_over_socketcand(line, eds):
    with network_on(line.links["can0"][0]) as network:
        move(Drive402(network.add_node(2, eds), line.bench, "reference"))


def test_canopen_moves_a_drive_over_slcan_on_a_com_port(wine, start_line, eds):
    cable = Cable()
    wine.connect_port("COM5", cable.one)
    line = start_line(
        bus_text("can0") + 'links = ["slcan:COM5"]\n' + axis_text("reference", "generic402", bus="can0", node=2)
    )
    with network_on(f"slcan:{cable.other}") as network:
        move(Drive402(network.add_node(2, eds), line.bench, "reference"))


def test_the_commands_are_masters_over_slcan(wine, start_line):
    cable = Cable()
    wine.connect_port("COM5", cable.one)
    wine.connect_port("COM6", cable.other)
    line = start_line(
        bus_text("can0") + 'links = ["slcan:COM5"]\n' + axis_text("reference", "generic402", bus="can0", node=2)
    )
    begin = line.bench.true_position("reference")
    wine.run(PROGRAM, "move", "--bus", "slcan:COM6", "--node", "2", "--by", "1", "--units", "revolutions")
    wait_for(lambda: abs(line.bench.true_position("reference") - begin - COUNTS) <= CLOSE, "the shaft at the target")


def udp_port(line):
    return int(line.links["ecat"][0].rpartition(":")[2])


def brd(index, address, size):
    """Returns a frame with one BRD datagram (ETG.1000.4 clause 5.4)."""
    datagram = struct.pack("<BBHHHH", 7, index, 0, address, size, 0) + bytes(size + 2)
    return struct.pack("<H", len(datagram) | 1 << 12) + datagram


def test_a_frame_in_udp_returns_with_its_working_counter(line):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as master:
        master.settimeout(PATIENCE)
        for index in range(100):
            sent = brd(index, 0x0130, 2)  # AL status
            master.sendto(sent, ("127.0.0.1", udp_port(line)))
            answer, _ = master.recvfrom(2048)
            assert len(answer) == len(sent)
            assert answer[3] == index
            assert struct.unpack_from("<HH", answer, 12) == (1, 1), "INIT, and one slave"


@pytest.mark.skipif(not LINUX_PROGRAM.is_file(), reason=f"{LINUX_PROGRAM} is missing; run tools/build")
def test_an_ethercat_master_on_linux_moves_a_slave(line):
    begin = line.bench.true_position("slave")
    command = [LINUX_PROGRAM, "move", "--bus", line.links["ecat"][0], "--by", "1", "--units", "revolutions", "--json"]
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert abs(line.bench.true_position("slave") - begin - COUNTS) <= CLOSE


def reads_and_writes(client, wine):
    """A client of pymodbus reads the reference drive's statusword and writes its profile velocity."""
    rows = (row.split(",") for row in wine.run(PROGRAM, "export", "modbus", "generic402").splitlines()[1:])
    registers = {f"{int(row[2], 16):04X}:{int(row[3], 16):X}": int(row[0], 16) for row in rows}
    assert client.connect()
    try:

        def statusword():
            answer = client.read_holding_registers(registers["6041:0"], count=1, device_id=2)
            assert not answer.isError(), answer
            return answer.registers[0]

        wait_for(lambda: statusword() & 0x4F == 0x40, "Switch on disabled")
        velocity = registers["6081:0"]
        assert not client.write_registers(velocity, [0x4240, 0x000F], device_id=2).isError()
        assert client.read_holding_registers(velocity, count=2, device_id=2).registers == [0x4240, 0x000F]
    finally:
        client.close()


def test_pymodbus_reads_and_writes_over_tcp(wine, line):
    port = int(line.links["rs"][0].rpartition(":")[2])
    reads_and_writes(ModbusTcpClient("127.0.0.1", port=port, timeout=PATIENCE, retries=0), wine)


def test_pymodbus_reads_and_writes_over_a_com_port(wine, start_line):
    cable = Cable()
    wine.connect_port("COM5", cable.one)
    start_line(
        bus_text("rs", "rs485")
        + 'links = ["serial:COM5"]\nsilence_ms = 20\n'
        + axis_text("reference", "generic402", serial="rs", node=2)
    )
    reads_and_writes(ModbusSerialClient(cable.other, baudrate=115200, timeout=PATIENCE, retries=0), wine)


def test_the_page_and_the_api_answer(line):
    with urllib.request.urlopen(line.ready["studio"], timeout=PATIENCE) as response:
        assert response.headers["Content-Type"].startswith("text/html")
        page = response.read().decode()
    assert "<script" in page
    for name in (part.split('"')[0] for part in page.split('src="')[1:]):
        with urllib.request.urlopen(line.ready["studio"] + name.lstrip("./"), timeout=PATIENCE) as response:
            assert response.status == 200
            assert len(response.read()) > 1000
    assert line.bench.axis("reference")["position_counts"] == START


def test_stored_parameters_survive(wine, line, eds, tmp_path):
    with network_on(line.links["can0"][0]) as network:
        node = network.add_node(2, eds)
        node.sdo[0x6081].raw = 123_456
        node.sdo[0x1010][1].raw = 0x65766173  # "save"
    line.stop()
    assert (tmp_path / "reference.bin").stat().st_size > 0
    again = WindowsLine(wine, tmp_path, LINE)
    try:
        with network_on(again.links["can0"][0]) as network:
            assert network.add_node(2, eds).sdo[0x6081].raw == 123_456
    finally:
        again.stop()


def test_a_store_in_use_and_a_port_in_use_are_refused(wine, line, tmp_path):
    said = wine.run(PROGRAM, "up", "line.toml", cwd=tmp_path, status=2)
    assert "reference.bin: is in use by another drive or process; stop it or choose another file" in said
    taken = line.links["can0"][0]
    (tmp_path / "taken.toml").write_text(
        bus_text("can0") + f'links = ["{taken}"]\n' + axis_text("reference", "generic402", bus="can0", node=2)
    )
    said = wine.run(PROGRAM, "up", "taken.toml", cwd=tmp_path, status=2)
    assert f'cannot listen on "{taken}"' in said
    assert "another program has port" in said


@pytest.mark.parametrize(
    ("bus", "axis", "steps"),
    [
        ("can0", "reference", ["--node", "2"]),
        ("ecat", "slave", []),
        ("rs", "reference", ["--node", "2", "--product", "generic402"]),
    ],
)
def test_the_commands_are_masters(wine, line, bus, axis, steps):
    prefix = "modbus:" if bus == "rs" else ""
    begin = line.bench.true_position(axis)
    wine.run(PROGRAM, "move", "--bus", prefix + line.links[bus][0], *steps, "--by", "1", "--units", "revolutions")
    wait_for(lambda: abs(line.bench.true_position(axis) - begin - COUNTS) <= CLOSE, "the shaft at the target")


@pytest.mark.parametrize(
    ("link", "instead"),
    [("raw:eth0", "use udp:127.0.0.1:34980"), ("socketcan:can0", "use socketcand:127.0.0.1:29536/can0")],
)
def test_links_that_windows_does_not_have_are_refused(wine, link, instead):
    said = wine.run(PROGRAM, "up", "--bus", f"{'ecat' if link.startswith('raw') else 'can0'}={link}", status=2)
    assert "is not available on Windows" in said
    assert instead in said


def test_the_help_does_not_offer_them(wine):
    text = wine.run(PROGRAM, "up", "--help") + wine.run(PROGRAM, "sniff", "--help") + wine.run(PROGRAM, "move", "--help")
    assert "socketcand:HOST:PORT/BUS" in text
    for absent in ("raw:", "socketcan:", "pty:"):
        assert absent not in text


def test_the_ports_of_the_computer_are_listed(wine):
    wine.connect_port("COM5", Cable().one)
    buses = json.loads(wine.run(PROGRAM, "scan", "--buses", "--json"))["buses"]
    assert any("serial:COM5" in bus["bus"] for bus in buses)
