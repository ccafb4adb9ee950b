"""The program's client commands on a segment of its own line, over the cable and over UDP."""

import json

import pytest
from line import COUNTS, servodrome, wait_for
from segment import segment


@pytest.fixture(params=["raw", "udp"])
def line(request, start_line):
    link = None if request.param == "raw" else "udp:127.0.0.1:0"
    return start_line(segment(2, alias=lambda number: 300 + number), link)


@pytest.fixture
def client(line, cables):
    """client(COMMAND, ...): a client command on the segment."""
    served = line.links["ecat"][0]
    link = served if served.startswith("udp:") else f"raw:{cables[0][0]}"
    return lambda command, *arguments, **options: servodrome(command, "--bus", link, *arguments, **options)


def states(client):
    return [node["state"] for node in json.loads(client("state", "--json"))["nodes"]]


def test_scan(client):
    found = json.loads(client("scan", "--json"))["nodes"]
    assert [node["node"] for node in found] == [1, 2]
    assert [node["alias"] for node in found] == [301, 302]
    assert {node["product"] for node in found} == {"generic402-ec"}
    assert {node["state"] for node in found} == {"INIT"}
    assert [node["links"] for node in found] == [[0, 1], [0]]
    assert "INIT" in client("scan")


def test_get_and_set_by_position_and_alias(client, bench):
    client("set", "--node", "2", "6083", "123456")
    assert "123456" in client("get", "--node", "302", "6083")
    assert bench.get("axes/drive2/objects/6083/0")["value"] == 123456
    assert states(client) == ["INIT", "PREOP"]
    assert "0602" in client("get", "--node", "1", "5FFF", status=1)
    assert "alias 302" in client("get", "6041", status=2)
    assert "no slave has position or alias 77" in client("get", "--node", "77", "6041", status=2)


def test_scope_looks_and_moves(client, bench):
    looked = json.loads(client("scope", "--node", "2", "position", "statusword", "--seconds", "0.2", "--json"))
    assert looked["way"] == "process data in SAFEOP" and looked["rows"] + looked["missed"] >= 99, looked
    assert states(client) == ["INIT", "PREOP"]
    script = ["--do", "units revolutions", "--do", "enable", "--do", "move by 1 velocity 4", "--do", "wait 0.2"]
    moved = json.loads(client("scope", "--node", "2", "position", "--rate", "250", "--json", *script))
    assert moved["way"] == "process data in OP" and moved["problems"] == [], moved
    positions = moved["channels"][0]["values"]
    assert abs(positions[-1] - positions[0] - COUNTS) < COUNTS / 100
    assert "operation enabled" not in bench.get("axes/drive2")["state"]


def test_states(client):
    client("state", "preop")
    client("state", "safeop", "--node", "2")
    assert states(client) == ["PREOP", "SAFEOP"]
    held = json.loads(client("state", "op", "--seconds", "0.5", "--cycle", "10", "--json"))
    assert {node["state"] for node in held["nodes"]} == {"OP"}
    assert held["cycles"] > 10
    assert states(client) == ["PREOP", "PREOP"]
    client("state", "boot", "--node", "1")
    assert states(client) == ["BOOT", "PREOP"]
    client("state", "init")
    assert states(client) == ["INIT", "INIT"]
    assert "is not a state" in client("state", "run", status=2)


@pytest.mark.parametrize("clocks", [[], ["--clocks"]], ids=["free_run", "clocks"])
def test_home_and_move(client, bench, clocks):
    client("home", "--node", "1", "--method", "35", "--cycle", "10", *clocks)
    before = bench.true_position("drive1")
    client("move", "--node", "1", "--by", "1", "--revolutions", "--cycle", "10", *clocks)
    wait_for(lambda: abs(bench.true_position("drive1") - before - COUNTS) <= 100, "the move")
    assert states(client)[0] == "PREOP"


def test_prove(client):
    proven = json.loads(client("prove", "--cycle", "10", "--json"))["axes"]
    assert [axis["passed"] for axis in proven] == [True, True]


def test_what_is_not_there(cables, line):
    assert "no server listens there" in servodrome("scan", "--bus", "udp:127.0.0.1:9", status=1)
    servodrome("scan", "--bus", "raw:nowhere0", status=1)
    assert "no slave answers" in servodrome("scan", "--bus", f"raw:{cables[1][0]}", status=1)
    servodrome("scan", "--bus", "udp:", status=2)
    assert "needs a CAN bus" in servodrome("nmt", "start", "--all", "--bus", "udp:127.0.0.1", status=2)
