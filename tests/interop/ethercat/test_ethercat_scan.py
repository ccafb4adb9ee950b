"""A third-party master finds the slaves and reads their information memory."""

import struct

import pytest
from master import OP, PREOP
from segment import segment

VENDOR, PRODUCT, REVISION = 0x53455256, 0x34303245, 0x00010000


@pytest.mark.parametrize("count", [1, 8, 64])
def test_finds_all_and_takes_them_to_operational(start_line, open_master, count):
    line = start_line(segment(count, alias=lambda n: 100 + n, serial_number=lambda n: 7000 + n))
    master = open_master()
    assert master.scan() == count
    assert [(slave.man, slave.id, slave.rev) for slave in master.slaves] == [(VENDOR, PRODUCT, REVISION)] * count
    assert {slave.name for slave in master.slaves} == {"generic402-ec"}
    # In the order of the line file: alias (ETG.1000.6 table 16, word 4) and serial number (word 14).
    for number, slave in enumerate(master.slaves, 1):
        assert struct.unpack("<H", slave.eeprom_read(4)[:2]) == (100 + number,)
        assert struct.unpack("<I", slave.eeprom_read(14)[:4]) == (7000 + number,)
        assert struct.unpack("<I", slave.sdo_read(0x1018, 4)) == (7000 + number,)
    master.run()
    assert master.working_counter == 3 * count
    axes = line.bench.get("buses/ecat")["axes"]
    assert [axes[f"drive{n}"]["state"] for n in range(1, count + 1)] == ["Operational"] * count


def test_the_next_master_finds_what_one_left_operational(start_line, open_master):
    start_line(segment(3))
    first = open_master()
    assert first.scan() == 3
    first.run()
    first.close()
    second = open_master()
    assert second.scan() == 3
    assert second.states() == [(PREOP, 0)] * 3
    second.run()
    assert [state for state, _ in second.states()] == [OP] * 3
    second.stop_cycle()


def categories(sii):
    """Returns {type: contents} of the categories after the 64 words of the fixed part (ETG.1000.6 table 17)."""
    found, at = {}, 128
    while (kind := struct.unpack_from("<H", sii, at)[0]) != 0xFFFF:
        (words,) = struct.unpack_from("<H", sii, at + 2)
        assert kind not in found
        found[kind] = sii[at + 4 : at + 4 + 2 * words]
        at += 4 + 2 * words
    return found


def strings_of(category):
    strings, at = [], 1
    for _ in range(category[0]):
        strings.append(category[at + 1 : at + 1 + category[at]].decode())
        at += 1 + category[at]
    return strings


def test_information_memory(slave, objects):
    """Decodes the whole memory by the standard's tables and compares it with the dictionary."""
    size_kbit = struct.unpack("<H", slave.eeprom_read(0x3E)[:2])[0] + 1
    sii = b"".join(slave.eeprom_read(word)[:4] for word in range(0, size_kbit * 64, 2))
    crc = 0xFF
    for byte in sii[:14]:  # x^8 + x^2 + x + 1 (ETG.1000.6 5.4)
        crc ^= byte
        for _ in range(8):
            crc = (crc << 1 ^ 0x07) & 0xFF if crc & 0x80 else crc << 1
    assert sii[14] == crc
    assert struct.unpack_from("<4I", sii, 16) == (VENDOR, PRODUCT, REVISION, 1)
    out_start, out_size, in_start, in_size, protocols = struct.unpack_from("<5H", sii, 48)
    assert (out_start, in_start) == (0x1000, 0x1100) and protocols & 0x04  # CoE

    found = categories(sii)
    strings = strings_of(found[10])
    general = found[30]
    assert strings[general[2] - 1] == "generic402-ec"  # order
    assert general[5] & 0x01  # SDO
    assert general[5] & 0x02  # SDO information
    assert general[5] & 0x20  # complete access
    managers = [struct.unpack_from("<HHBBBB", found[41], at) for at in range(0, len(found[41]), 8)]
    assert [kind for *_, kind in managers] == [1, 2, 3, 4]
    assert [manager[:2] for manager in managers[:2]] == [(out_start, out_size), (in_start, in_size)]
    assert list(found[40])[:2] == [1, 2]

    # The PDOs of the dictionary's mapping, with the names of the mapped objects.
    rows = objects("generic402-ec")
    default = lambda index, sub: int(rows[index, sub]["default"], 0)
    for kind, first in ((51, 0x1600), (50, 0x1A00)):
        listed, at = {}, 0
        while at < len(found[kind]):
            index, entries = struct.unpack_from("<HB", found[kind], at)
            listed[index] = [struct.unpack_from("<HBBBB", found[kind], at + 8 * n) for n in range(1, entries + 1)]
            at += 8 + 8 * entries
        expected = [i for i, sub in sorted(rows) if first <= i < first + 0x200 and sub == 0 and default(i, 0) > 0]
        assert sorted(listed) == expected
        for pdo in expected:
            mapped = [default(pdo, sub) for sub in range(1, default(pdo, 0) + 1)]
            assert [index << 16 | sub << 8 | bits for index, sub, _, _, bits in listed[pdo]] == mapped
            for index, sub, name, _, _ in listed[pdo]:
                if index:
                    assert strings[name - 1] == rows[index, sub]["name"]


def test_alias_written_by_a_master_stays(line, open_master):
    """Word 4 of the information memory is the alias; its checksum is in word 7 (ETG.1000.6 table 16)."""
    master = open_master()
    master.scan()
    slave = master.slaves[0]
    fixed = bytearray(b"".join(slave.eeprom_read(word)[:4] for word in range(0, 8, 2)))
    fixed[8:10] = struct.pack("<H", 0x1234)
    crc = 0xFF
    for byte in fixed[:14]:
        crc ^= byte
        for _ in range(8):
            crc = (crc << 1 ^ 0x07) & 0xFF if crc & 0x80 else crc << 1
    slave.eeprom_write(4, bytes(fixed[8:10]))
    slave.eeprom_write(7, bytes([crc, 0]))
    alias = line.bench.axis("drive1")["alias"]
    assert alias != 0x1234  # it takes effect after a power cycle
    line.bench.post("axes/drive1/power", {"action": "cycle"})
    assert line.bench.axis("drive1")["alias"] == 0x1234
    assert master.scan() == 2
    assert struct.unpack("<H", master.slaves[0].eeprom_read(4)[:2]) == (0x1234,)
    assert struct.unpack("<H", master.slaves[0]._fprd(0x0012, 2)) == (0x1234,)
