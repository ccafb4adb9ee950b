"""Drives from makers' descriptions, operated by the `canopen` master with the same file; and clones."""

import json
import pathlib
import re

import canopen
import pytest
from drive402 import Drive402
from line import COUNTS, TWO_DRIVES, servodrome, wait_for

pytestmark = [pytest.mark.once, pytest.mark.program("the program is the master")]  # independent of the link

DATA = pathlib.Path(__file__).parents[1] / "data/described"
ENCODERS = {
    "mapping_counts.dcf": 4096,
    "device_commissioning.dcf": COUNTS,
    "capital_access.eds": COUNTS,
    "compact_arrays.eds": 10000,
}


def described_line(file, counts):
    return f"""
[[bus]]
name = "can0"
[[axis]]
name = "axis"
description = "{file}"
node = 3
  [axis.travel]
  counts_per_unit = {counts}
  negative_limit = -10
  positive_limit = 10
  home = {{ from = -0.5, to = 0.5 }}
"""


def sheet_for_canopen(file, folder):
    """The file in a form that the master's library can read: UTF-8, without objects that it refuses (2100h, 2101h)."""
    text = (DATA / file).read_text(encoding="latin-1")
    text = re.sub(r"\[2100\].*?(?=\[6040\])", "", text, flags=re.DOTALL)
    sheet = folder / file.replace(".dcf", ".eds")
    sheet.write_text(text, encoding="utf-8")
    return canopen.import_od(str(sheet), 3)


@pytest.mark.parametrize("file", ENCODERS)
def test_a_described_drive_homes_and_moves(file, start_line, connect, tmp_path):
    counts = ENCODERS[file]
    line = start_line(described_line(DATA / file, counts))
    network = connect(line)
    node = network.add_node(3, sheet_for_canopen(file, tmp_path))
    node.sdo.RESPONSE_TIMEOUT = 10
    drive = Drive402(node, line.bench, "axis")

    def bits(mask):
        wait_for(lambda: drive.statusword & mask == mask, lambda: f"statusword {drive.statusword:04X}h")

    def mode(number):
        drive.write(0x6060, number)
        wait_for(lambda: drive.read(0x6061) == number, f"mode {number}")

    mode(6)
    drive.write(0x6098, 35)
    drive.enable()
    drive.control(0x1F)
    bits(0x1400)
    drive.control(0x0F)
    mode(1)
    begin = drive.true_position
    drive.write(0x607A, 2 * counts)
    drive.control(0x1F)
    bits(0x1000)
    drive.control(0x0F)
    wait_for(lambda: abs(drive.true_position - begin - 2 * counts) < counts / 100, "two revolutions")
    drive.disable()


def test_up_says_what_is_not_simulated(start_line):
    line = start_line(described_line(DATA / "mapping_counts.dcf", 4096))
    axis = line.ready["axes"][0]
    assert axis["product"] == "eds:mapping_counts.dcf"
    assert any(text.startswith("homing methods -5") for text in axis["not_simulated"])
    assert axis["notes"]


def test_wrong_files_are_refused(tmp_path):
    bad = tmp_path / "bad.eds"
    bad.write_text("[6041]\nParameterName=x\nDataType=two\n")
    said = servodrome("up", "--eds", bad, status=2)
    assert "bad.eds:3, [6041] DataType" in said
    said = servodrome("up", "--eds", DATA / "several_devices.xml", status=2)
    assert "--esi" in said or "devices are described" in said
    said = servodrome("up", "--esi", DATA / "several_devices.xml", status=2)
    assert "DUO-1" in said and "TRIO-1" in said


@pytest.mark.parametrize("product, node", [("generic402", 2), ("ismk", 4)])
def test_the_clone_of_a_clone_is_the_same(product, node, start_line, tmp_path):
    text = TWO_DRIVES.replace('product = "ismc"', f'product = "{product}"').replace("node = 1", f"node = {node + 10}")
    first = start_line(text)
    files = [tmp_path / name / "copy.dcf" for name in ("one", "two")]
    for file in files:
        file.parent.mkdir()
    link = first.links["can0"][0]
    report = json.loads(servodrome("clone", "--bus", link, "--node", node + 10, "-o", files[0], "--json", "--timeout", 10))
    assert report["values"] > 100 and not report["unread"]
    first.stop()
    second = start_line(described_line(files[0], COUNTS).replace("node = 3", f"node = {node + 10}"))
    servodrome("clone", "--bus", second.links["can0"][0], "--node", node + 10, "-o", files[1], "--timeout", 10)
    assert files[0].read_text() == files[1].read_text()
