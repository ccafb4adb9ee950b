"""`sniff` on serial lines: live on a second pty while pymodbus is the master, from logs, and Wireshark on the same
data."""

import json
import subprocess
import time

import pytest
from line import PATIENCE, PROGRAM, Line, servodrome, wait_for
from pymodbus.client import ModbusSerialClient, ModbusTcpClient

TWO_DRIVES = """
[[bus]]
name = "rs"
type = "rs485"

[[axis]]
name = "k1"
product = "ismk"
serial = "rs"
node = 1
serial_protocol = "modbus"

[[axis]]
name = "k2"
product = "ismk"
serial = "rs"
node = 2
serial_protocol = "modbus"
"""


def talk(client):
    """A write, a read, and a register that does not exist."""
    assert client.connect()
    try:
        assert not client.write_register(0x3500, 3, device_id=1).isError()
        assert not client.read_holding_registers(0x3200, count=2, device_id=2).isError()
        client.write_register(0x9999, 1, device_id=1)
    finally:
        client.close()


def pymodbus_over_pty(path):
    return ModbusSerialClient(str(path), baudrate=115200, parity="N", timeout=PATIENCE, retries=0)


def rows_of(text):
    return [json.loads(row) for row in text.splitlines()]


def expect_conversation(rows):
    said = [(row["node"], row["kind"], row["text"].split(" ", 3)[:3]) for row in rows]
    assert said[:4] == [
        (1, "modbus", ["Modbus", "write", "6060:00"]),
        (1, "modbus", ["Modbus", "written", "6060:00"]),
        (2, "modbus", ["Modbus", "read", "6041:00"]),
        (2, "modbus", ["Modbus", "6041:00", rows[3]["text"].split(" ", 3)[2]]),
    ], rows
    assert rows[3]["values"][0]["object"] == "6041:00"
    assert "exception 02h illegal data address" in rows[5]["text"]
    assert [row["error"] for row in rows[:6]] == [False] * 5 + [True]


@pytest.mark.once
def test_live_on_a_second_pty(tmp_path):
    line = Line(tmp_path, TWO_DRIVES, [f"rs=pty:{tmp_path}/master", f"rs=pty:{tmp_path}/ear"])
    try:
        output = tmp_path / "sniffed"
        with open(output, "wb") as file:
            sniff = subprocess.Popen(
                [str(PROGRAM), "sniff", f"pty:{tmp_path}/ear", "--product", "ismk", "--json"], stdout=file, stderr=subprocess.STDOUT
            )
        try:
            # `sniff` receives as soon as the line has a client there.
            wait_for(lambda: line.bench.get("buses/rs")["links"][1]["clients"] == 1, "sniff opens its pty")
            talk(pymodbus_over_pty(tmp_path / "master"))
            wait_for(lambda: output.read_text().count("\n") >= 6, lambda: f"six frames: {output.read_text()}")
        finally:
            sniff.send_signal(2)
            assert sniff.wait(PATIENCE) == 0
        expect_conversation(rows_of(output.read_text()))
    finally:
        line.stop()


@pytest.mark.once
@pytest.mark.parametrize("link", ["pty", "tcp"])
@pytest.mark.parametrize("ending", ["log", "pcap"])
def test_logs(tmp_path, ending, link):
    log = tmp_path / f"trace.{ending}"
    line = Line(tmp_path, TWO_DRIVES, [f"rs=pty:{tmp_path}/master", "rs=tcp:127.0.0.1:0"], log=log)
    try:
        port = int(line.links["rs"][1].rpartition(":")[2])
        talk(pymodbus_over_pty(tmp_path / "master") if link == "pty" else ModbusTcpClient("127.0.0.1", port=port, timeout=PATIENCE))
        time.sleep(0.01)  # the silence after the last frame
    finally:
        line.stop()
    expect_conversation(rows_of(servodrome("sniff", log, "--product", "ismk", "--json")))
    if ending == "pcap":
        decode = ["-d", "rtacser.data,mbrtu"] if link == "pty" else []
        shown = subprocess.run(["tshark", "-r", log, *decode], capture_output=True, text=True, timeout=PATIENCE * 6, check=True).stdout
        assert shown.count("Modbus") >= 6, shown
        assert "Malformed" not in shown
        for words in ("Write Single Register", "Read Holding Registers", "Exception"):
            assert words in shown


@pytest.mark.once
def test_traffic_over_the_bench_api(tmp_path):
    line = Line(tmp_path, TWO_DRIVES, [f"rs=pty:{tmp_path}/master", "rs=tcp:127.0.0.1:0"])
    try:
        assert line.bench.put("buses/rs/traffic", {"record": True})["recording"]
        talk(pymodbus_over_pty(tmp_path / "master"))
        wait_for(lambda: len(line.bench.get("buses/rs/traffic")["rows"]) >= 6, "six rows")
        rows = line.bench.get("buses/rs/traffic")["rows"]
        expect_conversation(rows)
        assert [row["from"] for row in rows[:4]] == ["master", "k1", "master", "k2"]
        port = int(line.links["rs"][1].rpartition(":")[2])
        talk(ModbusTcpClient("127.0.0.1", port=port, timeout=PATIENCE))
        behind = line.bench.get(f"buses/rs/traffic?since={rows[-1]['number']}")["rows"]
        expect_conversation(behind)
        assert behind[1]["from"] == "drive"
    finally:
        line.stop()
