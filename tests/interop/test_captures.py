"""The check of the captures must fail for a malformed frame, and for captures without any traffic."""

import pathlib
import struct
import subprocess

import pytest

CHECK = pathlib.Path(__file__).parents[2] / "tools/check-captures"
CAN, ETHERNET = 227, 1  # link types
BOOT_UP = (0x701, b"\x00")
SHORT_SDO = (0x601, b"\x40\x00")


def can(identifier, data):
    return struct.pack(">IBxxx8s", identifier, len(data), data)


def ethercat(command, place, data, length=None):
    length = len(data) if length is None else length
    datagram = struct.pack("<BBHHHH", command, 0, 0x1001, place, length, 0) + data + b"\0\0"
    header = b"\xff" * 6 + bytes.fromhex("001b19000001 88a4") + struct.pack("<H", 0x1000 | len(datagram))
    return (header + datagram).ljust(60, b"\0")


def write_pcap(path, link, packets):
    path.write_bytes(
        struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, link)
        + b"".join(struct.pack("<IIII", 1, n, len(p), len(p)) + p for n, p in enumerate(packets))
    )


def check(folder, kind):
    return subprocess.run([CHECK, folder, kind], capture_output=True, text=True, timeout=60, check=False)


MAILBOX = bytes.fromhex("0a00 0000 00 13  0020 40 1810 02 00000000")
GOOD = ethercat(5, 0x1000, MAILBOX)
LONG_DATAGRAM = ethercat(4, 0x0130, b"\0\0", length=400)
SHORT_MAILBOX = ethercat(5, 0x1000, b"\4" + MAILBOX[1:])


@pytest.mark.once
@pytest.mark.parametrize(
    "kind, link, frames, says",
    [
        ("can", CAN, [can(*BOOT_UP), can(*SHORT_SDO)], "reports errors or warnings"),
        ("can", CAN, [can(*BOOT_UP)], "no frame of this service"),
        ("can", CAN, None, "no captures"),
        ("ethercat", ETHERNET, [GOOD, LONG_DATAGRAM], "reports errors or warnings"),
        ("ethercat", ETHERNET, [GOOD, SHORT_MAILBOX], "reports errors or warnings"),
        ("ethercat", ETHERNET, [GOOD], "no frame of this service"),
        ("ethercat", ETHERNET, None, "no captures"),
    ],
)
def test_what_is_wrong_is_found(tmp_path, kind, link, frames, says):
    if frames is not None:
        write_pcap(tmp_path / ("ethercat-one.pcap" if kind == "ethercat" else "one.pcap"), link, frames)
    result = check(tmp_path, kind)
    assert result.returncode == 1
    assert says in result.stdout + result.stderr
    if frames and frames[0] == GOOD and len(frames) == 1:
        assert "none malformed" in result.stdout
