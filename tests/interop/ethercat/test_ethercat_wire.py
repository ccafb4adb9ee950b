"""The line's capture equals the frames on the cable."""

import os
import pathlib
import socket
import struct
import threading

from capture import frames_of
from frames import FrameMaster, RawLink
from line import PATIENCE
from segment import segment

ETH_P_ALL = 3


class Tap(threading.Thread):
    """Records all frames on an interface in both directions, until `last` has come back."""

    def __init__(self, interface, last):
        super().__init__(daemon=True)
        self.frames, self.last = [], last
        self.socket = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(ETH_P_ALL))
        self.socket.bind((interface, ETH_P_ALL))
        self.start()

    def run(self):
        with self.socket:
            while not self.last(frame := self.socket.recv(2048)):
                self.frames.append(frame)


def test_log_and_wire_agree(start_line, open_master, cables, tmp_path):
    """The log contains exactly the frames that passed the master's end of the cable, in order. The frames of the cable
    are stored next to the other captures."""
    log = tmp_path / "log.pcap"
    line = start_line(segment(2), log=log)
    tap = Tap(cables[0][0], lambda frame: frame[6:12] in (RawLink.SOURCE, RawLink.ANSWER))
    master = open_master()
    assert master.scan() == 2
    master.slaves[1].sdo_read(0x1008, 0)
    master.run()
    master.pass_cycles(50)
    master.close()
    with FrameMaster(RawLink(cables[0][0])) as marker:
        marker.count()
    tap.join(PATIENCE)
    line.stop()
    on_wire = tap.frames
    kept = pathlib.Path(os.environ.get("SERVODROME_CAPTURES", tmp_path)) / "ethercat-wire.pcap"
    packets = (struct.pack("<IIII", 1, n, len(frame), len(frame)) + frame for n, frame in enumerate(on_wire))
    kept.write_bytes(struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, 1) + b"".join(packets))
    assert list(frames_of(kept)) == on_wire
    assert len(on_wire) > 400
    logged = list(frames_of(log))[:-2]
    for way in (0, 2):  # to the slaves, and back: with the second bit of the source address inverted
        assert [f for f in on_wire if f[6] & 2 == way] == [f for f in logged if f[6] & 2 == way]
