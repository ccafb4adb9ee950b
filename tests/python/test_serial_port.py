"""pyserial and pymodbus, unchanged, on an RS485 line of a line in this process."""

import threading
import time

import pytest
import servodrome

serial = pytest.importorskip("serial")

import serial.threaded  # noqa: E402
from servodrome.serial_port import SerialPort  # noqa: E402
from servodrome.virtual_time import virtual_time  # noqa: E402

CHARACTER_S = 10 / 115200
READ_SPEED = bytes.fromhex("01 40 F0 2F 09 00 00 00 00 97")  # iSMK manual, ch. 8.4.2
SPEED = bytes.fromhex("01 4B F0 2F 09 00 00 00 00 8C")
SPEED_AFTERWARDS = bytes.fromhex("01 4B F0 2F 09 58 02 00 00 32")
WRITE_SPEED = bytes.fromhex("01 2B F0 2F 09 58 02 00 00 52")
WRITTEN = bytes.fromhex("01 60 F0 2F 09 58 02 00 00 1D")


def a_line():
    """An iSMK with its maker's protocol, and on another line two drives with Modbus."""
    return servodrome.Line(
        axes=[
            servodrome.Axis("k", "ismk", serial="rs485", node=1, bus="can0"),
            servodrome.Axis("m", "ismk", serial="field", node=4, serial_protocol="modbus", bus="can0"),
            servodrome.Axis("r", "generic402", serial="field", node=2, bus="can0"),
        ],
        buses=[servodrome.Bus("can0"), servodrome.Bus("rs485", "rs485"), servodrome.Bus("field", "rs485")],
    )


@pytest.fixture
def plain():
    with a_line() as opened:
        yield opened


@pytest.fixture
def line(plain):
    with virtual_time(plain):
        yield plain


@pytest.fixture
def port(line):
    with serial.serial_for_url("servodrome://rs485", 115200, timeout=1, line=line) as opened:
        yield opened


# ---- The port ----


def test_the_ten_byte_protocol(line, port):
    assert (port.is_open, port.name, port.in_waiting, port.out_waiting) == (True, "servodrome://rs485", 0, 0)
    assert port.readable() and port.writable()
    begin = line.now
    assert port.write(WRITE_SPEED) == 10
    assert port.out_waiting == 10 and line.now == begin, "write() does not wait"
    port.flush()
    assert port.out_waiting == 0 and line.now == pytest.approx(begin + 10 * CHARACTER_S, abs=1e-7)
    assert port.read(10) == WRITTEN
    port.write(READ_SPEED)
    assert port.read_until(b"\x32") == SPEED_AFTERWARDS
    port.write(READ_SPEED)
    time.sleep(0.1)
    assert port.in_waiting == 10
    assert port.read(4) == SPEED_AFTERWARDS[:4] and port.in_waiting == 6
    port.reset_input_buffer()
    assert port.in_waiting == 0
    port.reset_output_buffer()


def test_outside_of_virtual_time_read_lets_time_pass(plain):
    with SerialPort("rs485", 115200, timeout=0.5, line=plain) as port:
        port.write(READ_SPEED)
        assert port.read(10) == SPEED and plain.now < 0.1
        begin = plain.now
        assert port.read(1) == b"" and plain.now == pytest.approx(begin + 0.5)
        port.timeout = None
        port.write(READ_SPEED)
        assert port.read(10) == SPEED


@pytest.mark.parametrize("timeout", [0, 0.25, 3])
def test_timeouts_are_line_time(line, port, timeout):
    port.timeout = timeout
    begin = line.now
    assert port.read(5) == b"" and line.now == pytest.approx(begin + timeout)


def test_a_gap_ends_a_read(line, port):
    port.timeout, port.inter_byte_timeout = 5, 0.01
    port.write(READ_SPEED)
    begin = line.now
    assert port.read(100) == SPEED
    assert begin + 0.01 < line.now < begin + 0.1


def test_the_format_must_be_that_of_the_drive(line, port):
    for keys in ({"baudrate": 9600}, {"parity": "E"}, {"stopbits": 2}, {"bytesize": 7}):
        settings = port.get_settings()
        port.apply_settings(keys)
        port.reset_input_buffer()
        port.write(READ_SPEED)
        port.flush()
        assert port.read(10) != SPEED, keys
        port.apply_settings(settings)
        time.sleep(0.1)
        port.reset_input_buffer()
        port.write(READ_SPEED)
        assert port.read(10) == SPEED


def test_a_reader_thread(line, port):
    lines = []

    class Protocol(serial.threaded.Protocol):
        def connection_made(self, transport):
            lines.append(("made", line.now))

        def data_received(self, data):
            lines.append((bytes(data), line.now))

        def connection_lost(self, error):
            lines.append(("lost", error))

    with serial.threaded.ReaderThread(port, Protocol) as protocol:
        assert isinstance(protocol, Protocol)
        protocol.transport = None
        port.write(READ_SPEED)
        time.sleep(1)
    assert lines[0][0] == "made" and lines[-1] == ("lost", None)
    received = [entry for entry in lines if isinstance(entry[0], bytes)]
    assert b"".join(data for data, _ in received) == SPEED
    assert len(received) == 10, "byte by byte, as they come"
    gaps = [second - first for (_, first), (_, second) in zip(received, received[1:])]
    assert gaps == pytest.approx([CHARACTER_S] * 9, abs=1e-6)


