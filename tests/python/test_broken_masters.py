"""A machine program with one of ten errors gets ten different verdicts, in virtual time. The correct program passes all
of them."""

import time

import canopen
import pytest
import servodrome
import servodrome.can_bus  # noqa: F401 (registers the interface)
from canopen.sdo.exceptions import SdoAbortedError, SdoCommunicationError
from conftest import ROOT

LINE = ROOT / "scenarios/lines/can.toml"
REVOLUTION = 131072
FAULT, ENABLED = 0x08, 0x27


class Stopped(Exception):
    """The program gives up."""


class Program:
    """Enables an axis, moves it by six revolutions, and disables it. `broken` names its error."""

    def __init__(self, line, broken):
        self.broken = broken
        self.emergencies = []
        self.heard_at = time.monotonic()
        self.network = canopen.Network()
        self.network.connect(interface="servodrome", channel="can0", line=line)
        self.node = self.network.add_node(1, canopen.ObjectDictionary())
        self.node.sdo.RESPONSE_TIMEOUT = 0.2
        self.node.emcy.add_callback(lambda error: self.emergencies.append(error.code))
        self.node.nmt.add_heartbeat_callback(self.heartbeat)

    def heartbeat(self, _state):
        self.heard_at = time.monotonic()

    def write(self, index, value, size):
        try:
            self.node.sdo.download(index, 0, value.to_bytes(size, "little", signed=value < 0))
        except SdoAbortedError:
            if self.broken != "ignores aborts":
                raise

    def read(self, index, sub=0, signed=False):
        return int.from_bytes(self.node.sdo.upload(index, sub), "little", signed=signed)

    def wait(self, mask, value, timeout, what):
        end = time.monotonic() + timeout
        while self.read(0x6041) & mask != value:
            self.look_after()
            if time.monotonic() > end:
                if self.broken == f"does not wait for {what}":
                    return
                raise Stopped(what)
            time.sleep(0.005)

    def look_after(self):
        if time.monotonic() - self.heard_at > 0.3 and self.broken != "does not watch the heartbeat":
            raise Stopped("heartbeat")
        if any(self.emergencies) and self.broken != "ignores emergencies":
            raise Stopped("emergency")
        if self.read(0x6041) & 0x4F == FAULT:
            if self.broken == "resets a fault without reading it":
                self.write(0x6040, 0x80, 2)
                self.write(0x6040, 0x00, 2)
            elif self.broken != "does not read the fault":
                self.read(0x603F)
            raise Stopped("fault")

    def run(self):
        if self.broken != "takes any device" and self.read(0x1018, 1) != 0x53455256:
            raise Stopped("another device")
        self.write(0x1017, 50, 2)
        self.write(0x6060, 1, 1)
        if self.broken != "does not read the mode" and self.read(0x6061) != 1:
            raise Stopped("mode")
        for index, value in ((0x6081, 2 * REVOLUTION), (0x6083, 100 * REVOLUTION), (0x6084, 100 * REVOLUTION)):
            self.write(index, value, 4)
        time.sleep(0.1)
        for word, value in ((0x06, 0x21), (0x07, 0x23), (0x0F, ENABLED)):
            self.write(0x6040, word, 2)
            self.wait(0x6F, value, 1, "enabling")
        begin = self.read(0x6064, signed=True)
        self.write(0x607A, 6 * REVOLUTION, 4)
        self.write(0x6040, 0x5F, 2)
        self.wait(0x1000, 0x1000, 1, "the acknowledge")
        self.write(0x6040, 0x4F, 2)
        self.wait(0x0400, 0x0400, 8, "the target")
        way = self.read(0x6064, signed=True) - begin
        if self.broken != "does not compare positions" and abs(way - 6 * REVOLUTION) > REVOLUTION:
            raise Stopped("position")

    def __call__(self):
        """Returns True if the program reports success."""
        try:
            self.run()
            return True
        except (Stopped, SdoAbortedError, SdoCommunicationError):
            return False
        finally:
            if self.broken != "leaves the drive enabled":
                self.node.sdo.download(0x6040, 0, bytes(2))
            self.network.disconnect()


