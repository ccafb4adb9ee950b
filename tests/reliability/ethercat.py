"""A small EtherCAT master, over UDP or an Ethernet interface, that exchanges process data every millisecond and reports
the cause of late frames."""

import os
import socket
import struct
import time

NOP, APRD, APWR, BRD, BWR, LRW = 0, 1, 2, 7, 8, 12
PROCESS_BYTES = 14  # outputs and inputs of a generic402-ec with the mapping from the factory
INIT, PRE_OPERATIONAL, SAFE_OPERATIONAL, OPERATIONAL = 1, 2, 4, 8
WATCHDOG_MS = 6_500  # the maximum; a pause of the machine must not end the operation
MOST_OUTSTANDING = 64  # frames without an answer: then the master waits, so that no buffer overflows
MOST_WAITED_NS = 100_000  # for a processor, if the lateness of a frame is to count
SO_TIMESTAMPNS = 35
ETHERNET = b"\xff" * 6 + bytes.fromhex("020000000001") + b"\x88\xa4"  # to all, from a local address, EtherCAT
ETHERTYPE = 0x88A4


def datagram(command, index, position, offset, data, more=False):
    """One datagram, for a slave by its position in the line, or with a logical address."""
    head = struct.pack("<BBHHHH", command, index & 0xFF, position & 0xFFFF, offset, len(data) | (0x8000 if more else 0), 0)
    return head + data + b"\0\0"


def frame(datagrams):
    return struct.pack("<H", len(datagrams) | 0x1000) + datagrams


class UdpPort:
    """Frames in UDP datagrams; `link`: udp:HOST:PORT."""

    def __init__(self, link):
        host, _, port = link.removeprefix("udp:").rpartition(":")
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.connect((host, int(port)))

    def send(self, content):
        self.socket.send(content)

    def content(self, received):
        return received


class EthernetPort:
    """Frames on an interface; `link`: raw:INTERFACE."""

    def __init__(self, link):
        self.socket = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(ETHERTYPE))
        self.socket.bind((link.removeprefix("raw:"), ETHERTYPE))

    def send(self, content):
        self.socket.send((ETHERNET + content).ljust(60, b"\0"))

    def content(self, received):
        """Without the head, and without the padding of a short frame."""
        length = struct.unpack_from("<H", received, len(ETHERNET))[0] & 0x7FF
        return received[len(ETHERNET) : len(ETHERNET) + 2 + length]


