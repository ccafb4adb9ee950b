"""SDO: expedited, segmented and block transfers in both directions, and aborts (CiA 301 7.2.4)."""

import io
import random

import canopen
import pytest
from canopen import SdoAbortedError

DATA = random.Random(402).randbytes(1024)


def abort_code(call, *arguments):
    with pytest.raises(SdoAbortedError) as refusal:
        call(*arguments)
    return refusal.value.code


def test_expedited_of_every_length(reference):
    for index, sub, value in ((0x6098, 0, -1), (0x6066, 0, 1234), (0x607A, 0, -123456789), (0x6083, 0, 4_000_000_000)):
        reference.write(index, value, sub)
        assert reference.read(index, sub) == value


def test_expedited_frames_are_those_of_the_standard(drive, network):
    node = drive.node.id
    network.seen.clear()
    network.send(0x600 + node, bytes.fromhex("23FF6000E8030000"))
    assert network.seen.wait(0x580 + node)[0].hex().upper() == "60FF600000000000"
    network.send(0x600 + node, bytes.fromhex("40FF600000000000"))
    assert network.seen.wait(0x580 + node, 2)[1].hex().upper() == "43FF6000E8030000"


def test_segmented_upload_of_a_string(ismc, reference):
    # "Sapphire" needs 2 segments, the other name 5.
    assert ismc.read(0x1008) == "Sapphire"
    assert reference.read(0x1008) == "Servodrome CiA 402 reference drive"


@pytest.mark.parametrize("size", [5, 7, 8, 14, 1024])
def test_segmented_both_ways(reference, size):
    reference.node.sdo.download(0x2F10, 0, DATA[:size], force_segment=True)
    assert reference.node.sdo.upload(0x2F10, 0) == DATA[:size]


@pytest.mark.parametrize("size", [5, 7, 889, 890, 1024])
def test_block_both_ways_with_crc(reference, size):
    with reference.node.sdo.open(0x2F10, 0, "wb", size=size, block_transfer=True) as stream:
        stream.write(DATA[:size])
    assert reference.node.sdo.upload(0x2F10, 0) == DATA[:size]
    with reference.node.sdo.open(0x2F10, 0, "rb", block_transfer=True, request_crc_support=True) as stream:
        assert stream.read() == DATA[:size]


def test_the_drive_hands_out_its_own_eds(reference, network, eds):
    with reference.node.sdo.open(0x1021, 0, "rb", block_transfer=True) as stream:
        text = stream.read()
    with open(eds("generic402"), "rb") as file:
        assert text == file.read()
    described = canopen.import_od(io_named(text.decode()), 2)
    assert described["Statusword"].index == 0x6041


def io_named(text):
    file = io.StringIO(text)
    file.name = "upload.eds"
    return file


@pytest.mark.parametrize(
    "index, sub, code",
    [
        (0x5FFF, 0, 0x06020000),  # no such object
        (0x6099, 3, 0x06090011),  # no such sub-index
    ],
)
def test_aborts_of_what_is_not_there(drive, index, sub, code):
    assert abort_code(drive.node.sdo.upload, index, sub) == code
    assert abort_code(drive.node.sdo.download, index, sub, b"\0\0\0\0") == code


def test_abort_of_writing_what_is_read_only(drive):
    assert abort_code(drive.node.sdo.download, 0x6041, 0, b"\0\0") == 0x06010002


def test_abort_of_reading_what_is_write_only(reference):
    assert abort_code(reference.node.sdo.upload, 0x60C4, 6) == 0x06010001


def test_aborts_of_wrong_lengths(ismc, reference):
    # ISMC uses one code for both (Table 2-16); CiA 301 has separate codes for too long and too short.
    assert abort_code(ismc.node.sdo.download, 0x60FF, 0, b"\0\0") == 0x06070010
    assert abort_code(ismc.node.sdo.download, 0x6040, 0, b"\0\0\0\0") == 0x06070010
    assert abort_code(reference.node.sdo.download, 0x60FF, 0, b"\0\0") == 0x06070013
    assert abort_code(reference.node.sdo.download, 0x6040, 0, b"\0\0\0\0") == 0x06070012


def test_aborts_of_values(drive):
    assert abort_code(drive.write, 0x6060, 55) == 0x06090030
    assert abort_code(drive.write, 0x605A, 100) == 0x06090030
    assert abort_code(drive.write, 0x1010, 0x12345678, 1) == 0x08000020


def test_abort_of_what_cannot_be_mapped(drive):
    drive.write(0x1A02, 0, 0) if drive.read(0x1802, 1) & 0x80000000 else drive.write(
        0x1802, drive.read(0x1802, 1) | 0x80000000, 1
    )
    drive.write(0x1A02, 0, 0)
    assert abort_code(drive.write, 0x1A02, 0x10170010, 1) == 0x06040041  # not mappable
    assert abort_code(drive.write, 0x1A02, 0x5FFF0010, 1) == 0x06020000  # no such object
    for sub in (1, 2, 3):
        drive.write(0x1A02, 0x60640020, sub)
    assert abort_code(drive.write, 0x1A02, 3, 0) == 0x06040042  # 96 bits


def test_abort_of_an_unknown_command_and_of_a_toggle_that_does_not(drive, network):
    node = drive.node.id
    network.seen.clear()
    network.send(0x600 + node, bytes.fromhex("E061600000000000"))
    assert network.seen.wait(0x580 + node)[0].hex().upper() == "8061600001000405"
    network.seen.clear()
    network.send(0x600 + node, bytes.fromhex("4008100000000000"))  # segmented upload
    network.seen.wait(0x580 + node)
    network.send(0x600 + node, bytes.fromhex("7000000000000000"))  # toggle bit of the second segment
    assert network.seen.wait(0x580 + node, 2)[1].hex().upper() == "8008100000000305"
    assert drive.read(0x1000) == 0x00020192, "the server goes on"


def test_ismc_offers_no_block_transfer(ismc, network):
    network.seen.clear()
    network.send(0x601, bytes.fromhex("A408100000007F00"))
    assert network.seen.wait(0x581)[0].hex().upper() == "8008100001000405"


def test_store_and_restore(drive, network, line):
    drive.write(0x6083, 777_777)
    drive.write(0x1010, int.from_bytes(b"save", "little"), 1)
    drive.write(0x6083, 888_888)
    network.seen.clear()
    line.bench.post(f"axes/{drive.name}/power", {"action": "cycle"})
    network.seen.wait(0x700 + drive.node.id)
    assert drive.read(0x6083) == 777_777
    drive.write(0x1011, int.from_bytes(b"load", "little"), 1)
    assert drive.read(0x6083) == 777_777, "factory values from the next reset on"
    network.seen.clear()
    network.send(0x000, [0x81, drive.node.id])
    network.seen.wait(0x700 + drive.node.id)
    assert drive.read(0x6083) == 1_310_720
