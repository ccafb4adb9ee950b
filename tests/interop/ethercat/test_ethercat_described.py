"""Drives from ESI files, operated by pysoem; and clones."""

import json
import pathlib

import pytest
from drive import Drive
from line import COUNTS, servodrome, wait_for
from segment import segment

DATA = pathlib.Path(__file__).parents[2] / "data/described"
# Encoder, bytes of process data out and in, identity
SLAVES = {
    "dictionary_defaults.xml": ("", 65536, 6, 6, (0xA010, 0x201)),
    "several_devices.xml": ('device = "DUO-1"', 65536, 8, 8, (40977, 0x301)),
    "process_data_only.xml": ("", COUNTS, 11, 13, (251, 0x69500001)),
    "slots_and_modules.xml": ("", 65536, 7, 7, (0xA013, 0x401)),
}


def described_segment(file, counts, more=""):
    return f"""
[[bus]]
name = "ecat"
type = "ethercat"
[[axis]]
name = "axis"
description = "{file}"
{more}
  [axis.travel]
  counts_per_unit = {counts}
  negative_limit = -10
  positive_limit = 10
  home = {{ from = -0.5, to = 0.5 }}
"""


def objects_of(bench):
    return {(int(entry["index"], 16), int(entry["sub"])): entry for entry in bench.get("axes/axis/objects")["objects"]}


@pytest.mark.parametrize("file", SLAVES)
def test_a_described_slave_homes_and_moves(file, start_line, open_master):
    more, counts, outputs, inputs, identity = SLAVES[file]
    line = start_line(described_segment(DATA / file, counts, more))
    master = open_master()
    assert master.scan() == 1
    slave = master.slaves[0]
    assert (slave.man, slave.id) == identity
    drive = Drive(master, 0, line.bench, "axis", objects_of(line.bench))
    master.map()
    assert (len(slave.output), len(slave.input)) == (outputs, inputs)
    drive.learn_mapping()
    master.go_operational()

    def bits(mask):
        wait_for(lambda: drive.read(0x6041) & mask == mask, lambda: f"statusword {drive.read(0x6041):04X}h")

    drive.write(0x6060, 6)
    drive.write(0x6098, 35)
    drive.enable()
    drive.control(0x1F)
    bits(0x1400)
    drive.control(0x0F)
    drive.write(0x6060, 1)
    wait_for(lambda: drive.read(0x6061) == 1, "mode 1")
    begin = drive.true_position
    drive.write(0x607A, 2 * counts)
    drive.control(0x1F)
    bits(0x1000)
    drive.control(0x0F)
    wait_for(lambda: abs(drive.true_position - begin - 2 * counts) < counts / 100, "two revolutions")
    drive.disable()


def test_the_clone_of_a_clone_is_the_same(start_line, tmp_path):
    first = start_line(segment(1), link="udp:127.0.0.1:0")
    files = [tmp_path / name / "copy.xml" for name in ("one", "two")]
    for file in files:
        file.parent.mkdir()
    link = first.links["ecat"][0]
    assert "--eds is for CAN" in servodrome("clone", "--bus", link, "-o", files[0], "--eds", "a.eds", status=2)
    report = json.loads(servodrome("clone", "--bus", link, "-o", files[0], "--json", "--timeout", 10))
    assert report["values"] > 100 and not report["unread"]
    first.stop()
    second = start_line(described_segment(files[0], COUNTS), link="udp:127.0.0.1:0")
    servodrome("clone", "--bus", second.links["ecat"][0], "-o", files[1], "--timeout", 10)
    # A drive from a description has no FoE.
    without_foe = "".join(row for row in files[0].read_text().splitlines(keepends=True) if row.strip() != "<FoE/>")
    assert without_foe == files[1].read_text() != files[0].read_text()
