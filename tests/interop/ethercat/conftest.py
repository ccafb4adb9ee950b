"""Fixtures: a segment of drives at one end of an Ethernet cable, and pysoem's master at the other end.

The cables are pairs of virtual Ethernet interfaces in a network namespace. Each worker (pytest -n) makes its own, so
that tests can run in parallel. This needs root, or `unshare --user --map-root-user --net` around pytest. Environment:
SERVODROME, SERVODROME_CAPTURES and SERVODROME_PATIENCE as for the tests on CAN.
"""

import csv
import ctypes
import io
import os
import re
import subprocess


import pytest
from drive import Drive
from line import Line, servodrome
from master import Master
from segment import segment

CLONE_NEWNET = 0x40000000


@pytest.fixture(scope="session")
def cables():
    """Two cables: the interfaces at the master and at the segment."""
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.unshare(CLONE_NEWNET) != 0:
        pytest.fail(f"no network namespace: {os.strerror(ctypes.get_errno())}; run as root, or with unshare -Urn")
    subprocess.run(["ip", "link", "set", "lo", "up"], check=True)
    ends = [("master0", "servo0"), ("master1", "servo1")]
    for near, far in ends:
        subprocess.run(["ip", "link", "add", near, "type", "veth", "peer", "name", far], check=True)
        for end in (near, far):
            # Prevents the system from sending its own frames on the cable.
            subprocess.run(["ip", "link", "set", end, "addrgenmode", "none", "arp", "off", "up"], check=True)
    return ends


@pytest.fixture
def start_line(request, tmp_path, cables):
    """start_line(TOML): starts a line whose bus ecat is on the first cable, and ends it properly after the test."""
    lines = []

    def start(text, link=None, **options):
        folder = tmp_path / f"line{len(lines)}"
        folder.mkdir()
        captures = os.environ.get("SERVODROME_CAPTURES")
        if captures and "log" not in options:
            name = re.sub(r"[^A-Za-z0-9_]+", "-", f"ethercat-{request.node.nodeid.rpartition('/')[2]}-{len(lines)}")
            options["log"] = f"{captures}/{name}.pcap"
        line = Line(folder, text, [f"ecat={link or 'raw:' + cables[0][1]}"], **options)
        lines.append(line)
        return line

    yield start
    for line in lines:
        line.stop()


@pytest.fixture
def open_master(cables):
    """open_master(): opens pysoem on the first cable; open_master(ring=True): on both cables."""
    masters = []

    def open_one(ring=False):
        master = Master(cables[0][0], cables[1][0] if ring else None)
        masters.append(master)
        return master

    yield open_one
    for master in reversed(masters):
        master.close()


@pytest.fixture
def line(start_line):
    return start_line(segment(2))


@pytest.fixture
def bench(line):
    return line.bench


@pytest.fixture
def master(line, open_master):
    """pysoem, with both drives found and in Pre-Operational."""
    opened = open_master()
    assert opened.scan() == 2
    return opened


@pytest.fixture
def slave(master):
    return master.slaves[0]


@pytest.fixture(scope="session")
def objects():
    """objects(product): returns the list of `servodrome export csv` by (index, sub-index)."""
    known = {}

    def of(product):
        if product not in known:
            rows = csv.DictReader(io.StringIO(servodrome("export", "csv", product)))
            known[product] = {(int(row["index"], 16), int(row["sub"], 16)): row for row in rows}
        return known[product]

    return of


@pytest.fixture
def drives(line, master, objects):
    """The drives of a master's slaves, by their objects; objects must be mapped before they are used in process
    data."""
    return [
        Drive(master, number, line.bench, f"drive{number + 1}", objects("generic402-ec"))
        for number in range(len(master.slaves))
    ]
