"""The exported ESI file of every product on EtherCAT: its structure, its dictionary, and the slave information memory.

The test derives the content of a slave's memory from the ESI alone and compares it with the bytes of `export sii`,
which are the same as those of the running slave (tests/products compare them).

Environment:
  SERVODROME           the built program
  SERVODROME_PRODUCTS  optional: the products to test, separated by spaces
"""

import copy
import csv
import io
import json
import os
import pathlib
import re
import struct
import subprocess

import pytest
from lxml import etree

SCHEMA = etree.XMLSchema(etree.parse(pathlib.Path(__file__).parents[1] / "data" / "esi.xsd"))


def run(*arguments):
    return subprocess.run([os.environ["SERVODROME"], *arguments], capture_output=True, timeout=60, check=False)


def export(form, product):
    result = run("export", form, product)
    assert result.returncode == 0, result.stderr.decode()
    return result.stdout


def all_products():
    listed = json.loads(run("products", "--json").stdout)
    return [product["name"] for product in (listed["products"] if isinstance(listed, dict) else listed)]


def products_on_ethercat():
    if "SERVODROME_PRODUCTS" in os.environ:
        return os.environ["SERVODROME_PRODUCTS"].split()
    names = [name for name in all_products() if run("export", "esi", name).returncode == 0]
    assert names, "no product has an ESI"
    return names


def number(text):
    return int(text[2:], 16) if text.startswith("#x") else int(text)


class Esi:
    def __init__(self, product):
        self.product = product
        self.document = etree.fromstring(export("esi", product))
        self.device = self.document.find("Descriptions/Devices/Device")
        self.rows = [
            row
            for row in csv.DictReader(io.StringIO(export("csv", product).decode()))
            if int(row["index"], 16) >= 0x1000
        ]
        # Objects that only the service port can access are not in the ESI.
        known = {number(text.text) for text in self.device.findall("Profile/Dictionary/Objects/Object/Index")}
        self.rows = [row for row in self.rows if int(row["index"], 16) in known or not self.is_local(row)]
        self.types = {
            one.findtext("Name"): one for one in self.device.findall("Profile/Dictionary/DataTypes/DataType")
        }
        self.objects = {
            number(one.findtext("Index")): one for one in self.device.findall("Profile/Dictionary/Objects/Object")
        }


    def is_local(self, row):
        return any(int(row["index"], 16) in area for area in LOCAL.get(self.product, ()))


# Objects that the bus does not see, by product.
LOCAL = {"jmc_ec": (range(0x2000, 0x2100),)}


@pytest.fixture(scope="module", params=products_on_ethercat())
def esi(request):
    return Esi(request.param)


# ---- Structure ----


def test_valid(esi):
    SCHEMA.assertValid(esi.document)


def find(document, path):
    found = document.find(path)
    assert found is not None, path
    return found


def drop(path):
    def change(document):
        one = find(document, path)
        one.getparent().remove(one)

    return change


def write(path, text):
    def change(document):
        find(document, path).text = text

    return change


def attribute(path, name, value):
    def change(document):
        find(document, path).set(name, value)

    return change


def duplicate(path):
    def change(document):
        one = find(document, path)
        one.addnext(copy.deepcopy(one))

    return change


def to_the_end(path):
    def change(document):
        one = find(document, path)
        one.getparent().append(one)

    return change


def add(path, element):
    def change(document):
        etree.SubElement(find(document, path), element)

    return change


DEVICE = "Descriptions/Devices/Device"
BROKEN = {
    "no vendor": drop("Vendor/Id"),
    "a C number": write("Vendor/Id", "0x1234"),
    "no product code": lambda document: find(document, f"{DEVICE}/Type").attrib.pop("ProductCode"),
    "a group that is not there": write(f"{DEVICE}/GroupType", "Others"),
    "order of elements": to_the_end(f"{DEVICE}/Fmmu"),
    "an element nobody knows": add(f"{DEVICE}/Eeprom", "Checksum"),
    "an attribute nobody knows": attribute(f"{DEVICE}/Sm", "Adress", "#x1000"),
    "no start address": lambda document: find(document, f"{DEVICE}/Sm").attrib.pop("StartAddress"),
    "use of an FMMU": write(f"{DEVICE}/Fmmu", "Output"),
    "a type that is not described": write(f"{DEVICE}/Profile/Dictionary/Objects/Object/Type", "DT9999"),
    "a type of a sub-item that is not described": write(
        f"{DEVICE}/Profile/Dictionary/DataTypes/DataType/SubItem/Type", "DT9999"
    ),
    "a type twice": duplicate(f"{DEVICE}/Profile/Dictionary/DataTypes/DataType"),
    "an object twice": duplicate(f"{DEVICE}/Profile/Dictionary/Objects/Object"),
    "index too long": write(f"{DEVICE}/Profile/Dictionary/Objects/Object/Index", "#x10000"),
    "access": write(f"{DEVICE}/Profile/Dictionary/Objects/Object/Flags/Access", "const"),
    "mapping direction": write(f"{DEVICE}/Profile/Dictionary/Objects/Object/Flags/PdoMapping", "both"),
    "an entry without a length": drop(f"{DEVICE}/RxPdo/Entry/BitLen"),
    "a PDO without a name": drop(f"{DEVICE}/TxPdo/Name"),
    "a flag of the mailbox": attribute(f"{DEVICE}/Mailbox/CoE", "SdoInfo", "yes"),
    "odd hexadecimal": write(f"{DEVICE}/Eeprom/ConfigData", "080E0"),
    "no physics": lambda document: find(document, DEVICE).attrib.pop("Physics"),
}


