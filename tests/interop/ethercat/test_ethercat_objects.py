"""CoE: lists and descriptions of all objects, and every kind of transfer."""

import re

import pysoem
import pytest
from master import BOOT, INIT
from segment import segment

# CoE data types (ETG.1000.6 table 64)
TYPES = {
    0x01: "BOOLEAN",
    0x02: "INTEGER8",
    0x03: "INTEGER16",
    0x04: "INTEGER32",
    0x05: "UNSIGNED8",
    0x06: "UNSIGNED16",
    0x07: "UNSIGNED32",
    0x08: "REAL32",
    0x09: "VISIBLE_STRING",
    0x0A: "OCTET_STRING",
    0x0F: "DOMAIN",
    0x15: "INTEGER64",
    0x1B: "UNSIGNED64",
}
READS, WRITES, RX, TX = 0x07, 0x38, 0x40, 0x80


@pytest.fixture(params=["generic402-ec", "jmc_ec", "ismk-ea"])
def product(request):
    return request.param


@pytest.fixture
def product_slave(product, start_line, open_master):
    start_line(segment(1, product=product, travel=""))
    master = open_master()
    assert master.scan() == 1
    yield master.slaves[0]


def test_object_list_is_the_exported_one(product, product_slave, objects):
    """Reads SDO information like a user's tool: index, sub-index, name, type, access, mapping."""
    slave, rows = product_slave, objects(product)
    described = {}
    for found in slave.od:
        entries = list(found.entries) or [found]
        for sub, entry in enumerate(entries):
            if entry.data_type:  # a sub-index that does not exist has no type
                described[found.index, sub] = entry
    assert sorted(described) == sorted(rows)
    wrong = []
    for (index, sub), entry in described.items():
        row = rows[index, sub]
        access = {"ro": (True, False), "const": (True, False), "rw": (True, True), "wo": (False, True)}[row["access"]]
        mapping = {"none": (False, False), "rx": (True, False), "tx": (False, True), "both": (True, True)}[row["pdo"]]
        told = entry.obj_access
        if TYPES.get(entry.data_type) != row["type"]:
            wrong.append((f"{index:04X}:{sub:02X}", "type", entry.data_type, row["type"]))
        if (bool(told & READS), bool(told & WRITES)) != access:
            wrong.append((f"{index:04X}:{sub:02X}", "access", f"{told:04X}", row["access"]))
        if (bool(told & RX), bool(told & TX)) != mapping:
            wrong.append((f"{index:04X}:{sub:02X}", "pdo", f"{told:04X}", row["pdo"]))
        name = entry.name.decode() if isinstance(entry.name, bytes) else entry.name
        if sub and name != row["name"][:40]:  # SOEM stores only 40 characters
            wrong.append((f"{index:04X}:{sub:02X}", "name", name, row["name"]))
    assert not wrong


def test_every_readable_object_is_read(product, product_slave, objects):
    slave = product_slave
    for (index, sub), row in objects(product).items():
        if row["access"] == "wo":
            with pytest.raises(pysoem.SdoError) as refusal:
                slave.sdo_read(index, sub)
            assert refusal.value.abort_code == 0x06010001
        else:
            slave.sdo_read(index, sub, size=2048)


def aborts(code, function, *arguments, **options):
    with pytest.raises(pysoem.SdoError) as refusal:
        function(*arguments, **options)
    assert refusal.value.abort_code == code, f"{refusal.value.abort_code:08X}h"


def test_expedited_values_are_the_drive_s(slave, bench):
    for index, sub, size, value in (
        (0x6060, 0, 1, 8),
        (0x2030, 6, 1, 3),
        (0x607F, 0, 4, 0x00061A80),
        (0x6072, 0, 2, 1234),
        (0x607C, 0, 4, -131072),
    ):
        slave.sdo_write(index, sub, value.to_bytes(size, "little", signed=True))
        assert int.from_bytes(slave.sdo_read(index, sub), "little", signed=True) == value
        assert len(slave.sdo_read(index, sub)) == size
        assert bench.get(f"axes/drive1/objects/{index:04X}/{sub:X}")["value"] == value


def test_normal_and_segmented_transfers(slave, bench):
    """Data that fit into the mailbox use one message; a larger object uses as many segments as necessary."""
    assert slave.sdo_read(0x1008, 0) == b"Servodrome CiA 402 reference drive, EtherCAT"
    for size in (5, 7, 100, 230, 240, 241, 242, 250, 256, 500, 1000, 1024):
        data = bytes((7 * n + size) & 0xFF for n in range(size))
        slave.sdo_write(0x2F10, 0, data)
        assert slave.sdo_read(0x2F10, 0, size=1024) == data
        assert bench.get("axes/drive1/objects/2F10/0")["value"].lower() == data.hex()
    aborts(0x06070012, slave.sdo_write, 0x2F10, 0, bytes(1025))
    assert slave.sdo_read(0x2F10, 0, size=1024) == data