# The error, the rules, and the expectation that detects it.
MOVING = 'when = { state = "operation_enabled", speed_above_rpm = 60 }\n'
CASES = {
    "ignores aborts": (
        '[[rule]]\nname = "r"\non = { message = "sdo_request", object = "6081" }\ndo = "abort"\ncode = 0x06090030\n',
        'name = "does not move at another speed"\nwhen = { after = "r" }\nalways = { at_rest = true }\n',
    ),
    "does not watch the heartbeat": (
        f'[[rule]]\nname = "r"\n{MOVING}on = {{ message = "heartbeat" }}\ndo = "withhold"\n',
        'name = "stops when the heartbeat is missing"\nwhen = { after = "r" }\neventually = { at_rest = true }\nwithin_ms = 1000\n',
    ),
    "ignores emergencies": (
        f'[[rule]]\nname = "r"\n{MOVING}do = "emergency"\ncode = 0x2310\n',
        'name = "stops after an emergency"\nwhen = { after = "r" }\neventually = { at_rest = true }\nwithin_ms = 500\n',
    ),
    "does not read the fault": (
        f'[[rule]]\nname = "r"\n{MOVING}do = "inject"\nfault = "0x2310"\n[[rule]]\nname = "quiet"\non = {{ message = "emergency" }}\ndo = "withhold"\n',
        'name = "reads the error code"\nwhen = { after = "r" }\neventually = { message = { message = "sdo_request", object = "603F" } }\n',
    ),
    "resets a fault without reading it": (
        f'[[rule]]\nname = "r"\n{MOVING}for_ms = 20\ndo = "inject"\nfault = "0x2310"\n[[rule]]\nname = "quiet"\non = {{ message = "emergency" }}\ndo = "withhold"\n',
        'name = "does not reset by itself"\nwhen = { after = "r" }\nnever = { message = { message = "sdo_request", object = "6040", data = "2B 40 60 00 80" } }\n',
    ),
    "takes any device": (
        '[[rule]]\nname = "r"\ndo = "show"\nobject = "1018:01"\nvalue = 7\n',
        'name = "moves no other device"\nalways = { at_rest = true }\n',
    ),
    "does not read the mode": (
        '[[rule]]\nname = "r"\ndo = "ignore"\nobject = "6060"\n',
        'name = "does not enable in another mode"\nnever = { state = "operation_enabled" }\n',
    ),
    "does not wait for enabling": (
        '[[rule]]\nname = "r"\ndo = "ignore"\nobject = "6040"\nmask = 0x08\n',
        'name = "sends no target to a drive that is not enabled"\nnever = { message = { message = "sdo_request", object = "607A" } }\n',
    ),
    "does not compare positions": (
        f'[[rule]]\nname = "r"\n{MOVING}do = "show"\nobject = "6041"\nset_bits = 0x0400\n',
        'name = "tells no success half-way"\nalways = { exit = "failure" }\nwhen = { ended_ms = 0 }\n',
    ),
    "leaves the drive enabled": (
        f'[[rule]]\nname = "r"\n{MOVING}do = "show"\nobject = "606C"\nvalue = 0\n',
        'name = "disables at its end"\nwhen = { ended_ms = 100 }\nnever = { state = "operation_enabled" }\n',
    ),
}


def trial(case, broken):
    rules, expectation = CASES[case]
    with servodrome.Line.from_file(LINE) as line, line.virtual_time():
        with line.scenario(text=f'title = "{case}"\n{rules}[[expect]]\n{expectation}') as scenario:
            scenario.master_ended(Program(line, broken)())
            time.sleep(1)
        return {name: rule.acts for name, rule in scenario.rules.items()}, scenario.verdicts


@pytest.mark.parametrize("case", CASES)
def test_the_broken_program_fails_and_the_whole_one_does_not(case):
    acts, verdicts = trial(case, case)
    assert acts["r"] > 0
    assert [verdict.outcome.value for verdict in verdicts] == ["failed"]
    acts, verdicts = trial(case, "")
    assert acts["r"] > 0
    assert [verdict.outcome.value for verdict in verdicts] == ["passed"]


def test_the_verdicts_differ():
    names = [trial(case, case)[1][0].name for case in CASES]
    assert len(set(names)) == len(CASES) == 10