@pytest.mark.parametrize("case", BROKEN)
def test_a_broken_file_is_refused(esi, case):
    document = copy.deepcopy(esi.document)
    BROKEN[case](document)
    assert not SCHEMA.validate(document)


# ---- Dictionary ----

BASE_TYPES = {
    "BOOLEAN": "BOOL", "INTEGER8": "SINT", "INTEGER16": "INT", "INTEGER32": "DINT", "INTEGER64": "LINT",
    "UNSIGNED8": "USINT", "UNSIGNED16": "UINT", "UNSIGNED32": "UDINT", "UNSIGNED64": "ULINT", "REAL32": "REAL",
}  # fmt: skip
STRINGS = {"VISIBLE_STRING": r"STRING\(\d+\)", "OCTET_STRING": r"ARRAY \[0\.\.\d+\] OF BYTE"}
STRINGS["DOMAIN"] = STRINGS["OCTET_STRING"]


class Entry:
    """Returns the data of the file for one sub-index, from every place where the file has them."""

    def __init__(self, esi, index, sub, single):
        described = esi.objects[index]
        self.object_name = described.findtext("Name")
        if single:
            self.type, self.bits = described.findtext("Type"), int(described.findtext("BitSize"))
            self.flags, self.info = described.find("Flags"), described.find("Info")
            self.name = self.object_name
            return
        items = {}
        for item in esi.types[described.findtext("Type")].findall("SubItem"):
            if (place := item.findtext("SubIdx")) is not None:
                items[number(place)] = (item, item.findtext("Type"), item.findtext("Name"))
            else:  # elements of an array
                array = esi.types[item.findtext("Type")]
                first, count = (int(array.findtext(f"ArrayInfo/{one}")) for one in ("LBound", "Elements"))
                for element in range(first, first + count):
                    items[element] = (item, array.findtext("BaseType"), f"SubIndex {element:03}")
        item, self.type, key = items[sub]
        self.bits = int(esi.types[self.type].findtext("BitSize"))
        self.flags = item.find("Flags")
        values = {one.findtext("Name"): one.find("Info") for one in described.findall("Info/SubItem")}
        self.info = values[key]
        self.name = self.info.findtext("DisplayName") or key
        assert set(values) == {key for _, _, key in items.values()}


def entry_of(esi, row):
    index = int(row["index"], 16)
    single = sum(int(one["index"], 16) == index for one in esi.rows) == 1 and "SubItem" not in {
        child.tag for child in esi.types[esi.objects[index].findtext("Type")]
    }
    return Entry(esi, index, int(row["sub"], 16), single)


def test_every_object_of_the_table_and_no_other(esi):
    assert set(esi.objects) == {int(row["index"], 16) for row in esi.rows}
    assert list(esi.objects) == sorted(esi.objects)


def test_entries_are_those_of_the_table(esi):
    directions = {"none": None, "rx": "R", "tx": "T", "both": "RT"}
    for row in esi.rows:
        entry = entry_of(esi, row)
        if row["type"] in STRINGS:
            assert re.fullmatch(STRINGS[row["type"]], entry.type), row
        else:
            assert entry.type == BASE_TYPES[row["type"]], row
        assert entry.flags.findtext("Access") == row["access"].replace("const", "ro"), row
        assert entry.flags.findtext("PdoMapping") == directions[row["pdo"]], row
        assert entry.flags.findtext("Backup") == ("1" if row["saved"] else None), row
        if int(row["sub"], 16) == 0:
            assert entry.object_name == row["name"], row
        else:
            assert entry.name.partition(" (SubIndex")[0] == row["name"], row