def test_complete_access(slave):
    """Transfers a whole object, from sub-index 0 (padded to 16 bits) or from 1 on (ETG.1000.6 5.6.2.1)."""
    whole = slave.sdo_read(0x1018, 0, size=64, ca=True)
    parts = [slave.sdo_read(0x1018, sub) for sub in range(1, 5)]
    assert whole == bytes([4, 0]) + b"".join(parts)
    assert slave.sdo_read(0x1018, 1, size=64, ca=True) == b"".join(parts)

    slave.sdo_write(0x1C13, 0, bytes([2, 0]) + (0x1A01).to_bytes(2, "little") + (0x1A02).to_bytes(2, "little"), ca=True)
    assert [slave.sdo_read(0x1C13, sub) for sub in range(3)] == [b"\x02", b"\x01\x1a", b"\x02\x1a"]
    slave.sdo_write(0x60FE, 1, (0x10000).to_bytes(4, "little") + (0x10000).to_bytes(4, "little"), ca=True)
    assert slave.sdo_read(0x60FE, 2) == (0x10000).to_bytes(4, "little")


def test_aborts(slave):
    """Checks the abort codes of ETG.1000.6 table 41 for each kind of error."""
    aborts(0x06020000, slave.sdo_read, 0x5FFF, 0)
    aborts(0x06090011, slave.sdo_read, 0x1018, 5)
    aborts(0x06010002, slave.sdo_write, 0x6041, 0, b"\0\0")
    aborts(0x06070012, slave.sdo_write, 0x6060, 0, b"\0\0")
    aborts(0x06070013, slave.sdo_write, 0x607F, 0, b"\0\0")
    aborts(0x06090031, slave.sdo_write, 0x2011, 1, (2001).to_bytes(2, "little"))
    aborts(0x06090032, slave.sdo_write, 0x2011, 1, (49).to_bytes(2, "little"))
    assert int.from_bytes(slave.sdo_read(0x2011, 1), "little") == 1000


def test_parameters_stay_when_stored(line, master):
    """Stores by 1010h and power-cycles; values that were not stored are lost."""
    slave = master.slaves[1]
    slave.sdo_write(0x2012, 0, (2500).to_bytes(4, "little"))
    aborts(0x08000020, slave.sdo_write, 0x1010, 1, b"xxxx")
    slave.sdo_write(0x1010, 1, b"save")
    slave.sdo_write(0x2040, 1, (390).to_bytes(2, "little"))
    line.bench.post("axes/drive2/power", {"action": "cycle"})
    assert master.scan() == 2
    slave = master.slaves[1]
    assert slave.sdo_read(0x2012, 0) == (2500).to_bytes(4, "little")
    assert slave.sdo_read(0x2040, 1) == (400).to_bytes(2, "little")
    slave.sdo_write(0x1011, 1, b"load")
    line.bench.post("axes/drive2/power", {"action": "cycle"})
    assert master.scan() == 2
    assert master.slaves[1].sdo_read(0x2012, 0) == (1000).to_bytes(4, "little")


class TestFiles:
    """The parameter file over FoE."""

    NAME = "parameters.txt"

    def read(self, slave):
        """pysoem returns its whole buffer without the length of the file: takes lines while their objects ascend."""
        data = slave.foe_read(self.NAME, 0, 16384, 10_000_000)
        header, *lines = data.split(b"\n")
        text, last = header + b"\n", b""
        for line in lines:
            key = re.match(rb"(0x[0-9A-F]{4}:[0-9A-F]{2})=[ -~]*$", line)
            if not key or key[1] <= last:
                break
            text, last = text + line + b"\n", key[1]
        return text.decode()

    def test_read_change_write(self, slave, bench):
        text = self.read(slave)
        assert text.startswith("# servodrome parameters 1\n")
        assert "\n0x2012:00=1000\n" in text
        changed = text.replace("0x2012:00=1000", "0x2012:00=1750")
        assert slave.foe_write(self.NAME, 0, changed.encode(), 10_000_000) > 0
        assert slave.sdo_read(0x2012, 0) == (1750).to_bytes(4, "little")
        assert self.read(slave) == changed
        assert bench.get("axes/drive1/objects/2012/0")["value"] == 1750

    def test_refused(self, slave):
        """A wrong name, or a value out of its range: all values stay unchanged."""
        text = self.read(slave)
        assert slave.foe_write("firmware.bin", 0, text.encode(), 10_000_000) < 0
        wrong = text.replace("0x2012:00=1000", "0x2012:00=50")  # below its minimum
        assert slave.foe_write(self.NAME, 0, wrong.encode(), 10_000_000) < 0
        assert self.read(slave) == text

    def test_in_bootstrap(self, master):
        """Reads and writes with FoE only."""
        slave = master.slaves[0]
        for state in (INIT, BOOT):
            slave.state = state
            slave.write_state()
            assert slave.state_check(state, 10_000_000) == state
        assert self.read(slave).startswith("# servodrome")
        master.soem.sdo_read_timeout = 200_000
        with pytest.raises((pysoem.MailboxError, pysoem.WkcError)):
            slave.sdo_read(0x1018, 1)
