"""Compares the exported EDS of every product, read by the `canopen` package, with the exported CSV.

Environment:
  SERVODROME           the built program; `servodrome products --json` lists its products
  SERVODROME_PRODUCTS  optional: the products to test, separated by spaces
  SERVODROME_EDS       optional, in place of the program: EDS files separated by ':', each with its NAME.csv in the same
  folder

Nothing is skipped: without a program and without files the run fails.
"""

import configparser
import csv
import io
import json
import os
import pathlib
import re
import subprocess

import canopen
import pytest
from canopen.objectdictionary import ODArray, ODRecord, ODVariable, datatypes

NODE_ID = 0x12
TYPES = {
    name: getattr(datatypes, name)
    for name in (
        "BOOLEAN INTEGER8 INTEGER16 INTEGER32 INTEGER64 UNSIGNED8 UNSIGNED16 UNSIGNED32 UNSIGNED64 REAL32 "
        "VISIBLE_STRING OCTET_STRING DOMAIN"
    ).split()
}
MAPPING = [*range(0x1600, 0x1800), *range(0x1A00, 0x1C00)]


def program(*arguments):
    result = subprocess.run(
        [os.environ["SERVODROME"], *arguments], capture_output=True, timeout=60, check=False
    )
    assert result.returncode == 0, f"servodrome {' '.join(arguments)}: {result.stderr.decode()}"
    return result.stdout.decode()


def product_names():
    if "SERVODROME_PRODUCTS" in os.environ:
        return os.environ["SERVODROME_PRODUCTS"].split()
    listed = json.loads(program("products", "--json"))
    if isinstance(listed, dict):
        listed = listed["products"]
    return [product if isinstance(product, str) else product["name"] for product in listed]


def sources():
    if files := os.environ.get("SERVODROME_EDS"):
        return [pathlib.Path(name) for name in files.split(":")]
    if "SERVODROME" not in os.environ:
        raise RuntimeError("set SERVODROME to the built program, or SERVODROME_EDS to EDS files")
    names = product_names()
    assert names, "servodrome knows no products"
    return names


# Differences between a product's manual and CiA 301; the drive follows its manual.
HIGHEST_SUB_INDEX = {"pronet": {index: 4 for index in range(0x1800, 0x1804)}}  # although sub-index 5 exists (ch. 3.3)
# 8 bits in 16 (ProNet, ch. 3.3), the low 16 bits of 32 (JMC EC, Table 219).
PADDED_MAPPINGS = {"pronet": {0x60600010, 0x60610010}, "jmc_ec": {0x60FD0010}}


# In a device on EtherCAT, 1600h to 1C13h follow ETG.1000: sub-index 0 of an assignment is the number of PDOs. PDOs may
# have gaps, may exceed the 64 bits of a CAN frame, and have no communication parameters.
ASSIGNMENTS = (0x1C12, 0x1C13)


class Export:
    """One EDS as text, as sections, and as the package's dictionary; and the rows of the CSV."""

    def __init__(self, source):
        self.name = source.stem if isinstance(source, pathlib.Path) else source
        if isinstance(source, pathlib.Path):
            self.text = source.read_bytes().decode("ascii")
            table = source.with_suffix(".csv").read_text()
        else:
            self.text = program("export", "eds", source)
            table = program("export", "csv", source)
        self.rows = list(csv.DictReader(io.StringIO(table)))
        self.sections = configparser.RawConfigParser(strict=True)  # refuses duplicate sections and keys
        self.sections.optionxform = str
        self.sections.read_string(self.text)
        file = io.StringIO(self.text)
        file.name = "export.eds"
        self.dictionary = canopen.import_od(file, NODE_ID)
        self.objects = [row for row in self.rows if int(row["index"], 16) >= 0x1000]
        self.on_ethercat = 0x1C12 in self.dictionary

    def section(self, row):
        name = row["index"][2:]
        if not self.sections.has_option(name, "SubNumber"):
            return self.sections[name]
        return self.sections[f"{name}sub{int(row['sub'], 16):X}"]

    def variable(self, row):
        found = self.dictionary[int(row["index"], 16)]
        return found if isinstance(found, ODVariable) else found[int(row["sub"], 16)]

    def number(self, row):
        """Returns the default of a row as a number, for node NODE_ID."""
        text, _, node = row["default"].partition("+NodeID")
        return int(text, 0) + (NODE_ID if "+NodeID" in row["default"] else 0)


@pytest.fixture(scope="module", params=sources(), ids=str)
def export(request):
    return Export(request.param)


def test_every_row_of_the_table_and_nothing_else_is_in_the_eds(export):
    assert export.objects
    expected = {(int(row["index"], 16), int(row["sub"], 16)) for row in export.objects}
    actual = set()
    for entry in export.dictionary.values():
        if entry.index < 0x1000:
            continue  # the package makes objects of [DummyUsage]
        if isinstance(entry, ODVariable):
            actual.add((entry.index, 0))
        else:
            assert isinstance(entry, (ODArray, ODRecord))
            actual.update((entry.index, sub) for sub in entry.subindices)
    assert actual == expected


def test_types_access_and_mapping_are_those_of_the_table(export):
    access_words = {("rw", "rx"): "rww", ("rw", "tx"): "rwr"}
    for row in export.objects:
        variable = export.variable(row)
        assert variable.data_type == TYPES[row["type"]], row
        assert variable.access_type == access_words.get((row["access"], row["pdo"]), row["access"]), row
        assert variable.pdo_mappable == (row["pdo"] != "none"), row
        assert variable.readable == (row["access"] != "wo"), row
        assert variable.writable == (row["access"] in ("rw", "wo")), row


