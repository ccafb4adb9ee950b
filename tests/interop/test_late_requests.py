"""A request that began before a halt moves no axis, however late its last byte comes (docs/decisions/0033)."""

import json
import socket

import pytest
from line import Line, axis_text, bus_text, wait_for

pytestmark = [pytest.mark.once, pytest.mark.program("the bench API of the line is the subject")]


@pytest.fixture
def line(tmp_path):
    line = Line(tmp_path, bus_text("can0") + axis_text("reference", "generic402", bus="can0", node=2),
                ["can0=socketcand:127.0.0.1:0/can0"])
    yield line
    line.stop()


class Slow:
    """A client that sends its request in two parts."""

    def __init__(self, line, order, kept_back):
        host, port = line.bench.url.split("//")[1].split("/")[0].rsplit(":", 1)
        body = json.dumps(order).encode()
        head = f"POST /api/v1/axes/reference/jobs HTTP/1.1\r\nHost: {host}\r\nContent-Length: {len(body)}\r\n\r\n".encode()
        self.rest = (head + body)[-kept_back:]
        self.socket = socket.create_connection((host, int(port)), 30)
        self.socket.sendall((head + body)[:-kept_back])

    def complete(self):
        """Sends the rest; returns the status of the answer."""
        self.socket.sendall(self.rest)
        status = int(self.socket.recv(65536).split()[1])
        self.socket.close()
        return status


def does(line, **order):
    job = line.bench.post("axes/reference/jobs", order)
    wait_for(lambda: line.bench.get(f"jobs/{job['id']}")["state"] != "running", str(order))


@pytest.mark.parametrize("kept_back", [1, 40, 120], ids=["last byte", "part of the body", "part of the head"])
@pytest.mark.parametrize("halt", ["stop", "disable", "stop all"])
def test_a_motion_that_is_completed_after_a_halt_is_refused(line, halt, kept_back):
    does(line, do="enable")
    slow = Slow(line, {"do": "velocity", "velocity": 3, "units": "revolutions"}, kept_back)
    line.bench.get("clock")  # the server has read what came before this request
    if halt == "stop all":
        line.bench.post("stop", {})
    else:
        does(line, do=halt)
    assert slow.complete() == 409
    assert abs(line.bench.axis("reference")["velocity_rpm"]) < 1
    does(line, do="enable")
    assert Slow(line, {"do": "velocity", "velocity": 0.1, "units": "revolutions"}, kept_back).complete() == 201
