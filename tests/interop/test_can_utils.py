"""can-utils on a SocketCAN interface of the line (run under tools/with-socketcan)."""

import re
import subprocess

import pytest
from conftest import LINK
from line import wait_for

pytestmark = pytest.mark.link("socketcan")
INTERFACE = LINK.partition(":")[2]


class Candump:
    """Runs candump in the background; returns its output."""

    def __init__(self, folder, *arguments):
        self.file = folder / "candump.txt"
        self.output = open(self.file, "w")
        self.process = subprocess.Popen(["candump", *arguments], stdout=self.output)
        # candump receives as soon as it has its socket; the test sends frames until one shows this.
        wait_for(self.listens, "candump to listen")

    def listens(self):
        cansend("7DF#00")
        return self.frames()

    def frames(self):
        return re.findall(rf"{INTERFACE} +([0-9A-F]+) +\[\d\] +([0-9A-F ]*[0-9A-F])", self.file.read_text())

    def stop(self):
        self.process.terminate()
        self.process.wait(30)
        self.output.close()


def cansend(frame):
    subprocess.run(["cansend", INTERFACE, frame], check=True, timeout=30)


@pytest.fixture
def candump(line, tmp_path):
    dump = Candump(tmp_path, INTERFACE)
    yield dump
    dump.stop()


def test_boot_up_shows_in_candump(line, candump):
    line.bench.post("axes/ismc/power", {"action": "cycle"})
    wait_for(lambda: ("701", "00") in candump.frames(), "boot-up of node 1")


def test_an_sdo_by_hand(candump):
    cansend("601#4000100000000000")
    wait_for(lambda: ("581", "43 00 10 00 92 01 02 00") in candump.frames(), "the device type")


def test_guarding_by_hand(candump):
    cansend("702#R")
    wait_for(lambda: ("702", "7F") in candump.frames(), "guarding answer, pre-operational")
    cansend("000#0102")
    cansend("702#R")
    wait_for(lambda: ("702", "85") in candump.frames(), "guarding answer, operational and toggled")


def test_a_move_by_hand(line, candump):
    """The ISMC manual's example of a relative move (ch. 6, 'Program modification and debugging'), only with cansend."""
    before = line.bench.true_position("ismc")
    cansend("000#0101")
    cansend("601#2F60600001000000")  # profile position
    cansend("301#0000000040420F00")  # RPDO2: target velocity 0, profile velocity 1000000
    for word in ("0600", "0700", "4F00"):
        cansend(f"201#{word}01A0860100")
        wait_for(
            lambda word=word: line.bench.axis("ismc")["controlword"] == int.from_bytes(bytes.fromhex(word), "little"),
            "the controlword",
        )
        state = {"0600": "ready to switch on", "0700": "switched on", "4F00": "operation enabled"}[word]
        wait_for(lambda state=state: line.bench.axis("ismc")["state"] == state, state)
    cansend("201#5F0001A0860100")
    wait_for(lambda: abs(line.bench.true_position("ismc") - before - 100_000) <= 8, "100000 counts of motion")


def test_a_log_is_replayed_by_canplayer(line, candump, tmp_path):
    log = tmp_path / "replay.log"
    log.write_text(f"(0.000000) {INTERFACE} 601#4008100000000000\n(0.010000) {INTERFACE} 601#6000000000000000\n")
    subprocess.run(["canplayer", "-I", log], check=True, timeout=60)
    wait_for(lambda: ("581", "00 53 61 70 70 68 69 72") in candump.frames(), "Sapphir")
