"""Reads a capture (pcap) of a segment's frames."""

import struct

from frames import APRD, APWR, FPRD, FPWR, taken_apart

WRITES, READS = (APWR, FPWR), (APRD, FPRD)


def frames_of(path):
    """Returns every Ethernet frame, as a master sent it or as it came back."""
    data, at = path.read_bytes(), 24
    while at < len(data):
        (length,) = struct.unpack_from("<I", data, at + 8)
        yield data[at + 16 : at + 16 + length]
        at += 16 + length


def sdo_transfers(path, mailbox_out=0x1000, mailbox_in=0x1100):
    """Returns the SDO parts, 8 bytes each, of requests and their responses in order."""
    transfers, request = [], None
    for frame in frames_of(path):
        if not frame[6] & 2:
            continue  # on the way to the slaves
        for command, _, address, data, counter in taken_apart(frame[14:]):
            place = address >> 16
            if counter != 1 or len(data) < 16 or data[5] & 0x0F != 3:
                continue  # not CoE
            service = data[7] >> 4
            if command in WRITES and place == mailbox_out and service == 2:
                request = data[8:16]
            elif command in READS and place == mailbox_in and service in (2, 3) and request:
                transfers.append((request, data[8:16]))
                request = None
    return transfers
