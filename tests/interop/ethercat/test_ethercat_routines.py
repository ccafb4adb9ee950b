"""The controllers' routines of the JMC manual, with their start-up lists, PDOs, scaling and motion programs."""

import os
import pathlib
import tomllib

import pytest
from capture import sdo_transfers
from drive import Drive
from routine import CYCLE_NS, Axis
from segment import segment

# The index is at whole turns: method 1 creeps to the first index behind the negative limit with 80 units/s, the
# default.
TRAVEL = """
  [axis.travel]
  counts_per_unit = 4000
  start = 0
  low_stop = -3
  high_stop = 20
  negative_limit = -2.1
  positive_limit = {positive}
  home = {{ from = 2.0, to = 3.0 }}
"""
FILES = sorted((pathlib.Path(__file__).parent / "routines").glob("*.toml"))


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_routine(file, start_line, open_master, objects, tmp_path):
    routine = tomllib.loads(file.read_text())
    travel = TRAVEL.format(positive=routine["home"] if routine.get("homing", {}).get("bit") == 1 else 19)
    log = pathlib.Path(os.environ.get("SERVODROME_CAPTURES", tmp_path)) / f"ethercat-routine-{file.stem}.pcap"
    line = start_line(segment(1, product="jmc_ec", travel=travel, model=routine["model"]), log=log)
    master = open_master()
    assert master.scan() == 1
    drive = Drive(master, 0, line.bench, "drive1", objects("jmc_ec"))
    drive.download(0x10F1, 0, 2)  # delays of a busy machine must not cause a fault
    for assignment, mapping, entries in ((0x1C12, 0x1600, "outputs"), (0x1C13, 0x1A00, "inputs")):
        if entries in routine:
            drive.remap(assignment, [(e >> 16, e >> 8 & 0xFF, e & 0xFF) for e in routine[entries]], mapping)
    for index, sub, value, bits in routine["start_up"]:
        drive.slave.sdo_write(index, sub, value.to_bytes(bits // 8, "little"))
    drive.learn_mapping()
    master.map(dc_cycle_ns=CYCLE_NS)
    master.start_cycle(CYCLE_NS * 1e-9)
    master.go_operational()
    for index, sub, value, _ in routine["start_up"]:
        assert drive.upload(index, sub) == value
    Axis(drive, routine).run()
    assert master.states() == [(8, 0)]
    master.close()
    line.stop()
    frames = [(bytes.fromhex(request), bytes.fromhex(answer)) for request, answer in routine.get("start_up_frames", [])]
    seen = sdo_transfers(log)
    assert any(seen[at : at + len(frames)] == frames for at in range(len(seen))), seen