def test_values_and_limits_are_those_of_the_table(esi):
    for row in esi.rows:
        if int(row["index"], 16) == 0x1018:
            continue  # the nameplate is checked below
        info = entry_of(esi, row).info
        if row["type"] == "VISIBLE_STRING":
            assert info.findtext("DefaultString") == row["default"], row
        elif row["type"] == "REAL32":
            (value,) = struct.unpack("<f", bytes.fromhex(info.findtext("DefaultData")))
            assert value == pytest.approx(float(row["default"]), rel=1e-6), row
        elif row["type"] not in STRINGS:
            assert number(info.findtext("DefaultValue")) == int(row["default"], 0), row
            for element, column in (("MinValue", "min"), ("MaxValue", "max")):
                text = info.findtext(element)
                assert (None if text is None else number(text)) == (int(row[column], 0) if row[column] else None), row


UNITS = {"ms": "#xFD030000", "us": "#xFA030000", "ns": "#xF7030000", "rpm": "#x00B44700", "V": "#x00260000",
         "degC": "#x002D0000", "Hz": "#x00200000", "inc": "#x00B50000", "0.1%": "#xFD000000", "mA": "#xFD040000"}  # fmt: skip


def test_units(esi):
    seen = 0
    for row in esi.rows:
        if row["unit"] in UNITS:
            assert entry_of(esi, row).info.findtext("Unit") == UNITS[row["unit"]], row
            seen += 1
        elif not row["unit"]:
            assert entry_of(esi, row).info.find("Unit") is None, row
    assert seen > 10


def test_entries_of_an_object_lie_one_behind_the_other(esi):
    for index, described in esi.objects.items():
        size = int(described.findtext("BitSize"))
        kind = esi.types[described.findtext("Type")]
        assert int(kind.findtext("BitSize")) == size, hex(index)
        end = 0
        for item in kind.findall("SubItem"):
            offset, bits = int(item.findtext("BitOffs")), int(item.findtext("BitSize"))
            assert int(esi.types[item.findtext("Type")].findtext("BitSize")) == bits
            assert offset >= end, hex(index)
            assert item.findtext("Type") == "BOOL" or offset % 8 == 0, hex(index)
            end = max(offset + bits, 16)  # a byte follows sub-index 0
        assert end in (0, size), hex(index)


# ---- Slave information memory ----

TYPE_NUMBERS = {"BOOL": 0x01, "SINT": 0x02, "INT": 0x03, "DINT": 0x04, "USINT": 0x05, "UINT": 0x06, "UDINT": 0x07,
                "REAL": 0x08, "STRING": 0x09, "ARRAY": 0x0A, "LINT": 0x15, "ULINT": 0x1B}  # fmt: skip


def checksum(data):
    """CRC-8 with polynomial 07h and initial value FFh (ETG.1000.6 table 16)."""
    value = 0xFF
    for byte in data:
        value ^= byte
        for _ in range(8):
            value = (value << 1 ^ 0x07 if value & 0x80 else value << 1) & 0xFF
    return value


