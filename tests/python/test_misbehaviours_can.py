"""Misbehaviours on a CAN bus, observed by the libraries canopen and python-can, in virtual time."""

import time

import can
import canopen
import pytest
import servodrome.can_bus  # noqa: F401 (registers the interface)
from canopen.sdo.exceptions import SdoAbortedError, SdoCommunicationError
from conftest import ROOT
from misbehaviours import Case, check

LINE = ROOT / "scenarios/lines/can.toml"
TIMEOUT, ANSWER = "no answer", "43 00 10 00 92 01 02 00"  # of 1000h
UPLOAD = bytes.fromhex("40 00 10 00 00 00 00 00")
FAULT = 0x08


class Client:
    """Node 1 as a program with canopen sees it, and another port with python-can that receives all frames."""

    def __init__(self, line):
        self.network = canopen.Network()
        self.network.connect(interface="servodrome", channel="can0", line=line)
        self.node = self.network.add_node(1, canopen.ObjectDictionary())
        self.node.sdo.RESPONSE_TIMEOUT = 0.1
        self.bus = can.Bus(interface="servodrome", channel="can0", line=line)
        time.sleep(0.5)  # the drive boots

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.network.disconnect()
        self.bus.shutdown()

    def read(self, index, sub=0):
        """The number, or the error of canopen."""
        try:
            return int.from_bytes(self.node.sdo.upload(index, sub), "little", signed=True)
        except SdoAbortedError as error:
            return f"abort {error.code:08X}"
        except SdoCommunicationError:
            return TIMEOUT

    def write(self, index, value, size):
        self.node.sdo.download(index, 0, value.to_bytes(size, "little", signed=value < 0))

    def frames(self, seconds, identifier=None):
        """(time in s, identifier, data) of the frames that python-can receives in this time."""
        while self.bus.recv(0):
            pass
        end, found = time.monotonic() + seconds, []
        while (left := end - time.monotonic()) > 0:
            message = self.bus.recv(left)
            if message and identifier in (None, message.arbitration_id):
                found.append((message.timestamp, f"{message.arbitration_id:03X}", message.data.hex(" ").upper()))
        return found

    def answers(self, seconds=0.1):
        """Returns the identifiers and data of the frames after a request to read 1000h."""
        self.bus.send(can.Message(arbitration_id=0x601, data=UPLOAD, is_extended_id=False))
        return [frame[1:] for frame in self.frames(seconds)]


def read(index, sub=0):
    return lambda client: client.read(index, sub)


def reads(index, times, pause, sub=0):
    """Returns the values in order, without repetitions."""

    def look(client):
        seen = []
        for _ in range(times):
            value = client.read(index, sub)
            if value not in seen[-1:]:
                seen.append(value)
            time.sleep(pause)
        return seen

    return look


def written(index, value, size, shown):
    """Returns the object `shown` 10 ms after a write."""

    def look(client):
        client.write(index, value, size)
        time.sleep(0.01)
        return client.read(shown)

    return look


def durations(client):
    """Returns ten reads, in steps of 10 ms."""
    found = []
    for _ in range(10):
        begin = time.monotonic()
        client.read(0x1000)
        found.append(int((time.monotonic() - begin) * 100) * 10)
    return found


def heartbeats(client):
    """Returns the data on the bus in 100 ms, with heartbeats every 20 ms; each kind once."""
    client.write(0x1017, 20, 2)
    return sorted({data for _, _, data in client.frames(0.1, 0x701)})


def gap_before_heartbeat(client):
    """Returns the ms between a frame of two bytes and the following heartbeat."""
    client.write(0x1017, 50, 2)
    frames = client.frames(0.3, 0x701)
    return {round((second[0] - first[0]) * 1000) for first, second in zip(frames, frames[1:]) if first[2] == "AA AA"}


def emergencies(seconds):
    """Returns the codes and error registers that canopen has received."""

    def look(client):
        time.sleep(seconds)
        return [(error.code, error.register) for error in client.node.emcy.log if error.code]

    return look


def fault_of(client):
    """Returns the error code of 603Fh if the drive is in Fault; 0 if not."""
    time.sleep(0.1)
    return client.read(0x603F) & 0xFFFF if client.read(0x6041) & FAULT else 0


def drift(client):
    """Returns the difference of two reads with 1 s between them."""
    first = client.read(0x6064)
    time.sleep(1)
    return round((client.read(0x6064) - first) / 1000)


def held(client):
    """Returns 6081h immediately and 100 ms after a write."""
    client.write(0x6081, 4711, 4)
    first = client.read(0x6081) == 4711
    time.sleep(0.1)
    return first, client.read(0x6081) == 4711