def test_defaults_and_limits_are_those_of_the_table(export):
    for row in export.objects:
        variable = export.variable(row)
        if row["type"] == "REAL32":
            assert variable.default == float(row["default"]), row
        elif row["type"] == "VISIBLE_STRING":
            assert variable.default == row["default"].replace(";", ","), row
        elif row["type"] in ("OCTET_STRING", "DOMAIN"):
            assert variable.default == bytes.fromhex(row["default"]), row
        else:
            assert variable.default == export.number(row), row
            assert variable.min == (int(row["min"], 0) if row["min"] else None), row
            assert variable.max == (int(row["max"], 0) if row["max"] else None), row
            assert variable.relative == ("NodeID" in row["default"]), row


def test_device_info_agrees_with_the_objects(export):
    information = export.dictionary.device_information
    identity = export.dictionary[0x1018]
    assert information.vendor_number == identity[1].default
    assert information.product_number == identity[2].default
    assert information.revision_number == identity[3].default
    for key in ("VendorName", "ProductName", "OrderCode"):
        assert export.sections["DeviceInfo"][key], key
    assert bool(information.allowed_baudrates) != export.on_ethercat
    for count, parameters in (
        (information.nr_of_RXPDO, range(0x1400, 0x1600)),
        (information.nr_of_TXPDO, range(0x1800, 0x1A00)),
    ):
        present = [index for index in parameters if index in export.dictionary]
        assert count == len(present)
        assert all(index + 0x200 in export.dictionary for index in present)


def test_mandatory_objects_are_there(export):
    for index in (0x1000, 0x1001, 0x1018):
        assert index in export.dictionary


def test_lists_of_objects_hold_every_object_once(export):
    listed = []
    for name, contains in (
        ("MandatoryObjects", lambda i: i in (0x1000, 0x1001, 0x1018)),
        ("OptionalObjects", lambda i: 0x1000 <= i < 0x2000 or i >= 0x6000),
        ("ManufacturerObjects", lambda i: 0x2000 <= i < 0x6000),
    ):
        section = dict(export.sections[name])
        count = int(section.pop("SupportedObjects"))
        indices = [int(section.pop(str(number)), 0) for number in range(1, count + 1)]
        assert not section, f"[{name}] has more than it says"
        assert indices == sorted(indices)
        assert all(contains(index) for index in indices), name
        listed += indices
    assert sorted(listed) == sorted({int(row["index"], 16) for row in export.objects})


def test_sub_index_0_is_the_highest_sub_index(export):
    for entry in export.dictionary.values():
        if isinstance(entry, ODVariable):
            continue
        section = export.sections[f"{entry.index:04X}"]
        assert int(section["SubNumber"]) == len(entry.subindices)
        if entry.index != 0x1003 and entry.index not in (*MAPPING, *ASSIGNMENTS):
            highest = HIGHEST_SUB_INDEX.get(export.name, {}).get(entry.index, max(entry.subindices))
            assert entry[0].default == highest, hex(entry.index)
        if isinstance(entry, ODArray):  # elements of an ARRAY have one type
            assert len({variable.data_type for sub, variable in entry.subindices.items() if sub}) <= 1, hex(entry.index)


def test_mapped_objects_exist_fit_and_have_the_direction(export):
    """Checks the default mappings: the objects can be mapped in that direction, with their length, in 64 bits in
    total."""
    for index in MAPPING:
        if index not in export.dictionary:
            continue
        mapping = export.dictionary[index]
        is_rpdo = index < 0x1800
        total = 0
        for sub in range(1, mapping[0].default + 1):
            value = mapping[sub].default
            target, target_sub, bits = value >> 16, value >> 8 & 0xFF, value & 0xFF
            where = f"{index:04X}sub{sub:X}={value:#010x}"
            total += bits
            if target == 0 and export.on_ethercat:
                continue  # a gap
            if target < 0x1000:
                assert is_rpdo and export.sections["DummyUsage"][f"Dummy{target:04X}"] == "1", where
                continue
            entry = export.dictionary[target]
            variable = entry if isinstance(entry, ODVariable) else entry[target_sub]
            assert not isinstance(entry, ODVariable) or target_sub == 0, where
            assert variable.pdo_mappable, where
            if value in PADDED_MAPPINGS.get(export.name, ()):
                assert len(variable) != bits, where
            else:
                assert len(variable) == (1 if variable.data_type == datatypes.BOOLEAN else bits), where
            assert variable.access_type in (("wo", "rww", "rw") if is_rpdo else ("ro", "const", "rwr", "rw")), where
        assert total <= 64 or export.on_ethercat, f"{index:04X}"
        writable = {variable.writable for variable in mapping.values()}
        assert len(writable) == 1, f"{index:04X}: some of the mapping can be changed and some not"


def test_every_line_is_short_ascii_ended_by_cr_lf(export):
    lines = export.text.split("\r\n")
    assert lines.pop() == ""
    for line in lines:
        assert len(line) < 255
        assert re.fullmatch(r"\[[A-Za-z0-9]+\]|[A-Za-z0-9_]+=[ -~]*|", line), line
