"""The check of the captures can fail: it objects to a malformed frame, and to captures in which nothing happened."""

import pathlib
import struct
import subprocess

import pytest

CHECK = pathlib.Path(__file__).parents[2] / "tools/check-captures"
BOOT_UP = (0x701, b"\x00")
SHORT_SDO = (0x601, b"\x40\x00")


def write_pcap(path, frames):
    """LINKTYPE_CAN_SOCKETCAN, as the line writes it."""
    packets = [struct.pack(">IBxxx8s", identifier, len(data), data) for identifier, data in frames]
    path.write_bytes(
        struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, 227)
        + b"".join(struct.pack("<IIII", 1, n, len(p), len(p)) + p for n, p in enumerate(packets))
    )


def check(folder):
    return subprocess.run([CHECK, folder], capture_output=True, text=True, timeout=60, check=False)


@pytest.mark.once
@pytest.mark.parametrize(
    "frames, says", [([BOOT_UP, SHORT_SDO], "tshark objects"), ([BOOT_UP], "never seen"), (None, "no captures")]
)
def test_what_is_wrong_is_found(tmp_path, frames, says):
    if frames is not None:
        write_pcap(tmp_path / "one.pcap", frames)
    result = check(tmp_path)
    assert result.returncode == 1
    assert says in result.stdout + result.stderr
