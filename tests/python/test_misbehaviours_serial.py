"""Misbehaviours on serial lines: Modbus RTU observed by pymodbus, the 10-byte protocol by pyserial, in virtual time;
Modbus TCP by pymodbus in real time, because sockets have no virtual time."""

import time

import pytest
import servodrome
from conftest import ROOT
from misbehaviours import Case, check, text_of
from test_serial_port import device

serial = pytest.importorskip("serial")
pymodbus = pytest.importorskip("pymodbus.client")

from pymodbus.exceptions import ModbusException  # noqa: E402
from servodrome.serial_port import SerialPort  # noqa: E402

LINES = ROOT / "scenarios/lines"
BUS = "rs485a"
STATUSWORD, MODE, MODE_DISPLAY = 0x0100, 0x0001, 0x0101  # registers of the reference drive
NO_ANSWER = "no answer"
READ_STATUSWORD = bytes.fromhex("01 03 01 00 00 01 85 F6")
ANSWER = "01 03 02 02 40 B8 D4"  # Switch on disabled
READ_ALARM = bytes.fromhex("01 40 3F 60 00 00 00 00 00 20")
ALARM = "01 4B 3F 60 00 00 00 00 00 15"  # 603Fh = 0


class Modbus:
    """A program on pymodbus."""

    def __init__(self, client):
        self.client = client

    def __enter__(self):
        assert self.client.connect()
        return self

    def __exit__(self, *_):
        self.client.close()

    def ask(self, function, *arguments, **options):
        try:
            answer = function(*arguments, **options, **device(1))
        except (ModbusException, OSError):  # an immediately reset connection raises OSError
            return NO_ANSWER
        if answer.isError():
            return f"exception {answer.exception_code}"
        return answer.registers[:1] or "done"

    def read(self, register=STATUSWORD):
        return self.ask(self.client.read_holding_registers, register, count=1)

    def write(self, register, value):
        return self.ask(self.client.write_registers, register, [value])


def rtu(line):
    return Modbus(pymodbus.ModbusSerialClient(port=f"servodrome://{BUS}", baudrate=115200, timeout=0.3, retries=0))


class Characters:
    """A program on pyserial."""

    def __init__(self, line):
        self.port = SerialPort(BUS, 115200, timeout=0.2, line=line)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.port.close()

    def receive(self, seconds):
        """Returns (ms since the call, characters) of each burst: characters with less than 1 ms between them."""
        begin, bursts = time.monotonic(), []
        while (left := begin + seconds - time.monotonic()) > 0:
            self.port.timeout = left
            one = self.port.read(1)
            now = (time.monotonic() - begin) * 1000
            if one and bursts and now - bursts[-1][1] < 1:
                bursts[-1] = (bursts[-1][0], now, bursts[-1][2] + one)
            elif one:
                bursts.append((now, now, one))
        return [(round(first), data.hex(" ").upper()) for first, _, data in bursts]


def asks(request):
    """Returns the characters within 200 ms after a request, burst by burst."""

    def look(client):
        client.port.write(request)
        client.port.flush()
        return [data for _, data in client.receive(0.2)]

    return look


def times(request):
    """Returns the ms at which the bursts come."""

    def look(client):
        client.port.write(request)
        client.port.flush()
        return [at for at, _ in client.receive(0.2)]

    return look


def listens(client):
    return [data for _, data in client.receive(0.1)]


def writes_mode(client):
    """Returns the answer to a write of the mode, and the mode that the drive shows afterwards."""
    answer = client.write(MODE, 3)
    time.sleep(0.05)
    return answer, client.read(MODE_DISPLAY)


def reads_over_a_new_connection(client):
    client.client.close()
    client.client.connect()
    return client.read()


ON_ANSWER = 'on = { message = "answer" }\n'

RTU = {
    "withhold": Case(f'{ON_ANSWER}do = "withhold"', Modbus.read, NO_ANSWER),
    "withhold a request": Case('on = { message = "request", function = 16 }\ndo = "withhold"', writes_mode, (NO_ANSWER, [0])),
    "alter": Case(f'{ON_ANSWER}do = "alter"\nbyte = -1\nxor = 0xFF', Modbus.read, NO_ANSWER),
    "alter with a checksum": Case(f'{ON_ANSWER}do = "alter"\nbyte = 4\nset = 0x08\nchecksum = true', Modbus.read, [0x0208]),
    "truncate": Case(f'{ON_ANSWER}do = "truncate"\nlength = 4', Modbus.read, NO_ANSWER),
    "abort": Case(f'{ON_ANSWER}do = "abort"\ncode = 6', Modbus.read, "exception 6"),
    "abort of a request": Case('on = { message = "request", function = 16 }\ndo = "abort"\ncode = 4', writes_mode, ("exception 4", [0])),
    "cable": Case('do = "cable"\nconnected = false', Modbus.read, NO_ANSWER),
    "power": Case('do = "power"\non = false', Modbus.read, NO_ANSWER),
    "show": Case('do = "show"\nobject = "6041"\nset_bits = 8', Modbus.read, [0x0248]),
    "ignore": Case('do = "ignore"\nobject = "6060"', writes_mode, ("done", [0])),
}