def late(client):
    """Returns whether 6061h follows immediately, and whether it does after 100 ms."""
    client.write(0x6060, 3, 1)
    first = client.read(0x6061)
    time.sleep(0.1)
    return first, client.read(0x6061)


PROCESS_DATA = ["181", "281", "381", "481"]


def process_data(client):
    """Returns the identifiers of the TPDOs after SYNC. All four are synchronous."""
    for number in range(4):
        client.node.sdo.download(0x1800 + number, 1, (0x80000181 + 0x100 * number).to_bytes(4, "little"))
        client.node.sdo.download(0x1800 + number, 2, bytes([1]))
        client.node.sdo.download(0x1800 + number, 1, (0x181 + 0x100 * number).to_bytes(4, "little"))
    client.node.nmt.state = "OPERATIONAL"
    client.frames(0.05)
    client.network.sync.transmit()
    return sorted(identifier for _, identifier, _ in client.frames(0.05) if identifier in PROCESS_DATA)


def commanded(client):
    """Returns which of the four RPDOs the drive obeys; each of them begins with the controlword."""
    client.node.nmt.state = "OPERATIONAL"
    obeyed = []
    for number, size in enumerate((2, 3, 6, 6)):
        client.write(0x6040, 0, 2)
        data = bytes([6, 0]) + bytes(size - 2)
        client.bus.send(can.Message(arbitration_id=0x201 + 0x100 * number, data=data, is_extended_id=False))
        time.sleep(0.02)
        if client.read(0x6041) & 0x6F == 0x21:
            obeyed.append(number + 1)
    return obeyed


def boots(client):
    """Returns the heartbeats and boot-up messages of node 1 after a reset."""
    client.network.nmt.send_command(0x81)
    return [frame[1:] for frame in client.frames(0.5, 0x701)]


def starts(client):
    """Returns the state in the heartbeats after Start: 05h is Operational, 7Fh Pre-operational."""
    client.write(0x1017, 20, 2)
    client.node.nmt.state = "OPERATIONAL"
    return client.frames(0.1, 0x701)[-1][2]


def finds_by_lss(client):
    """Returns the node that answers the LSS request for its node-ID, with all nodes in the state LSS configuration."""
    client.network.lss.RESPONSE_TIMEOUT = 0.1
    client.network.lss.send_switch_state_global(client.network.lss.CONFIGURATION_STATE)
    try:
        return client.network.lss.inquire_node_id()
    except canopen.lss.LssError:
        return TIMEOUT


def sends_time(client):
    client.bus.send(can.Message(arbitration_id=0x100, data=bytes(6), is_extended_id=False))
    return [frame[1:] for frame in client.frames(0.05)]


def hears(client):
    """Returns whether the drive obeys Start, and whether the master receives its heartbeat of 20 ms."""
    client.write(0x1017, 20, 2)
    client.node.nmt.state = "OPERATIONAL"
    time.sleep(0.1)
    return sorted({data for _, _, data in client.frames(0.1, 0x701)}), client.read(0x1000)


def withheld(message, look, seen, begin=""):
    """Returns what is missing if these messages are lost."""
    return Case(f'{begin}on = {{ message = "{message}" }}\ndo = "withhold"', look, seen)


ON_ANSWER = 'on = { message = "sdo_answer", object = "1000" }\n'
ON_HEARTBEAT = 'on = { message = "heartbeat" }\n'
BOOTED = "when = { time_ms = 400 }\n"


def altered(keys, seen):
    """A change of a message, and the same change of a copy."""
    first = Case(f'{ON_ANSWER}do = "alter"\n{keys}', Client.answers, [("581", seen)])
    copy = Case(f'{ON_ANSWER}do = "repeat"\n{keys}', Client.answers, [("581", ANSWER), ("581", seen)])
    return first, copy


ALTERED = {
    "set": altered("byte = 4\nset = 0x55", "43 00 10 00 55 01 02 00"),
    "xor": altered("byte = -2\nxor = 0xFF", "43 00 10 00 92 01 FD 00"),
    "add": altered("byte = 4\nadd = 1", "43 00 10 00 93 01 02 00"),
    "swap": altered("byte = 4\nswap = 5", "43 00 10 00 01 92 02 00"),
    "bytes": altered('bytes = "4F ?? ?? 01"', "4F 00 10 01 92 01 02 00"),
}

