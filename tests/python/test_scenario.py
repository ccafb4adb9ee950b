"""Scenarios in the process: unmodified `canopen` code communicates with drives that misbehave, in virtual time."""

import canopen
import pytest
import servodrome
import servodrome.can_bus  # noqa: F401 (registers the interface)
from canopen.sdo.exceptions import SdoAbortedError, SdoCommunicationError
from conftest import ROOT
from servodrome import Outcome

LINE = ROOT / "scenarios/lines/can.toml"
LIBRARY = ROOT / "scenarios/canopen"


class Master:
    """A node of the library canopen on a line in virtual time."""

    def __init__(self, line):
        self.network = canopen.Network()
        self.network.connect(interface="servodrome", channel="can0", line=line)
        self.node = self.network.add_node(1, canopen.ObjectDictionary())
        self.node.sdo.RESPONSE_TIMEOUT = 0.2

    def read(self, index, sub=0):
        return int.from_bytes(self.node.sdo.upload(index, sub), "little")

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.network.disconnect()


def observed(text, what):
    """Returns what a client observes under the rules of `text`, and what the rules have done."""
    with servodrome.Line.from_file(LINE) as line, line.virtual_time(), line.scenario(text='title = "t"\n' + text) as rules:
        with Master(line) as master:
            seen = what(master)
        return seen, {name: rule.acts for name, rule in rules.rules.items()}, line.now_ns


def error_of(action):
    try:
        action()
    except (SdoAbortedError, SdoCommunicationError) as error:
        return str(error)
    return ""


def test_an_abort_reaches_the_client_with_its_code():
    rules = '[[rule]]\non = { message = "sdo_answer", object = "6041" }\ndo = "abort"\ncode = 0x08000022\n'
    seen, acts, _ = observed(rules, lambda master: error_of(lambda: master.read(0x6041)))
    assert seen.startswith("Code 0x08000022")
    assert acts == {"rule 1": 1}


def test_an_answer_that_is_missing_is_a_timeout():
    rules = '[[rule]]\non = { message = "sdo_answer" }\ndo = "withhold"\ntimes = 1\n'
    seen, _, _ = observed(rules, lambda master: (error_of(lambda: master.read(0x6041)), error_of(lambda: master.read(0x6041))))
    assert "No SDO response received" in seen[0]
    assert seen[1] == ""


def test_a_bit_of_the_statusword_flickers():
    rules = '[[rule]]\ndo = "show"\nobject = "6041"\nflip_bits = 0x200\nperiod_ms = 10\n'

    def both(master):
        words = set()
        for _ in range(40):
            words.add(master.read(0x6041) & 0x200)
            master.network.bus.recv(0.001)
        return words

    assert observed(rules, both)[0] == {0, 0x200}


def test_two_runs_are_equal_to_the_nanosecond():
    rules = 'seed = 5\n[[rule]]\non = { message = "sdo_answer" }\ndo = "delay"\nms = 1\njitter_ms = 30\nchance = 0.5\n'

    def reads(master):
        return [error_of(lambda: master.read(0x6041)) for _ in range(30)]

    assert observed(rules, reads) == observed(rules, reads)


def test_the_library_runs_in_virtual_time():
    with servodrome.Line.from_file(LINE) as line, line.virtual_time():
        with line.scenario(LIBRARY / "sdo-answer-missing-once.toml") as scenario, Master(line) as master:
            assert "SDO" in error_of(lambda: [master.read(0x6041) for _ in range(40)])
            assert sum(rule.acts for rule in scenario.rules.values()) == 1
        assert scenario.title


def test_expectations_judge_the_shaft():
    text = '[[expect]]\nname = "rests"\nalways = { at_rest = true }\n[[expect]]\nname = "stopped"\nwhen = { state = "fault" }\nalways = { at_rest = true }\n'
    with servodrome.Line.from_file(LINE) as line:
        scenario = line.scenario(text='title = "t"\n' + text)
        axis = line.axes["x"]
        axis.enable()
        axis.move(by=1, velocity=5, units="revolutions")
        scenario.end()
        assert [verdict.outcome for verdict in scenario.verdicts] == [Outcome.FAILED, Outcome.NOT_REACHED]
        assert "rpm" in scenario.failed[0].found


def test_rules_join_and_leave_by_hand():
    rule = '[[rule]]\nname = "a/b"\non = { message = "sdo_answer" }\ndo = "abort"\ncode = 0x08000022\n'
    with servodrome.Line.from_file(LINE) as line, line.virtual_time():
        with line.scenario(text='title = "t"\n') as scenario, Master(line) as master:
            assert master.read(0x1000) == 0x20192
            scenario.add_rules(rule)
            with pytest.raises(servodrome.BadValue, match="a rule of this name"):
                scenario.add_rules(rule)
            assert error_of(lambda: master.read(0x1000)).startswith("Code 0x08000022")
            assert scenario.rules["a/b"].acts == 1
            scenario.remove_rule("a/b")
            with pytest.raises(servodrome.UnknownName):
                scenario.remove_rule("a/b")
            assert master.read(0x1000) == 0x20192 and scenario.rules == {}


def test_errors_have_line_and_column():
    with servodrome.Line.from_file(LINE) as line:
        with pytest.raises(servodrome.BadValue, match=r"scenario:3:6: .*there is no action \"widhold\""):
            line.scenario(text='title = "t"\n[[rule]]\ndo = "widhold"\n')
        with pytest.raises(servodrome.BadValue, match="no object 5FFFh"):
            line.scenario(text='title = "t"\n[[rule]]\ndo = "show"\nobject = "5FFF"\nvalue = 1\n')


def test_a_scenario_that_does_not_fit_leaves_the_present_one():
    with servodrome.Line.from_file(LINE) as line:
        scenario = line.scenario(text='title = "first"\n[[rule]]\ndo = "show"\nobject = "6041"\nvalue = 0\n')
        with pytest.raises(servodrome.BadValue):
            line.scenario(text='title = "second"\n[[rule]]\naxis = "nobody"\ndo = "power"\n')
        line.advance(0.1)
        assert scenario.title == "first"
        assert scenario.rules["rule 1"].acts == 1
