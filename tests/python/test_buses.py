"""Buses: disturbances, traffic, captures."""

import math
import struct

import pytest
import servodrome


@pytest.fixture
def bus(line):
    return line.buses["can0"]


@pytest.fixture
def heartbeats(line, bus):
    """Both drives on CAN send a heartbeat each 10 ms."""
    for name in ("x", "y"):
        line.axes[name].objects["1017:00"] = 10
    line.advance(0.1)
    return bus


def test_a_bus(line, bus):
    assert (bus.name, bus.type) == ("can0", "can")
    assert bus.view()["bit_rate"] == 1_000_000
    assert list(bus.view()["axes"]) == ["x", "y"]
    assert line.buses["ecat"].type == "ethercat"
    assert repr(bus) == "<bus can0: can>"


def test_links_need_real_time(bus):
    for use in (lambda: bus.link, lambda: bus.links):
        with pytest.raises(servodrome.NotInVirtualTime, match='clock="real"'):
            use()


# ---- Traffic ----


def test_traffic(line, heartbeats):
    bus = heartbeats
    assert len(bus.traffic) == 0 and list(bus.traffic) == []
    with bus.record() as recorded:
        assert recorded is bus
        line.advance(0.1)
    line.advance(0.1)
    frames = list(bus.traffic)
    assert len(frames) == len(bus.traffic) == 20
    assert {frame.sender for frame in frames} == {"x", "y"}
    assert {frame.node for frame in frames} == {1, 2}
    assert all(100_000_000 < frame.time_ns <= 210_000_000 for frame in frames)
    assert [frame.number for frame in frames] == list(range(1, 21))
    assert frames[0].bytes.startswith("70") and "[1]" in frames[0].bytes
    assert not frames[0].error and frames[0].text and frames[0].kind
    only = bus.traffic.rows(node=2)
    assert len(only) == 10 and {frame.sender for frame in only} == {"x"}
    assert bus.traffic.rows(since=15) == frames[15:]
    assert bus.traffic.rows(kind="sdo") == bus.traffic.rows(errors=True) == bus.traffic.rows(text="no such text") == []
    bus.traffic.clear()
    assert list(bus.traffic) == []


def test_more_traffic_than_one_answer_has(line, heartbeats):
    for name in ("x", "y"):
        line.axes[name].objects["1017:00"] = 1
    with heartbeats.record():
        line.advance(4)
    frames = heartbeats.traffic.rows()
    assert 7900 <= len(frames) <= 8100
    assert len({frame.number for frame in frames}) == len(frames)
    assert len(heartbeats.traffic.rows(node=1)) == pytest.approx(4000, abs=20)


@pytest.mark.parametrize("wrong", [{"kind": "nonsense"}, {"node": "x"}, {"object": "zz"}, {"since": -1}])
def test_wrong_filters(bus, wrong):
    with pytest.raises(servodrome.Error) as caught:
        bus.traffic.rows(**wrong)
    assert caught.value.what and caught.value.hint


def test_captures(line, heartbeats):
    with heartbeats.record():
        line.advance(0.05)
    pcap = heartbeats.capture()
    assert struct.unpack_from("<I", pcap)[0] in (0xA1B2C3D4, 0xA1B23C4D)
    assert heartbeats.capture("pcap") == pcap
    lines = heartbeats.capture("candump").decode().splitlines()
    assert len(lines) == 10
    assert {text.split()[2] for text in lines} == {"701#7F", "702#7F"}
    with pytest.raises(servodrome.Error, match="xyz"):
        heartbeats.capture("xyz")


# ---- Disturbances ----


def test_a_disturbance_and_its_end(line, heartbeats):
    bus = heartbeats
    bus.disturb(drop=1, axis="x")
    before = bus.view()
    line.advance(0.1)
    assert bus.view()["dropped"] - before["dropped"] == 10
    assert bus.view()["disturbance"]["drop"] == 1
    bus.calm()
    assert bus.view()["disturbance"] is None
    with bus.disturb(cut=True) as disturbed:
        assert disturbed is bus
        assert bus.view()["cut"] is True
    assert bus.view()["cut"] is False
    with pytest.raises(RuntimeError), bus.disturb(corrupt=0.1, seed=3):
        raise RuntimeError
    assert bus.view()["disturbance"] is None


def test_disturbances_of_other_buses(line):
    ring = line.buses["ecat"]
    with ring.disturb(unplug=1, drop_answer=0.5):
        assert ring.view()["unplugged"] == [1]
    assert ring.view()["unplugged"] == []


@pytest.mark.parametrize(
    "keys, error",
    [
        ({"drop": 2}, servodrome.BadValue),
        ({"drop": -0.1}, servodrome.BadValue),
        ({"drop": math.nan}, servodrome.BadValue),
        ({"drop": "1"}, servodrome.WrongType),
        ({"seed": 1.5}, servodrome.WrongType),
        ({"axis": "z"}, servodrome.BadValue),
        ({"unplug": 1}, servodrome.WrongType),
        ({"nothing": 1}, TypeError),
    ],
)
def test_wrong_disturbances_change_nothing(bus, keys, error):
    bus.disturb(drop=0.5)
    before = bus.view()
    with pytest.raises(error):
        bus.disturb(**keys)
    assert bus.view() == before
