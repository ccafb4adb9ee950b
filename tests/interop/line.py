"""A line of drives in a separate process, and its bench API."""

import contextlib
import json
import os
import pathlib
import signal
import subprocess
import time
import urllib.error
import urllib.request

PROGRAM = os.environ.get("SERVODROME") or str(
    pathlib.Path(__file__).parents[2] / "build/release/src/app/servodrome"
)

# Both products have the same travel: 131072 counts per revolution, the home switch around 0, the start next to it.
COUNTS = 131072
HOME_EDGES = (-COUNTS // 2, COUNTS // 2)
LIMITS = (-10 * COUNTS, 10 * COUNTS)
START = 2 * COUNTS
TRAVEL = f"""
  [axis.travel]
  counts_per_unit = {COUNTS}
  start = 2
  low_stop = -11
  high_stop = 11
  negative_limit = -10
  positive_limit = 10
  home = {{ from = -0.5, to = 0.5 }}
"""


def bus_text(name, kind="can"):
    return f'[[bus]]\nname = "{name}"\ntype = "{kind}"\n'


def axis_text(name, product, counts=COUNTS, travel=TRAVEL, **keys):
    """Returns an axis for a line file; `keys`: its connection, such as bus="can0", node=1."""
    rows = "\n".join(f"{key} = {json.dumps(value)}" for key, value in keys.items())
    return f'[[axis]]\nname = "{name}"\nproduct = "{product}"\n{rows}\n{travel.replace(str(COUNTS), str(counts))}'


TWO_DRIVES = (
    bus_text("can0") + axis_text("ismc", "ismc", bus="can0", node=1) + axis_text("reference", "generic402", bus="can0", node=2)
)

CAN_AND_ETHERCAT = ("can0=socketcand:127.0.0.1:0/can0", "ecat=udp:127.0.0.1:0")


def four_drives(on_ethercat, travel=TRAVEL):
    """Returns a line of a reference drive and an iSMK on CAN, and of two axes on EtherCAT, {name: product}."""
    return (
        bus_text("can0")
        + bus_text("ecat", "ethercat")
        + axis_text("reference", "generic402", travel=travel, bus="can0", node=2)
        + axis_text("ismk", "ismk", travel=travel, bus="can0", node=4)
        + "".join(axis_text(name, product, travel=travel, bus="ecat") for name, product in on_ethercat.items())
    )


# Timeouts are for events that never come, and long enough for a slow machine.
PATIENCE = float(os.environ.get("SERVODROME_PATIENCE", "60"))


def wait_for(condition, what, seconds=PATIENCE):
    """Waits for condition() and returns its first true value."""
    end = time.monotonic() + seconds
    while True:
        if value := condition():
            return value
        assert time.monotonic() < end, f"waited {seconds} s for {what() if callable(what) else what}"
        time.sleep(0.005)


def servodrome(*arguments, status=0):
    """Runs a command of the program to its end; returns its standard output or its error message. `status` None:
    any."""
    result = subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, text=True, timeout=120, check=False)
    wanted = result.returncode if status is None else status
    assert result.returncode == wanted, f"servodrome {arguments}: {result.returncode}\n{result.stdout}{result.stderr}"
    return result.stderr if status else result.stdout


class ApiError(Exception):
    def __init__(self, status, body):
        super().__init__(f"{status}: {body}")
        self.status = status
        self.body = body


class Bench:
    """The bench API: get("axes/ismc"), put("axes/ismc/inputs", {"DI0": True}) and so on."""

    def __init__(self, url):
        self.url = url

    def call(self, method, path, body=None):
        data = None if body is None else json.dumps(body).encode()
        request = urllib.request.Request(
            f"{self.url}/{path}", data=data, method=method, headers={"Content-Type": "application/json"}
        )
        try:
            with urllib.request.urlopen(request, timeout=60) as response:
                answer = response.read()
        except urllib.error.HTTPError as error:
            text = error.read()
            raise ApiError(error.code, json.loads(text) if text else None) from None
        return json.loads(answer) if answer else None

    def get(self, path):
        return self.call("GET", path)

    def put(self, path, body):
        return self.call("PUT", path, body)

    def post(self, path, body):
        return self.call("POST", path, body)

    def delete(self, path, body=None):
        return self.call("DELETE", path, body)

    def axis(self, name):
        return self.get(f"axes/{name}")

    def true_position(self, name):
        return self.axis(name)["position_counts"]


@contextlib.contextmanager
def stopped_at_the_end():
    """A list of lines, which are stopped at the end of the block."""
    lines = []
    yield lines
    for line in lines:
        line.stop()


class Line:
    """`servodrome up` with a line file, on a link, until stop(). The system chooses the ports."""

    def __init__(self, folder, text, buses, log=None, arguments=()):
        self.folder = pathlib.Path(folder)
        file = self.folder / "line.toml"
        file.write_text(text)
        ready = self.folder / "ready.json"
        command = [PROGRAM, "up", file, "--api", "127.0.0.1:0", "--ready-file", ready, *arguments]
        for bus in buses:
            command += ["--bus", bus]
        if log:
            command += ["--log", log]
        self.output = self.folder / "output"
        with open(self.output, "wb") as output:
            self.process = subprocess.Popen(
                [str(word) for word in command], stdin=subprocess.DEVNULL, stdout=output, stderr=subprocess.STDOUT
            )
        self.wait_until_ready(ready)

    def wait_until_ready(self, ready):
        wait_for(lambda: ready.exists() or self.process.poll() is not None, lambda: f"the line: {self.said()}")
        assert ready.exists(), f"the line ended with {self.process.returncode}: {self.said()}"
        self.ready = json.loads(ready.read_text())
        self.bench = Bench(self.ready["api"])
        self.links = {bus["name"]: bus["links"] for bus in self.ready["buses"]}

    def said(self):
        return self.output.read_text(errors="replace")

    def stop(self):
        """Ends the program as Ctrl-C does; fails if it does not end properly."""
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
            try:
                self.process.wait(30)
            except subprocess.TimeoutExpired:
                self.process.kill()
                self.process.wait()
                raise AssertionError("the line did not end on SIGINT") from None
        assert self.process.returncode == 0, f"the line ended with {self.process.returncode}: {self.said()}"
