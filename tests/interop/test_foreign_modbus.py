"""Our commands as masters of third-party Modbus servers: pymodbus over TCP and over a pty, and libmodbus.

Modbus has no drive profile: the servers contain the registers of an iSMK (ch. 7, 'Object list'), selected by --product.
"""

import asyncio
import ctypes
import json
import os
import socket
import threading

import pytest
from line import servodrome
from pymodbus import ModbusDeviceIdentification
from pymodbus.framer import FramerType
from pymodbus.server import ModbusSerialServer, ModbusTcpServer
from pymodbus.simulator import DataType, SimData, SimDevice

pytestmark = pytest.mark.once

STATION = 7
STATUSWORD, POSITION, PROFILE_VELOCITY = 0x3200, 0x3700, 0x4A00
REGISTERS = 0x7000


class Pymodbus:
    """Runs a server of pymodbus in a thread; calls `make` in its event loop."""

    def __init__(self, make):
        device = SimDevice(STATION, simdata=[SimData(0, values=[0] * REGISTERS, datatype=DataType.REGISTERS)])
        identity = ModbusDeviceIdentification(info_name={"VendorName": "pymodbus", "ProductCode": "plain", "MajorMinorRevision": "1"})
        self.loop = asyncio.new_event_loop()

        async def serve():
            self.server = make([device], identity)
            await self.server.serve_forever(background=True)

        self.thread = threading.Thread(target=self.loop.run_forever, daemon=True)
        self.thread.start()
        self.do(serve())

    def do(self, coroutine):
        return asyncio.run_coroutine_threadsafe(coroutine, self.loop).result(60)

    def port(self):
        return self.server.transport.sockets[0].getsockname()[1]

    def put(self, address, value):
        self.do(self.server.async_setValues(STATION, 16, address, [value]))

    def at(self, address):
        return self.do(self.server.async_getValues(STATION, 3, address, 1))[0]

    def close(self):
        self.do(self.server.shutdown())
        self.loop.call_soon_threadsafe(self.loop.stop)
        self.thread.join(60)
        self.loop.close()


class Wire:
    """Two ptys and a thread that copies between them: a serial line without a simulated line."""

    def __init__(self):
        self.masters, self.paths = [], []
        for _ in range(2):
            master, slave = os.openpty()
            self.masters.append(master)
            self.paths.append(os.ttyname(slave))
        self.threads = [threading.Thread(target=self.copy, args=(a, b), daemon=True) for a, b in (self.masters, self.masters[::-1])]
        for thread in self.threads:
            thread.start()

    @staticmethod
    def copy(source, target):
        while True:
            try:
                os.write(target, os.read(source, 256))
            except OSError:
                return


class Mapping(ctypes.Structure):
    """modbus_mapping_t of modbus.h."""

    _fields_ = [(name, ctypes.c_int) for name in (
        "nb_bits", "start_bits", "nb_input_bits", "start_input_bits", "nb_input_registers", "start_input_registers",
        "nb_registers", "start_registers")] + [
        ("tab_bits", ctypes.POINTER(ctypes.c_uint8)), ("tab_input_bits", ctypes.POINTER(ctypes.c_uint8)),
        ("tab_input_registers", ctypes.POINTER(ctypes.c_uint16)), ("tab_registers", ctypes.POINTER(ctypes.c_uint16))]


class Libmodbus:
    """libmodbus of Debian (a dependency of mbpoll); it has no device identification."""

    def __init__(self):
        self.library = ctypes.CDLL("libmodbus.so.5", use_errno=True)
        self.library.modbus_new_tcp.restype = ctypes.c_void_p
        self.library.modbus_mapping_new.restype = ctypes.POINTER(Mapping)
        self.context = ctypes.c_void_p(self.library.modbus_new_tcp(b"127.0.0.1", 0))
        self.mapping = self.library.modbus_mapping_new(0, 0, REGISTERS, 0)
        self.listener = self.library.modbus_tcp_listen(self.context, 4)
        assert self.listener >= 0
        threading.Thread(target=self.serve, daemon=True).start()

    def serve(self):
        query = (ctypes.c_uint8 * 260)()
        listener = ctypes.c_int(self.listener)
        while self.library.modbus_tcp_accept(self.context, ctypes.byref(listener)) >= 0:
            while (length := self.library.modbus_receive(self.context, query)) >= 0:
                self.library.modbus_reply(self.context, query, length, self.mapping)

    def port(self):
        with socket.socket(fileno=os.dup(self.listener)) as listener:
            return listener.getsockname()[1]

    def put(self, address, value):
        self.mapping.contents.tab_registers[address] = value

    def at(self, address):
        return self.mapping.contents.tab_registers[address]

    def close(self):
        os.close(self.listener)


@pytest.fixture(params=["pymodbus-tcp", "pymodbus-rtu", "libmodbus-tcp"])
def server(request):
    """A server with `bus`, the link to it."""
    if request.param == "libmodbus-tcp":
        server = Libmodbus()
    elif request.param == "pymodbus-tcp":
        server = Pymodbus(lambda devices, identity: ModbusTcpServer(devices, identity=identity, address=("127.0.0.1", 0)))
    else:
        wire = Wire()
        server = Pymodbus(lambda devices, identity: ModbusSerialServer(
            devices, identity=identity, framer=FramerType.RTU, port=wire.paths[0], baudrate=115200))
    server.kind = request.param
    server.bus = f"modbus:serial:{wire.paths[1]}" if server.kind.endswith("rtu") else f"modbus:tcp:127.0.0.1:{server.port()}"
    yield server
    server.close()


@pytest.fixture
def command(server):
    return lambda name, *arguments, **options: servodrome(
        name, *arguments, "--bus", server.bus, "--node", STATION, "--product", "ismk", "--timeout", "30", **options)


def test_scan(server):
    found = json.loads(servodrome("scan", "--bus", server.bus, "--first", STATION, "--last", STATION, "--timeout", "10", "--json"))
    assert [node["node"] for node in found["nodes"]] == [STATION]
    assert found["nodes"][0]["name"] == ("plain" if server.kind.startswith("pymodbus") else "")


def test_get_and_set(server, command):
    server.put(STATUSWORD, 0x0637)
    server.put(POSITION, 0x2345)
    server.put(POSITION + 1, 1)
    assert json.loads(command("get", "6041", "--json"))["value"] == 0x0637
    assert json.loads(command("get", "6063", "--json"))["value"] == 0x12345
    command("set", "6081", str(0x28F5C3))
    assert (server.at(PROFILE_VELOCITY), server.at(PROFILE_VELOCITY + 1)) == (0xF5C3, 0x28)


def test_what_is_not_there(server, command):
    said = servodrome("get", "6041", "--bus", server.bus, "--node", STATION, "--timeout", "10", status=2)
    assert "--product" in said, said
    if not server.kind.startswith("libmodbus"):  # libmodbus answers for every unit
        said = servodrome("get", "6041", "--bus", server.bus, "--node", STATION + 1, "--product", "ismk", "--timeout", "2", status=1)
        assert str(STATION + 1) in said, said


def test_a_drive_that_does_not_follow(server, command):
    """The server is only memory: it accepts a controlword, but its state does not change. The command must not hang,
    and must
    print a hint."""
    server.put(STATUSWORD, 0x0250)
    said = command("move", "--by", "1", status=1)
    assert "did not get ready to switch on" in said, said


def test_conform_ends_with_verdicts(server, command):
    report = json.loads(command("conform", "--json", "--safe", "--only", "modbus", "--only", "abort", status=None))
    assert report["passed"] >= 3 and report["checks"]