CASES = {
    "withhold": Case(f'{ON_ANSWER}do = "withhold"', read(0x1000), TIMEOUT),
    "delay": Case(f'{ON_ANSWER}do = "delay"\nms = 30', durations, [30] * 10),
    "delay with jitter": Case(
        f'{ON_ANSWER}do = "delay"\nms = 30\njitter_ms = 20', lambda client: set(durations(client)), {30, 40}
    ),
    "delay of some": Case(
        f'{ON_ANSWER}do = "delay"\nms = 30\nskip = 1\nevery = 3\ntimes = 2', durations, [0, 30, 0, 0, 30, 0, 0, 0, 0, 0]
    ),
    "delay by chance": Case(
        f'{ON_ANSWER}do = "delay"\nms = 30\nchance = 0.5', lambda client: set(durations(client)), {0, 30}
    ),
    "repeat": Case(f'{ON_ANSWER}do = "repeat"\ncopies = 2\ngap_ms = 5', Client.answers, [("581", ANSWER)] * 3),
    "replace": Case(f'{ON_ANSWER}do = "replace"\ndata = "80 00 10 00 00 00 06 06"', read(0x1000), "abort 06060000"),
    "truncate": Case(f'{ON_ANSWER}do = "truncate"\nlength = 3', Client.answers, [("581", "43 00 10")]),
    "extend": Case(f'{ON_HEARTBEAT}do = "extend"\ndata = "AA BB"', heartbeats, ["7F AA BB"]),
    "extend before": Case(f'{ON_HEARTBEAT}do = "extend"\ndata = "AA"\nbefore = true', heartbeats, ["AA 7F"]),
    "extend with a gap": Case(
        f'{ON_HEARTBEAT}do = "extend"\ndata = "AA AA"\nbefore = true\ngap_ms = 7', gap_before_heartbeat, {7}
    ),
    "abort": Case(f'{ON_ANSWER}do = "abort"\ncode = 0x08000022', read(0x1000), "abort 08000022"),
    **{f"alter {key}": pair[0] for key, pair in ALTERED.items()},
    **{f"repeat with {key}": pair[1] for key, pair in ALTERED.items()},
    "alter id": Case(f'{ON_ANSWER}do = "alter"\nid = 0x582', Client.answers, [("582", ANSWER)]),
    "repeat with id": Case(
        f'{ON_ANSWER}do = "repeat"\nid = 0x582', Client.answers, [("581", ANSWER), ("582", ANSWER)]
    ),
    "send": Case(
        f'{BOOTED}bus = "can0"\ndo = "send"\nid = 0x123\ndata = "01 02"\nperiod_ms = 20\ntimes = 40',
        lambda client: [frame[1:] for frame in client.frames(0.1)],
        [("123", "01 02")] * 5,
    ),
    "babble": Case(
        f'{BOOTED}bus = "can0"\ndo = "babble"\nid = 0x005\nfor_ms = 200',
        lambda client: len(client.frames(0.05, 0x005)) > 300,
        True,
    ),
    "cable": Case(
        f'{BOOTED}do = "cable"\nconnected = false\nfor_ms = 150', reads(0x1000, 3, 0), [TIMEOUT, 0x20192]
    ),
    "error_state passive": Case(
        f'{BOOTED}do = "error_state"\nstate = "passive"', emergencies(0.1), [(0x8120, 0x11)]
    ),
    "error_state bus_off": Case(f'{BOOTED}do = "error_state"\nstate = "bus_off"\nfor_ms = 20', emergencies(0.1), [(0x8140, 0x11)]),
    "error_state active": Case(
        f'{BOOTED}name = "first"\ndo = "error_state"\nstate = "passive"\n'
        '[[rule]]\nwhen = { after = "first", after_ms = 200 }\ndo = "error_state"\nstate = "active"',
        lambda client: (time.sleep(0.3), [error.code for error in client.node.emcy.log])[1],
        [0x8120, 0],
    ),
    "show value": Case('axis = "x"\ndo = "show"\nobject = "6502"\nvalue = 5', read(0x6502), 5),
    "show value with mask": Case('do = "show"\nobject = "1000"\nvalue = 0\nmask = 0xFF', read(0x1000), 0x20100),
    "show freeze": Case(f'{BOOTED}do = "show"\nobject = "6061"\nfreeze = true', written(0x6060, 3, 1, 0x6061), 0),
    "show set_bits": Case('do = "show"\nobject = "6041"\nset_bits = 0x8000', lambda client: client.read(0x6041) & 0x8000, 0x8000),
    "show clear_bits": Case('do = "show"\nobject = "1000"\nclear_bits = 0x20000', read(0x1000), 0x00192),
    "show flip_bits": Case('do = "show"\nobject = "1000"\nflip_bits = 1\nperiod_ms = 100', lambda client: set(reads(0x1000, 20, 0.01)(client)), {0x20192, 0x20193}),
    "show add": Case('do = "show"\nobject = "1000"\nadd = 8', read(0x1000), 0x2019A),
    "show negate": Case('do = "show"\nobject = "6064"\nnegate = true', lambda client: client.read(0x6064) < 0, True),
    "show late": Case('do = "show"\nobject = "6061"\nlate_ms = 50', late, (0, 3)),
    "show drift": Case('do = "show"\nobject = "6064"\ndrift_per_s = 50000', drift, 50),
    "ignore": Case('do = "ignore"\nobject = "6060"', written(0x6060, 3, 1, 0x6061), 0),
    "ignore with mask": Case('do = "ignore"\nobject = "6081"\nmask = 1', written(0x6081, 7, 4, 0x6081), 6),
    "hold": Case('do = "hold"\nobject = "6081"\nms = 50', held, (False, True)),
    "set": Case(f'{BOOTED}do = "set"\nobject = "6081"\nvalue = 4711', read(0x6081), 4711),
    "power": Case(f'{BOOTED}do = "power"\non = false', read(0x1000), TIMEOUT),
    "inject": Case(f'{BOOTED}do = "inject"\nfault = "0x7305"', fault_of, 0x7305),
    "input": Case('do = "input"\nwire = "DI0"\nlevel = true', lambda client: client.read(0x60FD) & 1, 1),
    "plant": Case(f'{BOOTED}do = "plant"\nkey = "supply_v"\nvalue = 400', lambda client: (time.sleep(1), client.read(0x6079) > 390000)[1], True),
    "emergency": Case(
        f'{BOOTED}do = "emergency"\ncode = 0x8110\nregister = 0x11\nperiod_ms = 10\ntimes = 3',
        emergencies(0.1),
        [(0x8110, 0x11)] * 3,
    ),
    "again": Case(
        'when = { object = "6060", value = 3 }\nuntil = { object = "6060", value = 0 }\nagain = true\ndo = "show"\nobject = "6061"\nvalue = 9',
        lambda client: [written(0x6060, mode, 1, 0x6061)(client) for mode in (3, 0, 3)],
        [9, 0, 9],
    ),
    "every_ms": Case(
        f'{BOOTED}every_ms = 100\nfor_ms = 50\ndo = "show"\nobject = "1000"\nvalue = 1', reads(0x1000, 40, 0.01), [1, 0x20192] * 4
    ),
}


