"""Slow, half-open and hostile clients on every port of a line, while an EtherCAT master exchanges process data at 1 kHz.

The line has a port of each kind: socketcand, slcan, Modbus TCP, a pty with Modbus RTU, a pty with the 10-byte protocol,
EtherCAT over UDP or, with --raw, on an Ethernet interface, and HTTP with its WebSocket stream. `servodrome studio` uses
a drive of the line, and has a second port with HTTP. hostile.py has the clients; each runs in its own process: silent
connections, one byte at a time, cut connections, random bytes, requests without reading the answers, enormous messages,
streams that are not read, foreign datagrams or frames. These do not command the slaves, because a second master on a real
segment could do that as well.

These conditions must hold: every frame of the EtherCAT master comes back with the right working counter. A frame comes
back within a period if the line had a processor at that time (/proc/PID/schedstat) and no older frames to answer; the
report says how many frames could be judged. The slaves stay in operation; afterwards every port serves a correct
client; memory and file descriptors do not grow without limit. A correct client also uses each port while the others are
at work; the report shows how often it had to connect again, which does not count as a finding.
"""

import contextlib
import http.client
import json
import os
import pathlib
import subprocess
import sys
import tempfile
import threading
import time

import ethercat
import hostile
import report
import sdo
import up

SLAVES = 4
MOST_GROWTH_KIB = 128 * 1024  # each of the streams has 4 MiB for a slow client, recordings have 64 MiB
MOST_DESCRIPTORS = 20  # more than before, after all hostile clients have disconnected
SETTLE_S = 60.0  # time in which the line must close the connections of clients that have disconnected
LINE = """
[[bus]]
name = "can0"
links = ["socketcand:127.0.0.1:0/can0", "slcan:{folder}/slcan"]
[[bus]]
name = "rs485a"
type = "rs485"
links = ["tcp:127.0.0.1:0", "pty:{folder}/modbus"]
[[bus]]
name = "rs485b"
type = "rs485"
links = ["pty:{folder}/serial10"]
[[bus]]
name = "ecat"
type = "ethercat"
links = ["{segment}"]
[[axis]]
name = "x"
product = "generic402"
bus = "can0"
node = 1
serial = "rs485a"
station = 2
[[axis]]
name = "y"
product = "ismk"
bus = "can0"
node = 2
serial = "rs485b"
"""


def line_text(folder, segment):
    axes = "".join(
        f'[[axis]]\nname = "e{number}"\nproduct = "generic402-ec"\nbus = "ecat"\n' for number in range(SLAVES)
    )
    return LINE.format(folder=folder, segment=segment) + axes


# ---- Correct clients: each sends a request over a new connection, and raises an exception if the answer is wrong ----


def ask_socketcand(link):
    client = sdo.Client(link)
    try:
        if client.read(1, 0x1000) != 0x00020192:
            raise ValueError("wrong answer")
    finally:
        client.close()


def ask_modbus_tcp(link):
    connection = hostile.connect(link)
    if connection is None:
        raise ConnectionError("refused")
    with connection:
        connection.settimeout(up.PATIENCE_S)
        connection.sendall(hostile.MODBUS_REQUEST)
        if connection.recv(100)[:2] != b"\0\1":
            raise ValueError("wrong answer")


def ask_http(link, address="/api/v1/clock", key="mode"):
    host = link.split("//")[1].split("/")[0]
    connection = http.client.HTTPConnection(host, timeout=up.PATIENCE_S)
    try:
        connection.request("GET", address)
        if json.loads(connection.getresponse().read())[key] != "real":
            raise ValueError("wrong answer")
    finally:
        connection.close()


def ask_studio(link):
    ask_http(link, "/api/v1/line", "kind")


def ask_pty(link, request, answer, attempts=20):
    """Repeats the request, because bytes of other clients may be on the way; a pause before it ends their frames."""
    file = hostile.open_pty(link)
    try:
        for _ in range(attempts):
            with contextlib.suppress(OSError):
                while os.read(file, 4096):
                    pass
            time.sleep(0.2)
            os.write(file, request)
            received = b""
            end = time.monotonic() + 2
            while time.monotonic() < end and answer not in received:
                with contextlib.suppress(OSError):
                    received += os.read(file, 4096)
                time.sleep(0.005)
            if answer in received:
                return
        raise ValueError(f"no answer, but {received[-60:]!r}")
    finally:
        os.close(file)


