"""Misbehaviours of an EtherCAT segment: raw frames and their answers, decoded by tshark, in virtual time."""

import struct
import subprocess
from typing import Any, Callable, NamedTuple

import pytest
import servodrome
from conftest import ROOT
from misbehaviours import observed
from servodrome.ethercat import EthercatPort
from test_ethercat_port import BRD, BWR, FPRD, FPWR, HEADER, STATION, ask, set_state, to_preop, write

LINE = ROOT / "scenarios/lines/ecat.toml"
LRD, LWR = 10, 11
OUTPUTS, INPUTS, SIZE = 0x1200, 0x1500, 14  # of the sync managers 2 and 3
LOGICAL_OUTPUTS, LOGICAL_INPUTS, LOGICAL_CLOCK = 0x10000, 0x20000, 0x30000
AL_CONTROL, AL_STATUS, AL_STATUS_CODE, LINK, WATCHDOG, CLOCK = 0x0120, 0x0130, 0x0134, 0x0110, 0x0440, 0x0910
INIT, PREOP, SAFEOP, OP = 1, 2, 4, 8
BEGIN_S = 1.0  # the rules begin here; before, the master configures the slave
CYCLE_NS = 1_000_000


def frame_of(command, place, data, address=0):
    """Returns a frame with one datagram; `address` is the upper half of a logical address if the command needs one."""
    body = struct.pack("<BBHHHH", command, 7, address & 0xFFFF, place & 0xFFFF, len(data), 0) + data + b"\0\0"
    return (HEADER + struct.pack("<H", len(body) | 0x1000) + body).ljust(60, b"\0")


def logical(command, place, data):
    body = struct.pack("<BBIHH", command, 7, place, len(data), 0) + data + b"\0\0"
    return (HEADER + struct.pack("<H", len(body) | 0x1000) + body).ljust(60, b"\0")


