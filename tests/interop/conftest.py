"""Fixtures: a line of two drives on the link of SERVODROME_LINK, and clients of it.

Environment: SERVODROME, the built program; SERVODROME_LINK: socketcand (default), slcan, socketcan:INTERFACE, socketcan
(vcan0, vcan1 ... for the workers of pytest -n), or memory: the line is in this process (SERVODROME_LIBRARY) and the
clients use its virtual time; SERVODROME_CAPTURES: a folder that keeps the capture (pcap) of every test's bus.
"""

import os
import re
import threading
import time

import pytest
from bus import Network
from drive402 import Drive402
from line import TWO_DRIVES, Line, servodrome, stopped_at_the_end, wait_for

LINK = os.environ.get("SERVODROME_LINK", "socketcand")
KIND = LINK.partition(":")[0]
WORKER = os.environ.get("PYTEST_XDIST_WORKER", "gw0")[2:]
if LINK == "socketcan":
    LINK = f"socketcan:vcan{WORKER}"  # tests that run in parallel have separate buses


class PauseWitness(threading.Thread):
    """Measures pauses of one processor: a thread on it sleeps for 10 ms at a time and measures how late it wakes up. A
    host may pause a single processor of a virtual machine."""

    def __init__(self, processor):
        super().__init__(daemon=True)
        self.processor = processor
        self.longest_s = 0.0

    def run(self):
        os.sched_setaffinity(0, {self.processor})  # of this thread
        while True:
            begin = time.monotonic()
            time.sleep(0.01)
            self.longest_s = max(self.longest_s, time.monotonic() - begin - 0.01)


WITNESSES = [PauseWitness(processor) for processor in os.sched_getaffinity(0)]
for witness in WITNESSES:
    witness.start()


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item):
    for witness in WITNESSES:
        witness.longest_s = 0.0


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport(item, call):
    """Adds the longest pause since the start of the test to each failure; `./test` reads it from the report."""
    if call.excinfo is not None:
        item.user_properties.append(("longest_pause_ms", int(max(witness.longest_s for witness in WITNESSES) * 1000)))
    yield


LONGEST = {"test_tune", "test_foreign_modbus", "test_broken_commands", "test_trial", "test_studio_process_data"}


def pytest_collection_modifyitems(config, items):
    keep, drop = [], []
    for item in items:
        has_line = "line" in item.fixturenames or "start_line" in item.fixturenames
        if not has_line:
            item.add_marker("once")
        here = KIND != "socketcand" or not item.get_closest_marker("remote_frames")
        if marker := item.get_closest_marker("link"):
            here = here and marker.args[0] == KIND
        if KIND == "memory":
            here = here and has_line and not item.get_closest_marker("program")
        (keep if here else drop).append(item)
    # In parallel the longest tests run first, so that no process still has one when the others have ended.
    items[:] = sorted(keep, key=lambda item: item.path.stem not in LONGEST)
    config.hook.pytest_deselected(items=drop)


def bus_option(folder, bus="can0"):
    """Returns the `--bus` option of the link under test."""
    if KIND == "socketcand":
        return f"{bus}=socketcand:127.0.0.1:0/{bus}"
    if KIND == "slcan":
        return f"{bus}=slcan:{folder}/{bus}"
    return f"{bus}={LINK}"


@pytest.fixture
def lines():
    """The lines of a test; they are stopped after it."""
    with stopped_at_the_end() as lines:
        yield lines


@pytest.fixture
def start_line(request, tmp_path, lines):
    """start_line(TOML, ...): starts a line whose bus can0 is on the link under test, and ends it properly after the
    test."""

    def start(text=TWO_DRIVES, **options):
        folder = tmp_path / f"line{len(lines)}"
        folder.mkdir()
        captures = os.environ.get("SERVODROME_CAPTURES")
        if captures and "log" not in options:
            name = re.sub(r"[^A-Za-z0-9_]+", "-", f"{KIND}-{request.node.nodeid.rpartition('/')[2]}-{len(lines)}")
            options["log"] = f"{captures}/{name}.pcap"
        if KIND == "memory":
            from memory_line import MemoryLine

            line = MemoryLine(folder, text, **options)
        else:
            line = Line(folder, text, [bus_option(folder)], **options)
        lines.append(line)
        return line

    return start


@pytest.fixture
def line(start_line):
    return start_line()


@pytest.fixture
def bench(line):
    return line.bench


@pytest.fixture
def connect():
    """connect(line): connects another client to the line's bus can0."""
    networks = []

    def connect_to(line):
        network = Network(line.links["can0"][0])
        networks.append(network)
        return network

    yield connect_to
    for network in networks:
        network.disconnect()


@pytest.fixture
def network(line, connect):
    return connect(line)


@pytest.fixture(scope="session")
def eds(tmp_path_factory):
    """eds(product): returns a file with the exported EDS."""
    folder = tmp_path_factory.mktemp("eds")

    def export(product):
        file = folder / f"{product}.eds"
        if not file.exists():
            servodrome("export", "eds", product, "-o", file)
        return str(file)

    return export


@pytest.fixture
def ismc(line, network, eds):
    return Drive402(network.add_node(1, eds("ismc")), line.bench, "ismc")


@pytest.fixture
def reference(line, network, eds):
    return Drive402(network.add_node(2, eds("generic402")), line.bench, "reference")


@pytest.fixture(params=["ismc", "reference"])
def drive(request):
    """Each of the two drives in turn."""
    return request.getfixturevalue(request.param)