def ask_slcan(link):
    ask_pty(link, b"\r\rC\rO\r" + b"t60184000100000000000\r", b"t58184300100092010200")


def ask_rtu(link):
    ask_pty(link, hostile.RTU_REQUEST, b"\x02\x03\x02")


def ask_serial10(link):
    request = bytes([2, 0x40, 0x41, 0x60, 0, 0, 0, 0, 0])
    ask_pty(link, request + bytes([-sum(request) & 0xFF]), bytes([2, 0x4B, 0x41, 0x60, 0]))


# ---- The run ----


def start_studio(bus):
    """Returns the process of `servodrome studio` on a bus, and the address of its API."""
    command = [os.environ["SERVODROME"], "studio", "--api", "127.0.0.1:0", "--json", "--bus", bus]
    process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True)
    return process, json.loads(process.stdout.readline())["api"]


class Line:
    """The line, a studio on its CAN bus, and their ports."""

    def __init__(self, folder, raw):
        """`raw`: None, or the two ends of an Ethernet cable: that of the line and that of the masters."""
        self.up = up.Up(folder, line_text(folder, f"raw:{raw[0]}" if raw else "udp:127.0.0.1:0"))
        self.process = self.up.process.pid
        link = self.up.link
        self.segment = f"raw:{raw[1]}" if raw else link("ecat")
        self.studio, studio_api = start_studio(f"{link('can0', 0)}=1")
        self.ports = {  # name: link, good client
            "socketcand": (link("can0", 0), ask_socketcand),
            "slcan": (link("can0", 1), ask_slcan),
            "modbus_tcp": (link("rs485a", 0), ask_modbus_tcp),
            "modbus_rtu": (link("rs485a", 1), ask_rtu),
            "serial10": (link("rs485b"), ask_serial10),
            "http": (self.up.ready["api"], ask_http),
            "studio": (studio_api, ask_studio),
        }

    def descriptors(self):
        """Of both processes."""
        return sum(len(os.listdir(f"/proc/{process}/fd")) for process in (self.process, self.studio.pid))

    def memory_kib(self):
        """Of both processes."""
        return sum(ethercat.resident_kib(process) for process in (self.process, self.studio.pid))


class GoodClients(threading.Thread):
    """Sends requests to the ports with connections in turn while the hostile clients are at work."""

    def __init__(self, line):
        super().__init__(daemon=True)
        self.line = line
        self.stop = threading.Event()
        self.served = dict.fromkeys(("socketcand", "modbus_tcp", "http", "studio"), 0)
        self.refused = dict.fromkeys(self.served, 0)

    def run(self):
        while not self.stop.is_set():
            for name in self.served:
                link, ask = self.line.ports[name]
                try:
                    ask(link)
                    self.served[name] += 1
                except (OSError, ValueError, sdo.Lost, sdo.SdoError, http.client.HTTPException):
                    self.refused[name] += 1
            self.stop.wait(0.5)


def start_hostile(line, given):
    folder = pathlib.Path(__file__).parent
    links = [link for link, _ in line.ports.values()] + [line.segment]
    pairs = [(kind, link) for link in links for kind in hostile.kinds_for(link)]
    if given.only:
        pairs = [(kind, link) for kind, link in pairs if kind in given.only]
    processes = [
        subprocess.Popen([sys.executable, folder / "hostile.py", kind, link, str(given.seconds), str(given.seed + place)])
        for place, (kind, link) in enumerate(pairs)
    ]
    return pairs, processes


def check_ports(line, out):
    """Each port serves a correct client after the hostile ones have disconnected."""
    for name, (link, ask) in line.ports.items():
        end = time.monotonic() + SETTLE_S
        while True:
            try:
                ask(link)
                break
            except (OSError, ValueError, sdo.Lost, sdo.SdoError, http.client.HTTPException) as error:
                if time.monotonic() > end:
                    out.finding(f"{name} does not serve a good client {SETTLE_S:g} s after the hostile ones: {error!r}")
                    break
                time.sleep(0.5)


