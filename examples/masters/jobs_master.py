#!/usr/bin/env python3
"""The jobs of `servodrome studio` as a master: it homes the axis, moves it three revolutions there and back, and disables it.

    servodrome trial --scenarios scenarios/canopen -- python3 examples/masters/jobs_master.py {link}=1

With `=1` it looks for node 1 only, in place of all. It starts `servodrome studio` ($SERVODROME, or the one in PATH) for the link and uses nothing
but its API, as the page does. Exit status 0: all jobs are done.
"""

import json
import os
import signal
import subprocess
import sys
import time
import urllib.error
import urllib.request

REVOLUTIONS = 3
BOOT_TIME_S = 8
VELOCITIES = {"generic402": 10, "generic402-ec": 10, "ismc": 10, "jmc_ec": 3}  # revolutions per second of the drives that this machine may have
HOME_IS_HERE = 35  # homing method: the present position is home


class MachineError(Exception):
    pass


class NoDrive(MachineError):
    """The studio has ended because no drive answered."""


class Studio:
    """The program and its API."""

    def __init__(self, link):
        program = os.environ.get("SERVODROME", "servodrome")
        self.process = subprocess.Popen(
            [program, "studio", "--bus", link, "--api", "127.0.0.1:0", "--json", *sys.argv[2:]], stdout=subprocess.PIPE, text=True
        )
        ready = self.process.stdout.readline()
        if not ready:
            raise NoDrive("the studio finds no drive")
        self.api = json.loads(ready)["api"]

    def call(self, method, path, body=None):
        data = None if body is None else json.dumps(body).encode()
        request = urllib.request.Request(f"{self.api}/{path}", data, method=method)
        try:
            with urllib.request.urlopen(request, timeout=20) as answer:
                text = answer.read()
        except urllib.error.HTTPError as error:
            problem = json.loads(error.read())["error"]
            raise MachineError(f"{problem['what']}, {problem['where']}") from None
        except OSError as error:
            raise MachineError(f"the studio does not answer: {error}") from None
        return json.loads(text) if text else None

    def job(self, axis, do, **keys):
        job = self.call("POST", f"axes/{axis}/jobs", {"do": do, **keys})
        while job["state"] == "running":
            time.sleep(0.05)
            job = self.call("GET", f"jobs/{job['id']}")
        if job["state"] != "done":
            raise MachineError(f"{axis}: {do}: {job['error']['what']}")
        return job.get("result", {})

    def end(self):
        """Stops and disables the axes that it has moved."""
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
            try:
                self.process.wait(10)
            except subprocess.TimeoutExpired:
                self.process.kill()


def started(link):
    """Starts the studio, again and again until a drive answers."""
    end = time.monotonic() + BOOT_TIME_S
    while True:
        try:
            return Studio(link)
        except NoDrive:
            if time.monotonic() > end:
                raise
            time.sleep(0.5)


def axes_of(studio):
    """Returns the axes as soon as all of them answer."""
    end = time.monotonic() + BOOT_TIME_S
    while True:
        axes = studio.call("GET", "axes")["axes"]
        if all(axis.get("state") for axis in axes):
            return axes
        if time.monotonic() > end:
            silent = [axis["name"] for axis in axes if not axis.get("state")]
            raise MachineError(f"no answer from {', '.join(silent)}")
        time.sleep(0.2)


def await_disabled(studio, name):
    end = time.monotonic() + 2
    while (state := studio.call("GET", f"axes/{name}").get("state")) not in ("switch on disabled", "ready to switch on"):
        if time.monotonic() > end:
            raise MachineError(f"{name} is still in the state {state}")
        time.sleep(0.05)


def require_machine(axes):
    """Raises MachineError if drives are missing, or others are there; before anything moves."""
    for axis in axes:
        if axis["product"] not in VELOCITIES:
            raise MachineError(f"{axis['name']} is no drive of this machine: {axis['product']}")
    expected = os.environ.get("SERVODROME_PRODUCTS", "")
    found = ",".join(axis["product"] for axis in axes)
    if expected and "=" not in sys.argv[1] and found != expected:
        raise MachineError(f"the machine has {expected}, and {found} answer")


def run(studio):
    axes = axes_of(studio)
    require_machine(axes)
    for axis in axes:
        name = axis["name"]
        if axis["state"] == "fault":
            studio.job(name, "reset_fault")
        studio.job(name, "enable")
        studio.job(name, "home", method=HOME_IS_HERE, timeout_s=5)
        for distance in (REVOLUTIONS, -REVOLUTIONS, REVOLUTIONS, -REVOLUTIONS):
            begin = studio.call("GET", f"axes/{name}")
            result = studio.job(name, "move", by=distance, velocity=VELOCITIES[axis["product"]], acceleration=100, units="revolutions", timeout_s=10)
            print(f"{name}: at {result['position']:.4f} revolutions, {result['seconds']:.2f} s from {begin['position_counts']}")
        studio.job(name, "disable")
        await_disabled(studio, name)


def main():
    def terminate(*_):
        raise MachineError("terminated")

    signal.signal(signal.SIGTERM, terminate)
    studio = None
    try:
        studio = started(sys.argv[1])
        run(studio)
    except MachineError as error:
        print(f"failed: {error}")
        return 1
    finally:
        if studio is not None:
            studio.end()
    print("done")
    return 0


if __name__ == "__main__":
    sys.exit(main())