def memory_from_esi(esi):
    """Returns the content of the slave information memory by the rules of ETG.2010, with strings in place of their
    numbers."""
    device = esi.device
    kind = device.find("Type")
    size = int(device.findtext("Eeprom/ByteSize"))
    config = bytes.fromhex(device.findtext("Eeprom/ConfigData"))
    channels = device.findall("Sm")
    coe = device.find("Mailbox/CoE")
    foe = device.find("Mailbox/FoE") is not None

    def mailbox(use):
        (channel,) = (one for one in channels if one.text == use)
        return number(channel.get("StartAddress")), number(channel.get("DefaultSize"))

    def pdos(element):
        return [
            {
                "index": number(pdo.findtext("Index")),
                "name": pdo.findtext("Name"),
                "sm": int(pdo.get("Sm", 0xFF)),
                "flags": 0x10 if pdo.get("Fixed") == "1" else 0,
                "entries": [
                    (
                        number(entry.findtext("Index")),
                        number(entry.findtext("SubIndex", "0")),
                        entry.findtext("Name", ""),
                        TYPE_NUMBERS.get(re.split(r"[ (]", entry.findtext("DataType", ""))[0], 0),
                        int(entry.findtext("BitLen")),
                    )
                    for entry in pdo.findall("Entry")
                ],
            }
            for pdo in device.findall(element)
        ]

    def on(name, bit):
        return bit if coe.get(name) in ("1", "true") else 0

    return {
        "size": size,
        "config": config.ljust(14, b"\0") + bytes([checksum(config.ljust(14, b"\0")), 0]),
        "vendor": number(esi.document.findtext("Vendor/Id")),
        "product": number(kind.get("ProductCode")),
        "revision": number(kind.get("RevisionNo")),
        "bootstrap": bytes.fromhex(device.findtext("Eeprom/BootStrap", "00" * 8)),
        "mailbox": (*mailbox("MBoxOut"), *mailbox("MBoxIn")),
        "protocols": 0x04 | (0x08 if foe else 0),
        "group": device.findtext("GroupType"),
        "order": kind.text,
        "name": device.findtext("Name"),
        "coe": 0x01 | on("SdoInfo", 0x02) | on("PdoAssign", 0x04) | on("PdoConfig", 0x08) | on("PdoUpload", 0x10)
        | on("CompleteAccess", 0x20),
        "foe": foe,
        "flags": 0x08 if device.findtext("Info/IdentificationReg134") == "1" else 0,
        "current": int(device.findtext("Info/Electrical/EBusCurrent", "0")),
        "ports": [{"Y": 1, "K": 3}[port] for port in device.get("Physics")],
        "fmmus": [{"Outputs": 1, "Inputs": 2, "MBoxState": 3}[one.text] for one in device.findall("Fmmu")],
        "sync managers": [
            (
                number(one.get("StartAddress")),
                number(one.get("DefaultSize")),
                number(one.get("ControlByte")),
                number(one.get("Enable")),
                {"MBoxOut": 1, "MBoxIn": 2, "Outputs": 3, "Inputs": 4}[one.text],
            )
            for one in channels
        ],
        "TxPDOs": pdos("TxPdo"),
        "RxPDOs": pdos("RxPdo"),
        "clock": [
            (
                one.findtext("Name"),
                one.findtext("Desc", ""),
                number(one.findtext("AssignActivate")),
                int(one.findtext("CycleTimeSync0", "0")),
                int(one.find("CycleTimeSync0").get("Factor", "0")),
                int(one.findtext("ShiftTimeSync0", "0")),
                int(one.find("CycleTimeSync1").get("Factor", "0")),
                int(one.findtext("ShiftTimeSync1", "0")),
            )
            for one in device.findall("Dc/OpMode")
        ],
    }  # fmt: skip


def memory_from_bytes(image):
    """Returns the same from the bytes of the memory; checks every byte, and that every string is used."""
    unpack = struct.unpack_from
    categories = {}
    at = 128
    while (kind := unpack("<H", image, at)[0]) != 0xFFFF:
        (words,) = unpack("<H", image, at + 2)
        assert kind not in categories
        categories[kind] = image[at + 4 : at + 4 + 2 * words]
        at += 4 + 2 * words
    assert set(image[at:]) == {0xFF}
    assert set(categories) <= {10, 30, 40, 41, 50, 51, 60}

    strings, used, at = [""], {0}, 1
    for _ in range(categories[10][0]):
        length = categories[10][at]
        strings.append(categories[10][at + 1 : at + 1 + length].decode())
        at += 1 + length
    assert not any(categories[10][at:]) and len(categories[10]) - at < 2

    def string(place):
        used.add(place)
        return strings[place]

    def pdos(data):
        found, at = [], 0
        while at < len(data):
            index, count, sm, sync, name, flags = unpack("<HBBBBH", data, at)
            assert sync == 0
            at += 8
            entries = []
            for _ in range(count):
                entry, sub, title, kind, bits, none = unpack("<HBBBBH", data, at)
                assert none == 0
                entries.append((entry, sub, string(title), kind, bits))
                at += 8
            found.append({"index": index, "name": string(name), "sm": sm, "flags": flags, "entries": entries})
        return found

    general = categories[30]
    assert len(general) == 32
    assert not any(general[i] for i in (1, 4, *range(7, 11), 14, 15, *range(18, 32)))  # these devices do not use them
    words = struct.unpack_from("<4H", image, 0x18 * 2)
    clock = []
    for cycle0, shift0, shift1, factor1, activate, factor0, name, text, none in struct.iter_unpack(
        "<IIIhHhBB4s", categories.get(60, b"")
    ):
        assert none == bytes(4)
        clock.append((string(name), string(text), activate, cycle0, factor0, shift0, factor1, shift1))
    assert not any(image[i] for i in (*range(0x10 * 2, 0x14 * 2), *range(0x1D * 2, 0x3E * 2)))
    assert unpack("<H", image, 0x3F * 2) == (1,)
    memory = {
        "size": (unpack("<H", image, 0x3E * 2)[0] + 1) * 128,
        "config": image[:16],
        "vendor": unpack("<I", image, 16)[0],
        "product": unpack("<I", image, 20)[0],
        "revision": unpack("<I", image, 24)[0],
        "bootstrap": image[40:48],
        "mailbox": words,
        "protocols": unpack("<H", image, 0x1C * 2)[0],
        "group": string(general[0]),
        "order": string(general[2]),
        "name": string(general[3]),
        "coe": general[5],
        "foe": bool(general[6]),
        "flags": general[11],
        "current": unpack("<h", general, 12)[0],
        "ports": [port for shift in range(0, 16, 4) if (port := unpack("<H", general, 16)[0] >> shift & 15)],
        "fmmus": [one for one in categories[40] if one],
        "sync managers": [
            (start, length, control, enable, kind)
            for start, length, control, status, enable, kind in struct.iter_unpack("<HHBBBB", categories[41])
        ],
        "TxPDOs": pdos(categories.get(50, b"")),
        "RxPDOs": pdos(categories.get(51, b"")),
        "clock": clock,
    }
    assert used == set(range(len(strings))), "strings that nothing names"
    return memory


