"""The Ethernet interface of a segment: missing, not permitted, down or removed at run time, and back again."""

import multiprocessing
import os
import subprocess
import time

import pytest
from frames import BRD, RawLink, content, datagram
from line import PROGRAM, wait_for
from master import OP, Master
from segment import segment


def ip(*arguments):
    subprocess.run(["ip", "link", *arguments], check=True)


@pytest.fixture
def spare():
    """A cable that a test may damage."""
    ends = ("spare-m", "spare-s")
    make(ends)
    yield ends
    subprocess.run(["ip", "link", "del", ends[0]], check=False, capture_output=True)


def make(ends):
    ip("add", ends[0], "type", "veth", "peer", "name", ends[1])
    for end in ends:
        ip("set", end, "addrgenmode", "none", "up")


@pytest.fixture
def line(cables, start_line, spare):
    return start_line(segment(2), link=f"raw:{spare[1]}")


def refused(tmp_path, link, prefix=()):
    file = tmp_path / "line.toml"
    file.write_text(segment(1))
    command = [*prefix, PROGRAM, "up", file, "--api", "127.0.0.1:0", "--bus", f"ecat={link}"]
    result = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert result.returncode not in (0, -6, -11), result
    return result.stderr


def test_no_such_interface(cables, tmp_path):
    said = refused(tmp_path, "raw:nosuch0")
    assert "nosuch0" in said and "interface" in said


def test_no_permission(cables, tmp_path):
    """Without the capability (which root can also drop) the program cannot open raw sockets."""
    said = refused(tmp_path, f"raw:{cables[0][1]}", prefix=["setpriv", "--bounding-set=-net_raw", "--inh-caps=-net_raw"])
    assert "permi" in said.lower(), said
    assert "sudo" in said or "CAP_NET_RAW" in said, said


def test_interface_down(cables, spare, tmp_path):
    ip("set", spare[1], "down")
    said = refused(tmp_path, f"raw:{spare[1]}")
    assert spare[1] in said and "down" in said, said


def master_reaches_operational(spare):
    master = Master(spare[0])
    try:
        assert master.scan() == 2
        master.run()
        assert master.states() == [(OP, 0)] * 2
    finally:
        master.close()


def test_down_and_up_at_run_time(line, spare):
    master_reaches_operational(spare)
    ip("set", spare[1], "down")
    wait_for(lambda: f'"{spare[1]}" is lost' in line.said(), line.said)
    assert line.process.poll() is None
    ip("set", spare[1], "up")
    wait_for(lambda: f'"{spare[1]}" is back' in line.said(), line.said)
    master_reaches_operational(spare)


def test_gone_and_made_anew_at_run_time(line, spare):
    ip("del", spare[0])
    wait_for(lambda: f'"{spare[1]}" is lost' in line.said(), line.said)
    assert line.process.poll() is None
    make(spare)
    wait_for(lambda: f'"{spare[1]}" is back' in line.said(), line.said)
    master_reaches_operational(spare)


def send_bursts(interface, sent, over):
    """Sends twenty frames, each when the previous one is back; then pauses; then sends one each half millisecond."""
    link = RawLink(interface)
    link.socket.settimeout(None)
    link.send(content(datagram(BRD, (0, 0x0130), bytes(2))))
    frame = link.SOURCE.join((b"\xff" * 6, b"\x88\xa4" + link.receive()))
    while not over.is_set():
        next_burst = time.monotonic() + 0.0005
        for _ in range(20):
            link.socket.send(frame)
            link.socket.recv(2048)
        sent.value += 1
        time.sleep(max(0, next_burst - time.monotonic()))


def test_the_api_has_its_turn_beside_bursts_of_frames(line, spare):
    """A master with a fast cycle and many frames per cycle: the line must work both in busy polling and in sleep."""
    requests = 200
    sent, over = multiprocessing.Value("L", 0), multiprocessing.Event()
    master = multiprocessing.Process(target=send_bursts, args=(spare[0], sent, over), daemon=True)
    master.start()
    try:
        # Runs on one processor, so that the result does not depend on the wake-up time of another one.
        processor = {max(os.sched_getaffinity(0))}
        os.sched_setaffinity(line.process.pid, processor)
        os.sched_setaffinity(master.pid, processor)
        wait_for(lambda: sent.value > 100, lambda: f"{sent.value} bursts")
        before = sent.value
        for _ in range(requests):
            assert line.bench.get("clock")["mode"] == "real"
        assert sent.value - before < 10 * requests
    finally:
        over.set()
        master.join(10)
    assert master.exitcode == 0