# Each kind of message of a CAN bus.
CASES |= {
    "no sdo_request": withheld("sdo_request", read(0x1000), TIMEOUT),
    "no tpdo": withheld("tpdo", process_data, []),
    **{f"no tpdo{n + 1}": withheld(f"tpdo{n + 1}", process_data, PROCESS_DATA[:n] + PROCESS_DATA[n + 1 :]) for n in range(4)},
    "no rpdo": withheld("rpdo", commanded, []),
    **{f"no rpdo{n}": withheld(f"rpdo{n}", commanded, [m for m in (1, 2, 3, 4) if m != n]) for n in (1, 2, 3, 4)},
    "no heartbeat": withheld("heartbeat", heartbeats, []),
    "no boot_up": withheld("boot_up", boots, [], BOOTED),
    "no emergency": Case(
        f'{BOOTED}do = "inject"\nfault = "0x7305"\n[[rule]]\non = {{ message = "emergency" }}\ndo = "withhold"',
        lambda client: (emergencies(0.1)(client), fault_of(client)),
        ([], 0x7305),
    ),
    "no nmt": withheld("nmt", starts, "7F"),
    "no sync": withheld("sync", process_data, []),
    "on time": Case('on = { message = "time" }\ndo = "send"\nbus = "can0"\nid = 0x123', sends_time, [("123", "")]),
    "no lss_answer": withheld("lss_answer", finds_by_lss, TIMEOUT),
    "no lss_request": withheld("lss_request", finds_by_lss, TIMEOUT),
    "nothing from the drive": withheld("from_drive", hears, ([], TIMEOUT), "when = { nmt = \"operational\" }\n"),
    "nothing to the drive": withheld("to_drive", hears, (["05"], TIMEOUT), "when = { nmt = \"operational\" }\n"),
}


@pytest.mark.parametrize("name", CASES)
def test_canopen_and_python_can_see(name):
    check(LINE, Client, CASES[name])