class Client:
    """A master that composes frames. `back` has the frames that came back since begin(), and their line time in s."""

    def __init__(self, line):
        self.line = line
        self.port = EthercatPort(line)
        self.back = []
        self.outputs = bytes(SIZE)
        self.mails = 0
        line.advance(0.3)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.port.close()

    def exchange(self, frame, timeout=0.1):
        """Like EthercatPort.exchange, which test_ethercat_port uses."""
        answer = self.port.exchange(frame, timeout)
        self.back.append((self.line.now, answer))
        return answer

    def collect(self, *frames, seconds=0.02):
        """Sends the frames immediately, and receives the frames that come back in this time."""
        for frame in frames:
            self.port.send(frame)
        end = self.line.now + seconds
        while (left := end - self.line.now) > 0:
            if answer := self.port.receive(left):
                self.back.append((self.line.now, answer))

    def begin(self, cycles=False):
        """Waits until the rules have begun, in Operational with process data."""
        assert self.line.now < BEGIN_S
        while cycles and self.line.now < BEGIN_S - 0.002:
            self.cycle()
        self.line.advance(BEGIN_S + 0.001 - self.line.now)
        self.back.clear()

    def cycle(self, times=1):
        for _ in range(times):
            self.collect(logical(LWR, LOGICAL_OUTPUTS, self.outputs), logical(LRD, LOGICAL_INPUTS, bytes(SIZE)), seconds=0.001)

    def map(self, number, place, size, physical, kind):
        setting = struct.pack("<IHBBHBBBBH", place, size, 0, 7, physical, 0, kind, 1, 0, 0)
        write(self, STATION, 0x0600 + 16 * number, setting)

    def to_state(self, state):
        """Brings the slave from Init to the exchange of outputs and inputs; start_sync0() has configured SYNC0."""
        self.mailboxes = to_preop(self, self.line)
        if state == PREOP:
            return
        for number, start, control in ((2, OUTPUTS, 0x64), (3, INPUTS, 0x20)):
            write(self, STATION, 0x0800 + 8 * number, struct.pack("<HHBBBB", start, SIZE, control, 0, 1, 0))
        self.map(0, LOGICAL_OUTPUTS, SIZE, OUTPUTS, 2)
        self.map(1, LOGICAL_INPUTS, SIZE, INPUTS, 1)
        set_state(self, self.line, SAFEOP)
        if state == OP:
            self.request(OP)

    def request(self, state):
        """Requests the state, with process data for 50 ms, and reads the slave's answer."""
        write(self, STATION, AL_CONTROL, struct.pack("<H", state))
        self.cycle(50)
        self.back.clear()
        self.register(AL_STATUS)
        self.register(AL_STATUS_CODE)

    def start_sync0(self):
        """Every millisecond, beginning in 20 ms."""
        self.mailboxes = to_preop(self, self.line)
        write(self, STATION, 0x09A0, struct.pack("<I", CYCLE_NS))
        now = struct.unpack("<Q", ask(self, FPRD, STATION, CLOCK, bytes(8))[0])[0]
        write(self, STATION, 0x0990, struct.pack("<Q", (now // CYCLE_NS + 20) * CYCLE_NS + CYCLE_NS // 2))
        write(self, STATION, 0x0981, b"\x03")

    def register(self, place, size=2):
        return ask(self, FPRD, STATION, place, bytes(size))[0]

    def mail(self, content, answers=1):
        """Sends a CoE mail, and reads the mailbox this number of times, 10 ms later."""
        out, out_size, back, back_size = self.mailboxes
        self.mails += 1
        mail = struct.pack("<HHBB", len(content), 0, 0, self.mails << 4 | 3) + content
        write(self, STATION, out, mail.ljust(out_size, b"\0"))
        self.line.advance(0.01)
        self.back.clear()
        for _ in range(answers):
            self.collect(frame_of(FPRD, back, bytes(back_size), STATION), seconds=0.005)

    def upload(self, index, sub=0, answers=1):
        self.mail(struct.pack("<HBHBI", 2 << 12, 0x40, index, sub, 0), answers)

    def download(self, index, value, size):
        self.mail(struct.pack("<HBHBI", 2 << 12, 0x23 | (4 - size) << 2, index, 0, value))


# ---- What the master does ----


def asks(client):
    """Reads AL status."""
    client.begin()
    client.collect(frame_of(BRD, AL_STATUS, b"\0\0"))


def asks_twice(client):
    """Reads AL status, and after it AL status code."""
    client.begin()
    client.collect(frame_of(BRD, AL_STATUS, b"\0\0"), frame_of(BRD, AL_STATUS_CODE, b"\0\0"))


def writes_and_asks(client):
    """Writes the station address, and reads it."""
    client.begin()
    client.collect(frame_of(BWR, 0x0010, b"\x34\x12"))
    client.collect(frame_of(BRD, 0x0010, b"\0\0"))


def uploads(index, answers=1):
    def look(client):
        to_preop_before(client)
        client.upload(index, answers=answers)

    return look


def to_preop_before(client):
    client.to_state(PREOP)
    client.begin()


def downloads(client):
    to_preop_before(client)
    client.download(0x6060, 3, 1)
    client.upload(0x6060)


def operates(client):
    client.to_state(OP)
    client.begin(cycles=True)
    client.cycle()


def asks_for(state):
    """Requests the state from the previous one, and reads AL status and its code."""

    def look(client):
        before = {PREOP: INIT, SAFEOP: PREOP, OP: SAFEOP, INIT: PREOP}[state]
        if before != INIT:
            client.to_state(before)
        else:
            ask(client, 2, 0, 0x0010, struct.pack("<H", STATION))
            write(client, STATION, 0x0800, struct.pack("<HHBBBBHHBBBB", 0x1000, 256, 0x26, 0, 1, 0, 0x1100, 256, 0x22, 0, 1, 0))
        client.begin()
        if state == SAFEOP:
            client.map(0, LOGICAL_OUTPUTS, SIZE, OUTPUTS, 2)
            for number, start, control in ((2, OUTPUTS, 0x64), (3, INPUTS, 0x20)):
                write(client, STATION, 0x0800 + 8 * number, struct.pack("<HHBBBB", start, SIZE, control, 0, 1, 0))
        client.request(state)

    return look


def goes_on(client):
    """Stays in Operational, and reads AL status and its code."""
    client.to_state(OP)
    client.begin(cycles=True)
    client.cycle(20)
    client.back.clear()
    client.register(AL_STATUS)
    client.register(AL_STATUS_CODE)


def goes_on_with_sync0(client):
    client.start_sync0()
    client.to_state(OP)
    client.cycle(500)
    while client.line.now < BEGIN_S + 0.1:
        client.cycle()
    client.back.clear()
    client.register(AL_STATUS)
    client.register(AL_STATUS_CODE)


def commands_with_sync0(client):
    """Writes the controlword 6, and reads the inputs every 100 us: they change with the SYNC0 pulse."""
    client.start_sync0()
    client.to_state(OP)
    while client.line.now < BEGIN_S + 0.1:
        client.cycle()
    client.back.clear()
    client.collect(logical(LWR, LOGICAL_OUTPUTS, b"\x06" + bytes(SIZE - 1)), seconds=0.0001)
    client.back.clear()
    for _ in range(40):
        client.collect(logical(LRD, LOGICAL_INPUTS, bytes(SIZE)), seconds=0.0001)


def stops_its_frames(client):
    """In Operational without process data for 300 ms: the watchdog has 100 ms."""
    client.to_state(OP)
    client.begin(cycles=True)
    client.line.advance(0.3)
    client.register(AL_STATUS)
    client.register(WATCHDOG)


def reads_the_clock(client):
    """At three times, 10 ms apart."""
    client.to_state(PREOP)
    client.line.advance(BEGIN_S - 0.005 - client.line.now)
    client.back.clear()
    for _ in range(3):
        client.register(CLOCK, 8)
        client.line.advance(0.01)


def reads_moving_inputs(client):
    """Runs ten cycles; the true position changes, because the brake is open and a load turns the shaft."""
    client.line.axes["x"].plant.load_torque_nm = 3
    client.to_state(OP)
    client.begin(cycles=True)
    client.cycle(10)


def reads_sii(client):
    """Words 8 and 9, the vendor, of the slave information."""
    to_preop_before(client)
    write(client, STATION, 0x0502, struct.pack("<HI", 0x0100, 8))
    client.line.advance(0.01)
    client.back.clear()
    client.register(0x0508, 4)


# ---- The cases ----


class Case(NamedTuple):
    rules: str
    look: Callable[[Client], None]
    fields: str
    """Of tshark, for each frame that comes back."""
    seen: Any
    """The rows, or what `judge` makes of them."""
    judge: Callable[[Any], Any] = list


def milliseconds(rows):
    """Converts times in s to times since the request."""
    return [round((float(row[0]) - BEGIN_S) * 1000 - 1) for row in rows]


def clock_steps(rows):
    """Returns the time between two readings of a clock in us, rounded to 10 us."""
    times = [int(row[0], 16) for row in rows]
    return [round((second - first) / 1e4) * 10 for first, second in zip(times, times[1:])]


def first_answer(rows):
    """Returns the number of the first inputs with the state Ready to switch on."""
    return [int(row[0][:2], 16) & 0x6F for row in rows].index(0x21)


def different(rows):
    """Returns whether the inputs change from cycle to cycle."""
    return len(set(rows)) > 2


WHEN = "when = { time_ms = 1000 }\n"
FRAME = WHEN + 'bus = "ecat"\non = { message = "frame" }\n'
STATE = "ecat.reg.alstatus.status ecat.reg.alstatus.err ecat.reg.alstatuscode"
ADDRESS = "ecat.reg.physaddr ecat.cnt"
MAIL = "ecat.cnt ecat_mailbox.coe.type ecat_mailbox.coe.sdoidx ecat_mailbox.coe.abortcode"


def state(number, code, error=1):
    """AL status, and AL status code."""
    return [(f"0x{number:04x}", str(error), ""), ("", "", f"0x{code:04x}")]


CASES = {
    "withhold": Case(f'{FRAME}do = "withhold"\ntimes = 1', writes_and_asks, ADDRESS, [("0x0000", "1")]),
    "withhold_answer": Case(f'{FRAME}do = "withhold_answer"\ntimes = 1', writes_and_asks, ADDRESS, [("0x1234", "1")]),
    "twice": Case(f'{FRAME}do = "twice"', asks, "ecat.cnt", [("2",)]),
    "working_counter": Case(f'{FRAME}do = "working_counter"\nadd = 3', asks, "ecat.cnt", [("4",)]),
    "working_counter of one slave": Case(
        f'{WHEN}axis = "x"\non = {{ message = "frame" }}\ndo = "working_counter"\nadd = -1', asks, "ecat.cnt", [("0",)]
    ),
    "delay": Case(f'{FRAME}do = "delay"\nms = 5', asks, "frame.time_epoch", [5], milliseconds),
    "delay by frames": Case(f'{FRAME}do = "delay"\nframes = 1\ntimes = 1', asks_twice, "ecat.ado", [("0x0134",), ("0x0130",)]),
    "repeat": Case(f'{FRAME}do = "repeat"\ncopies = 2', asks, "ecat.cmd", [("0x07",)] * 3),
    "alter": Case(f'{FRAME}do = "alter"\nbyte = 12\nset = 8', asks, "ecat.reg.alstatus.status", [("0x0008",)]),
    "replace": Case(
        f'{FRAME}do = "replace"\ndata = "0E 10 07 07 00 00 30 01 02 00 00 00 02 00 05 00"',
        asks,
        "ecat.reg.alstatus.status ecat.cnt",
        [("0x0002", "5")],
    ),
    "truncate": Case(f'{FRAME}do = "truncate"\nlength = 13', asks, "frame.len ecat.cmd", [("27", "")]),
    "extend": Case(f'{FRAME}do = "extend"\ndata = "AA BB"', asks, "frame.len", [("62",)]),
    "stale": Case(
        f'{WHEN}bus = "ecat"\non = {{ message = "cycle", command = "LRD" }}\ndo = "stale"',
        reads_moving_inputs, "ecat.data", False, different,
    ),
    "stale_inputs": Case(f'{WHEN}do = "stale_inputs"', reads_moving_inputs, "ecat.data", False, different),
    "show": Case(f'{WHEN}do = "show"\nobject = "6041"\nvalue = 0x1234', operates, "ecat.data", ["3412"], lambda rows: [rows[1][0][:4]]),
    "ignore": Case(f'{WHEN}do = "ignore"\nobject = "6060"', downloads, "ecat_mailbox.coe.sdoidx ecat_mailbox.coe.sdodata", [("0x6060", "0x00")]),
    "abort": Case(
        f'{WHEN}on = {{ message = "sdo_answer", object = "6060" }}\ndo = "abort"\ncode = 0x08000022',
        uploads(0x6060), MAIL, [("1", "2", "", "0x08000022")],
    ),
    "withhold of a mailbox": Case(
        f'{WHEN}on = {{ message = "mailbox_answer" }}\ndo = "withhold"', uploads(0x6060), MAIL, [("0", "", "", "")]
    ),
    "withhold of a request": Case(
        f'{WHEN}on = {{ message = "mailbox_request" }}\ndo = "withhold"', uploads(0x6060), MAIL, [("0", "", "", "")]
    ),
    "delay of a mailbox": Case(
        f'{WHEN}on = {{ message = "sdo_answer" }}\ndo = "delay"\nms = 12', uploads(0x6060, 2), "ecat.cnt", [("0",), ("1",)]
    ),
    "emergency": Case(
        f'{WHEN}on = {{ message = "sdo_answer" }}\ndo = "emergency"\ncode = 0x8110\nregister = 0x11',
        uploads(0x6060, 2), "ecat_mailbox.coe.type", [("1",), ("3",)],
    ),
    "cable": Case(f'{WHEN}do = "cable"\nconnected = false', asks, "ecat.cnt", []),
    "power": Case(f'{WHEN}do = "power"\non = false', asks, "ecat.cnt", []),
    "al_refuse init": Case(f'{WHEN}do = "al_refuse"\nto = "init"\ncode = 0x0061', asks_for(INIT), STATE, state(PREOP, 0x0061)),
    "al_refuse pre_operational": Case(
        f'{WHEN}do = "al_refuse"\nto = "pre_operational"\ncode = 0x0016', asks_for(PREOP), STATE, state(INIT, 0x0016)
    ),
    "al_refuse safe_operational": Case(
        f'{WHEN}do = "al_refuse"\nto = "safe_operational"\ncode = 0x001E', asks_for(SAFEOP), STATE, state(PREOP, 0x001E)
    ),
    "al_refuse operational": Case(
        f'{WHEN}do = "al_refuse"\nto = "operational"\ncode = 0x001D', asks_for(OP), STATE, state(SAFEOP, 0x001D)
    ),
    "al_drop init": Case(f'{WHEN}do = "al_drop"\nto = "init"\ncode = 0x0060', goes_on, STATE, state(INIT, 0x0060)),
    "al_drop pre_operational": Case(
        f'{WHEN}do = "al_drop"\nto = "pre_operational"\ncode = 0x0016', goes_on, STATE, state(PREOP, 0x0016)
    ),
    "al_drop safe_operational": Case(
        f'{WHEN}do = "al_drop"\nto = "safe_operational"\ncode = 0x001A', goes_on, STATE, state(SAFEOP, 0x001A)
    ),
    "sii": Case(f'{WHEN}do = "sii"\nword = 8\nvalue = 0x4711', reads_sii, "ecat.reg.data0 ecat.reg.data1", [("0x4711", "0x5345")]),
    "clock jump_ns": Case(f'{WHEN}do = "clock"\njump_ns = 2000000', reads_the_clock, "ecat.reg.dc.systime", [12000, 10000], clock_steps),
    "clock ppm": Case(f'{WHEN}do = "clock"\nppm = 100000', reads_the_clock, "ecat.reg.dc.systime", [10500, 11000], clock_steps),
    "clock stop": Case(f'{WHEN}do = "clock"\nstop = true', reads_the_clock, "ecat.reg.dc.systime", [5000, 0], clock_steps),
    "sync0 missing": Case(f'{WHEN}do = "sync0"\nhow = "missing"', goes_on_with_sync0, STATE, state(SAFEOP, 0x002C)),
    "sync0 twice": Case(f'{WHEN}do = "sync0"\nhow = "twice"', goes_on_with_sync0, STATE, state(SAFEOP, 0x001A)),
    "sync0 late": Case(f'{WHEN}do = "sync0"\nhow = "late"\nlate_us = 300', commands_with_sync0, "ecat.data", 7, first_answer),
    "watchdog": Case(
        f'{WHEN}do = "watchdog"\non = false', stops_its_frames, "ecat.reg.alstatus.status ecat.reg.wd.status", [("0x0008", ""), ("", "0x01")]
    ),
}


def text_of_tshark(folder, fields, frames):
    """A row of fields for each frame, as tshark prints it."""
    file = folder / "frames.pcap"
    file.write_bytes(
        struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, 1)
        + b"".join(
            struct.pack("<IIII", int(at), round(at % 1 * 1e6), len(frame), len(frame)) + frame for at, frame in frames
        )
    )
    options = [word for field in fields for word in ("-e", field)]
    command = ["tshark", "-r", str(file), "-T", "fields", *options]
    lines = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True).stdout.splitlines()
    return [dict(zip(fields, line.split("\t"))) for line in lines]


@pytest.fixture(scope="module")
def rows(tmp_path_factory):
    """Returns the rows of each case with and without its rules. Runs tshark once for all, because it starts slowly."""
    runs, frames = {}, []
    for name, case in CASES.items():
        for rules in (case.rules, ""):
            back = observed(LINE, Client, rules, lambda client: (case.look(client), client.back)[1])
            runs[name, bool(rules)] = len(back)
            frames += back
    fields = sorted({field for case in CASES.values() for field in case.fields.split()})
    decoded = iter(text_of_tshark(tmp_path_factory.mktemp("tshark"), fields, frames))

    def row(name):
        words = next(decoded)
        return tuple(words[field] for field in CASES[name].fields.split())

    return {run: [row(run[0]) for _ in range(count)] for run, count in runs.items()}


@pytest.mark.parametrize("name", CASES)
def test_tshark_sees(rows, name):
    case = CASES[name]
    assert case.judge(rows[name, True]) == case.seen
    assert case.judge(rows[name, False]) != case.seen