RTU_CHARACTERS = {
    "delay": Case(f'{ON_ANSWER}do = "delay"\nms = 50', times(READ_STATUSWORD), [52]),
    "repeat": Case(f'{ON_ANSWER}do = "repeat"\ngap_ms = 20', asks(READ_STATUSWORD), [ANSWER, ANSWER]),
    "replace": Case(f'{ON_ANSWER}do = "replace"\ndata = "01 83 02 C0 F1"', asks(READ_STATUSWORD), ["01 83 02 C0 F1"]),
    "extend": Case(f'{ON_ANSWER}do = "extend"\ndata = "AA"', asks(READ_STATUSWORD), [f"{ANSWER} AA"]),
    "extend before": Case(
        f'{ON_ANSWER}do = "extend"\ndata = "AA"\nbefore = true\ngap_ms = 5', asks(READ_STATUSWORD), ["AA", ANSWER]
    ),
    "slow": Case(f'{ON_ANSWER}do = "slow"\ngap_ms = 10', asks(READ_STATUSWORD), ANSWER.split()),
    "send": Case(
        f'when = {{ time_ms = 1 }}\nbus = "{BUS}"\ndo = "send"\ndata = "55 AA"\nperiod_ms = 20\ntimes = 3', listens, ["55 AA"] * 3
    ),
}

SERIAL10 = {
    "withhold": Case(f'{ON_ANSWER}do = "withhold"', asks(READ_ALARM), []),
    "alter": Case(f'{ON_ANSWER}do = "alter"\nbyte = -1\nset = 0', asks(READ_ALARM), [ALARM[:-2] + "00"]),
    "abort": Case(f'{ON_ANSWER}do = "abort"\ncode = 0x06020000', asks(READ_ALARM), ["01 80 3F 60 00 00 00 02 06 D8"]),
    "show": Case('do = "show"\nobject = "603F"\nvalue = 1', asks(READ_ALARM), ["01 4B 3F 60 00 01 00 00 00 14"]),
}

TCP = {
    "close": Case(f'{ON_ANSWER}do = "close"\nlength = 5', Modbus.read, NO_ANSWER),
    "accept": Case(f'bus = "{BUS}"\ndo = "accept"\non = false', reads_over_a_new_connection, NO_ANSWER),
    "alter": Case(f'{ON_ANSWER}do = "alter"\nbyte = 1\nxor = 0xFF', Modbus.read, NO_ANSWER),
    "abort": Case(f'{ON_ANSWER}do = "abort"\ncode = 6', Modbus.read, "exception 6"),
}


@pytest.mark.parametrize("name", RTU)
def test_pymodbus_sees(name):
    check(LINES / "rtu.toml", rtu, RTU[name])


@pytest.mark.parametrize("name", RTU_CHARACTERS)
def test_pyserial_sees_of_modbus(name):
    check(LINES / "rtu.toml", Characters, RTU_CHARACTERS[name])


@pytest.mark.parametrize("name", SERIAL10)
def test_pyserial_sees_of_the_ten_byte_protocol(name):
    check(LINES / "kinco.toml", Characters, SERIAL10[name])


@pytest.fixture(scope="module")
def tcp_line(program):
    with servodrome.Line.from_file(LINES / "tcp.toml", clock="real", program=program, links={BUS: "tcp:127.0.0.1:0"}) as line:
        yield line


@pytest.mark.parametrize("name", TCP)
def test_pymodbus_sees_over_tcp(tcp_line, name):
    _, host, port = tcp_line.buses[BUS].link.split(":")
    case = TCP[name]
    with Modbus(pymodbus.ModbusTcpClient(host, port=int(port), timeout=0.5, retries=0)) as client:
        assert case.look(client) != case.seen
        with tcp_line.scenario(text=text_of(case.rules)) as scenario:
            assert case.look(client) == case.seen
            assert scenario.rules["rule 1"].acts