def test_memory_is_what_the_file_says(esi):
    image = export("sii", esi.product)
    expected = memory_from_esi(esi)
    assert len(image) == expected["size"]
    assert memory_from_bytes(image) == expected
    assert expected["RxPDOs"] and expected["TxPDOs"]


def test_identity_is_that_of_the_dictionary(esi):
    """A table may leave the values of 1018h to the nameplate; the file contains them."""
    identity = {}
    for row in esi.rows:
        if int(row["index"], 16) == 0x1018:
            sub = int(row["sub"], 16)
            identity[sub] = number(entry_of(esi, row).info.findtext("DefaultValue"))
            assert int(row["default"], 0) in (0, identity[sub]), row
    memory = memory_from_esi(esi)
    assert (identity[1], identity[2], identity[3]) == (memory["vendor"], memory["product"], memory["revision"])


def test_process_data_are_the_defaults_of_the_dictionary(esi):
    defaults = {
        (int(row["index"], 16), int(row["sub"], 16)): int(row["default"], 0)
        for row in esi.rows
        if row["type"].startswith("UNSIGNED")
    }
    memory = memory_from_esi(esi)
    for direction, assignment, channel in (("RxPDOs", 0x1C12, 2), ("TxPDOs", 0x1C13, 3)):
        bits = 0
        for pdo in memory[direction]:
            index = pdo["index"]
            mapped = [defaults[index, sub] for sub in range(1, defaults[index, 0] + 1)]
            assert [entry[0] << 16 | entry[1] << 8 | entry[4] for entry in pdo["entries"]] == mapped, hex(index)
            assigned = [defaults[assignment, sub] for sub in range(1, defaults[assignment, 0] + 1)]
            assert pdo["sm"] == (channel if index in assigned else 0xFF), hex(index)
            bits += sum(entry[4] for entry in pdo["entries"]) if index in assigned else 0
        assert memory["sync managers"][channel][1] == (bits + 7) // 8


# ---- Start-up parameters ----


def test_start_up_commands_name_settings(esi):
    """A parameter that a master writes at start is marked so, is writable, and has the length of its entry."""
    named = set()
    for command in esi.device.findall("Mailbox/CoE/InitCmd"):
        index, sub = number(command.findtext("Index")), number(command.findtext("SubIndex"))
        (row,) = (one for one in esi.rows if int(one["index"], 16) == index and int(one["sub"], 16) == sub)
        entry = entry_of(esi, row)
        assert len(bytes.fromhex(command.findtext("Data"))) * 8 == max(entry.bits, 8), row
        assert row["access"] in ("rw", "wo"), row
        named.add((index, sub))
    settings = {
        (int(row["index"], 16), int(row["sub"], 16))
        for row in esi.rows
        if entry_of(esi, row).flags.findtext("Setting") == "1"
    }
    assert settings == named


# ---- Command line ----


def test_products_without_ethercat_say_which_have_it():
    others = [name for name in all_products() if name not in products_on_ethercat()]
    assert others
    for form in ("esi", "sii"):
        result = run("export", form, others[0])
        assert result.returncode == 2
        message = result.stderr.decode()
        assert f"`{others[0]}` is not on EtherCAT" in message
        assert all(f"`{name}`" in message for name in products_on_ethercat())