def test_a_read_is_cancelled(line, port):
    port.timeout = None
    results = []
    thread = threading.Thread(target=lambda: results.append((port.read(10), line.now)))
    thread.start()
    time.sleep(2)
    port.cancel_read()
    thread.join()
    assert results == [(b"", 2)]


def test_two_masters_collide(line, port):
    with SerialPort("servodrome://rs485/", 115200, timeout=0.1, line=line) as other:
        port.write(READ_SPEED)
        other.write(bytes(10))
        assert port.read(10) != SPEED
        time.sleep(0.5)
        port.reset_input_buffer()
        other.reset_input_buffer()
        port.write(READ_SPEED)
        assert port.read(10) == SPEED
        assert other.read(20) == READ_SPEED + SPEED, "a listener hears both"


def test_the_life_of_a_port(line):
    port = serial.serial_for_url("SERVODROME://rs485", do_not_open=True, line=line)
    assert not port.is_open
    port.close()
    for use in (lambda: port.read(1), lambda: port.write(b"1"), lambda: port.in_waiting, lambda: port.out_waiting):
        with pytest.raises(serial.SerialException):
            use()
    port.baudrate = 115200
    port.open()
    with pytest.raises(serial.SerialException, match="already open"):
        port.open()
    assert (port.cts, port.dsr, port.cd, port.ri) == (True, True, True, False)
    port.rts = port.dtr = False
    with pytest.raises(serial.SerialException, match="break"):
        port.send_break()
    with pytest.raises(ValueError, match="parity"):
        port.parity = "M"
    port.parity = "E"
    with pytest.raises(ValueError, match="stop bits"):
        port.stopbits = 1.5
    port.close()
    port.close()
    with pytest.raises(serial.SerialException, match="port"):
        SerialPort(line=line).open()


@pytest.mark.parametrize(
    "keys, error, text",
    [
        ({"url": "servodrome://no"}, serial.SerialException, "no"),
        ({"url": "servodrome://can0"}, serial.SerialException, "can0"),
        ({"url": "servodrome://rs485", "parity": "S"}, ValueError, "parity"),
        ({"url": "servodrome://rs485", "baudrate": 50}, serial.SerialException, "bit_rate"),
    ],
)
def test_what_cannot_be_opened(line, keys, error, text):
    with pytest.raises(error, match=text):
        serial.serial_for_url(line=line, **keys)


def test_the_line_by_default(plain):
    serial.serial_for_url("servodrome://rs485").close()
    with a_line() as other, virtual_time(other), serial.serial_for_url("servodrome://field") as port:
        assert port._link.line is other


# ---- pymodbus ----


@pytest.fixture
def client(line):
    pymodbus = pytest.importorskip("pymodbus.client")
    opened = pymodbus.ModbusSerialClient(port="servodrome://field", baudrate=115200, timeout=0.5, retries=1)
    assert opened.connect()
    yield opened
    opened.close()


def device(station):
    """The keyword for a station: of pymodbus from 3.10 on, and before."""
    import inspect

    from pymodbus.client import ModbusSerialClient

    names = inspect.signature(ModbusSerialClient.read_holding_registers).parameters
    return {"device_id" if "device_id" in names else "slave": station}


def test_pymodbus_reads_and_writes(line, client):
    for _ in range(20):
        answer = client.read_holding_registers(0x3700, count=2, **device(4))
        assert not answer.isError() and len(answer.registers) == 2
    write = client.write_registers(0x4A00, [1234, 5], **device(4))
    assert not write.isError(), write
    assert client.read_holding_registers(0x4A00, count=2, **device(4)).registers == [1234, 5]
    refused = client.read_holding_registers(0xFFF0, count=1, **device(2))
    assert refused.isError() and refused.exception_code == 2
    assert line.now < 5


def test_pymodbus_gives_up_in_line_time(line, client):
    from pymodbus.exceptions import ModbusException

    begin = line.now
    try:
        assert client.read_holding_registers(0x3700, count=2, **device(77)).isError()
    except ModbusException:
        pass
    assert begin + 0.5 <= line.now <= begin + 10
    assert not client.connect() or not client.read_holding_registers(0x3700, count=2, **device(4)).isError()


def test_pymodbus_is_the_same_each_time():
    pymodbus = pytest.importorskip("pymodbus.client")

    def run():
        with a_line() as line, virtual_time(line):
            with pymodbus.ModbusSerialClient(port="servodrome://field", baudrate=115200, timeout=0.5) as client:
                stamps = []
                for station in (2, 4) * 10:
                    answer = client.read_holding_registers(0x0100 if station == 2 else 0x3700, count=2, **device(station))
                    stamps.append((line.now_ns, answer.registers))
            return stamps

    first = run()
    assert len(first) == 20 and run() == first