class Master:
    """Brings the slaves of a segment into operation and exchanges their process data."""

    def __init__(self, link, slaves, process):
        """`process`: the line's process, to read the time that it waits for a processor."""
        self.port = EthernetPort(link) if link.startswith("raw:") else UdpPort(link)
        self.socket = self.port.socket
        self.socket.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
        self.slaves = slaves
        self.schedstat = f"/proc/{process}/schedstat"
        self.sent = 0
        self.answered = 0
        self.wrong_counters = 0
        self.skipped = 0
        self.late = 0
        self.late_busy = 0
        self.late_asleep = 0
        self.longest_ms = 0.0
        self.judged = 0
        self.longest_judged_ms = 0.0
        self.outstanding = {}  # number: (time of sending, times of the line until then, all others are back)

    # ---- The start ----

    def ask(self, command, position, offset, data):
        """Sends one datagram; returns data and working counter of the answer. Repeats it until it comes back."""
        for _ in range(100):
            self.port.send(frame(datagram(command, 0, position, offset, data)))
            self.socket.settimeout(1.0)
            try:
                answer = self.port.content(self.socket.recv(2048))
            except TimeoutError:
                continue
            if len(answer) == 14 + len(data) and answer[2] == command:
                return answer[12 : 12 + len(data)], struct.unpack_from("<H", answer, 12 + len(data))[0]
        raise RuntimeError("the segment does not answer")

    def start(self):
        _, count = self.ask(BRD, 0, 0x0000, b"\0")
        if count != self.slaves:
            raise RuntimeError(f"{count} slaves answer, not {self.slaves}")
        self.change_state(INIT | 0x10)
        for slave in range(self.slaves):
            position = -slave
            for number, (start, length, control) in enumerate(
                ((0x1000, 128, 0x26), (0x1100, 128, 0x22), (0x1200, PROCESS_BYTES, 0x64), (0x1500, PROCESS_BYTES, 0x20))
            ):
                self.ask(APWR, position, 0x0800 + 8 * number, struct.pack("<HHBBBB", start, length, control, 0, 1, 0))
            logical = slave * 2 * PROCESS_BYTES
            for number, (place, start, kind) in enumerate(((logical, 0x1200, 2), (logical + PROCESS_BYTES, 0x1500, 1))):
                mapping = struct.pack("<IHBBHBBBBH", place, PROCESS_BYTES, 0, 7, start, 0, kind, 1, 0, 0)
                self.ask(APWR, position, 0x0600 + 16 * number, mapping)
            self.ask(APWR, position, 0x0420, struct.pack("<H", 10 * WATCHDOG_MS))
        self.change_state(PRE_OPERATIONAL)
        self.change_state(SAFE_OPERATIONAL)
        self.ask(LRW, 0, 0, bytes(self.slaves * 2 * PROCESS_BYTES))
        self.change_state(OPERATIONAL)

    def change_state(self, state):
        self.ask(BWR, 0, 0x0120, bytes([state, 0]))
        end = time.monotonic() + 30
        while self.states() != [state & 0x0F] * self.slaves:
            if time.monotonic() > end:
                raise RuntimeError(f"the slaves do not reach state {state & 0x0F}: {self.states()}")
            self.ask(LRW, 0, 0, bytes(self.slaves * 2 * PROCESS_BYTES))
            time.sleep(0.001)

    def states(self):
        """Returns the AL states of all slaves; with 10h: an error."""
        return [self.ask(APRD, -slave, 0x0130, b"\0\0")[0][0] for slave in range(self.slaves)]

    # ---- The cycles ----

    def line_did(self):
        """Returns for how long the line has run and has waited for a processor, in ns."""
        with open(self.schedstat, encoding="ascii") as file:
            ran, waited, _ = file.read().split()
        return int(ran), int(waited)

    def run(self, seconds, period_s=0.001):
        """Exchanges process data for this time."""
        self.socket.setblocking(False)
        self.period_ns = round(period_s * 1e9)
        image = bytes(self.slaves * 2 * PROCESS_BYTES)
        began = due = time.monotonic()
        while due < began + seconds:
            time.sleep(max(0.0, due - time.monotonic()))
            if len(self.outstanding) < MOST_OUTSTANDING:
                self.sent += 1
                number = struct.pack("<Q", self.sent)
                did = self.line_did()
                self.port.send(frame(datagram(LRW, self.sent, 0, 0, image, more=True) + datagram(NOP, 0, 0, 0, number)))
                self.outstanding[self.sent] = (time.time_ns(), did, not self.outstanding)
            else:
                self.skipped += 1
            self.receive()
            due += period_s
            late = int((time.monotonic() - due) / period_s)
            if late > 0:
                self.skipped += late
                due += late * period_s
        end = time.monotonic() + 20  # waits for frames that are still on their way
        while self.outstanding and time.monotonic() < end:
            time.sleep(0.01)
            self.receive()

    def receive(self):
        while True:
            try:
                answer, extra, _, _ = self.socket.recvmsg(2048, 64)
            except BlockingIOError:
                return
            answer = self.port.content(answer)
            image = self.slaves * 2 * PROCESS_BYTES
            if len(answer) != 2 + 12 + image + 12 + 8:
                continue
            counter = struct.unpack_from("<H", answer, 12 + image)[0]
            number = struct.unpack_from("<Q", answer, 2 + 12 + image + 10)[0]
            if number not in self.outstanding:
                continue
            self.answered += 1
            self.wrong_counters += counter != 3 * self.slaves
            self.judge(*self.outstanding.pop(number), extra)

    def judge(self, sent_at, before, alone, extra):
        """Returns whether the answer was late, and the cause. Judges only frames for which the line was up to date and
        running.

        If the line had to wait for a processor it has to catch up, and this also delays the following frames.
        """
        seconds, nanoseconds = struct.unpack("@qq", extra[0][2])
        took = seconds * 1_000_000_000 + nanoseconds - sent_at
        self.longest_ms = max(self.longest_ms, took / 1e6)
        self.late += took > self.period_ns
        ran, waited = (after - earlier for after, earlier in zip(self.line_did(), before))
        if not alone or waited > MOST_WAITED_NS:
            return
        self.judged += 1
        self.longest_judged_ms = max(self.longest_judged_ms, took / 1e6)
        if took > self.period_ns:
            if ran > self.period_ns:
                self.late_busy += 1
            else:
                self.late_asleep += 1

    def figures(self):
        return {
            "cycles": self.sent,
            "unanswered": self.sent - self.answered,
            "wrong_counters": self.wrong_counters,
            "late": self.late,
            "judged": self.judged,
            "late_busy": self.late_busy,
            "late_asleep": self.late_asleep,
            "longest_ms": round(self.longest_ms, 3),
            "longest_judged_ms": round(self.longest_judged_ms, 3),
            "skipped_by_master": self.skipped,
        }


def resident_kib(process):
    with open(f"/proc/{process}/statm", encoding="ascii") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE") // 1024