def run(folder, given, out):
    line = Line(folder, given.raw)
    hostile_processes = []
    try:
        check_ports(line, out)
        memory = line.memory_kib()
        descriptors = line.descriptors()
        master = ethercat.Master(line.segment, SLAVES, line.process)
        master.start()
        good = GoodClients(line)
        good.start()
        if given.realtime:
            os.sched_setscheduler(line.process, os.SCHED_FIFO, os.sched_param(10))
        pairs, hostile_processes = start_hostile(line, given)
        if given.realtime:
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(11))  # of this thread
        master.run(given.seconds)
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
        for process in hostile_processes:
            process.wait(up.PATIENCE_S)
        good.stop.set()
        good.join(2 * up.PATIENCE_S)
        states = master.states()
        out.figures["hostile_clients"] = len(pairs)
        out.figures["ethercat"] = master.figures()
        out.figures["good_clients"] = {"served": good.served, "connected_again": good.refused}
        judge(master, states, out)
        check_ports(line, out)
        for name, process in (("line", line.up.process), ("studio", line.studio)):
            if process.poll() is not None:
                out.finding(f"the {name} ended with {process.returncode}")
                return
        end = time.monotonic() + SETTLE_S
        while line.descriptors() > descriptors + MOST_DESCRIPTORS and time.monotonic() < end:
            time.sleep(0.2)
        after = line.memory_kib()
        out.figures["memory_kib"] = [memory, after]
        out.figures["descriptors"] = [descriptors, line.descriptors()]
        if after - memory > MOST_GROWTH_KIB:
            out.finding(f"memory grew from {memory} to {after} KiB")
        if line.descriptors() > descriptors + MOST_DESCRIPTORS:
            out.finding(f"{line.descriptors()} file descriptors are open, {descriptors} before")
        line.studio.terminate()
        if line.studio.wait(up.PATIENCE_S) != 0:
            out.finding(f"the studio ended with status {line.studio.returncode}")
        status = line.up.stop()
        if status not in (0, 130):
            out.finding(f"the line ended with status {status}: {(line.up.folder / 'output').read_text()[-400:]}")
    finally:
        for process in hostile_processes:
            process.kill()
            process.wait()
        line.studio.kill()
        line.studio.wait()
        line.up.kill()


def judge(master, states, out):
    figures = master.figures()
    if figures["unanswered"]:
        out.finding(f"{figures['unanswered']} of {figures['cycles']} frames did not come back")
    if figures["wrong_counters"]:
        out.finding(f"{figures['wrong_counters']} frames had a wrong working counter")
    if figures["late_busy"] > out.given.late:
        out.finding(f"{figures['late_busy']} frames were late because the line worked for others")
    if figures["late_asleep"] > out.given.late:
        out.finding(f"{figures['late_asleep']} frames were late while the line slept in the kernel")
    if states != [ethercat.OPERATIONAL] * SLAVES:
        out.finding(f"the slaves are in the AL states {states}")


def main(arguments=None):
    parser = report.options("clients", __doc__)
    parser.add_argument("--seconds", type=float, default=600, help="duration of the attack (600)")
    parser.add_argument("--only", action="append", choices=sorted(hostile.KINDS), help="only these kinds of clients")
    parser.add_argument("--raw", nargs=2, metavar=("LINE", "MASTER"), help="the segment is on the Ethernet interface LINE, the masters on MASTER: tools/with-veth tools/reliability clients --raw servo0 master0")
    parser.add_argument("--realtime", action="store_true", help="line and master run with SCHED_FIFO, so that a busy machine lets them (needs the right)")
    parser.add_argument("--late", type=int, default=0, help="so many late frames of the line are no finding (0)")
    given = parser.parse_args(arguments)
    out = report.Report("clients", given)
    interrupted = False
    with tempfile.TemporaryDirectory() as folder:
        try:
            run(folder, given, out)
        except KeyboardInterrupt:
            interrupted = True
    return out.finish(interrupted)


if __name__ == "__main__":
    sys.exit(main())
