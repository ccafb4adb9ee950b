"""PDOs of every transmission type (CiA 301 7.2.2, tables 67 and 72)."""

import struct

import pytest
from canopen import SdoAbortedError
from line import wait_for

INVALID = 0x80000000


def start(network, drive):
    network.send(0x000, [0x01, drive.node.id])
    wait_for(lambda: drive.bench.axis(drive.name)["nmt_state"] == "operational", "operational")


def set_tpdo(drive, number, transmission_type, mapping, inhibit=0, event_timer=0):
    """Configures TPDO `number` (1...) by the procedure of CiA 301 7.5.2.36; returns its identifier."""
    parameters, entries = 0x1800 + number - 1, 0x1A00 + number - 1
    identifier = 0x180 + 0x100 * (number - 1) + drive.node.id
    drive.write(parameters, INVALID | identifier, 1)
    drive.write(parameters, transmission_type, 2)
    drive.write(parameters, inhibit, 3)
    drive.write(parameters, event_timer, 5)
    drive.write(entries, 0, 0)
    for sub, entry in enumerate(mapping, 1):
        drive.write(entries, entry, sub)
    drive.write(entries, len(mapping), 0)
    drive.write(parameters, identifier, 1)
    return identifier


def set_rpdo(drive, number, transmission_type, mapping):
    parameters, entries = 0x1400 + number - 1, 0x1600 + number - 1
    identifier = 0x200 + 0x100 * (number - 1) + drive.node.id
    drive.write(parameters, INVALID | identifier, 1)
    drive.write(parameters, transmission_type, 2)
    drive.write(entries, 0, 0)
    for sub, entry in enumerate(mapping, 1):
        drive.write(entries, entry, sub)
    drive.write(entries, len(mapping), 0)
    drive.write(parameters, identifier, 1)
    return identifier


def quieten(drive):
    """Switches off the factory PDOs, so that only the PDO under test is on the bus."""
    for number in range(4):
        drive.write(0x1800 + number, INVALID | (0x180 + 0x100 * number + drive.node.id), 1)


def syncs(network, drive, identifier, count):
    """Sends `count` SYNCs one by one; returns the number of PDOs after each."""
    seen = []
    for _ in range(count):
        network.send_sync()
        network.settle(drive.node.id)
        seen.append(len(network.seen.of(identifier)))
    return seen


MODE = 0x60600008  # written by PDO and SDO
TARGET = 0x607A0020
MODE_DISPLAY = 0x60610008
STATUS = 0x60410010


@pytest.mark.parametrize("every", [1, 2, 3, 7, 240])
def test_synchronous_cyclic(drive, network, every):
    quieten(drive)
    identifier = set_tpdo(drive, 1, every, [STATUS])
    start(network, drive)
    if drive.name == "reference":  # its DC link charges after power-on, that of the others after Switched on
        wait_for(lambda: drive.statusword & 0x10, "the DC link")
    network.seen.clear()
    count = 2 * every if every < 240 else 245
    assert syncs(network, drive, identifier, count) == [n // every for n in range(1, count + 1)]
    assert set(network.seen.data(identifier)) == {struct.pack("<H", drive.statusword)}


def test_synchronous_acyclic_after_a_change_only(drive, network):
    quieten(drive)
    identifier = set_tpdo(drive, 1, 0, [MODE_DISPLAY])
    start(network, drive)
    syncs(network, drive, identifier, 2)
    network.seen.clear()
    assert syncs(network, drive, identifier, 3) == [0, 0, 0]
    drive.set_mode(3)
    assert not network.seen.of(identifier), "not before the SYNC"
    assert syncs(network, drive, identifier, 3) == [1, 1, 1]
    assert network.seen.data(identifier) == [b"\x03"]


@pytest.mark.parametrize("transmission_type", [254, 255])
def test_event_driven_on_change(drive, network, transmission_type):
    quieten(drive)
    identifier = set_tpdo(drive, 1, transmission_type, [MODE_DISPLAY])
    start(network, drive)
    network.settle(drive.node.id)
    network.seen.clear()
    drive.set_mode(3)
    assert network.seen.wait(identifier) == [b"\x03"]
    assert syncs(network, drive, identifier, 2) == [1, 1], "SYNC does not matter"
    drive.set_mode(1)
    assert network.seen.wait(identifier, 2) == [b"\x03", b"\x01"]


def test_event_timer(drive, network):
    quieten(drive)
    identifier = set_tpdo(drive, 1, 255, [MODE_DISPLAY], event_timer=20)
    start(network, drive)
    network.seen.clear()
    stamps = [frame.timestamp for frame in network.seen.of(identifier)]
    wait_for(lambda: len(network.seen.of(identifier)) >= 10, "10 PDOs by timer")
    assert set(network.seen.data(identifier)) == {b"\x00"} and stamps == []


def test_inhibit_time_keeps_changes_apart(drive, network):
    """A change sends a PDO immediately; two more changes send one PDO with the last value after the inhibit time of 3
    s."""
    quieten(drive)
    identifier = set_tpdo(drive, 1, 255, [MODE_DISPLAY], inhibit=30_000)
    start(network, drive)
    network.settle(drive.node.id)
    network.quiet(3.2)
    network.seen.clear()
    drive.write(0x6060, 3)
    assert network.seen.wait(identifier)[-1] == b"\x03"
    for mode in (1, 6):
        network.send(0x600 + drive.node.id, bytes([0x2F, 0x60, 0x60, 0, mode, 0, 0, 0]))
    assert network.seen.wait(identifier, 2)[-1] == b"\x06"
    assert len(network.seen.of(identifier)) == 2


@pytest.mark.remote_frames
def test_on_remote_request(reference, network):
    """252: sampled at the last SYNC; 253: sampled now. Both are sent only on a remote frame."""
    quieten(reference)

    def answers(identifier):
        return [bytes(f.data) for f in network.seen.of(identifier) if not f.is_remote_frame]

    for transmission_type in (252, 253):
        identifier = set_tpdo(reference, 1, transmission_type, [MODE_DISPLAY])
        start(network, reference)
        reference.set_mode(3)
        network.send_sync()
        network.settle(reference.node.id)
        reference.set_mode(1)
        network.seen.clear()
        network.settle(reference.node.id)
        assert not answers(identifier)
        network.send(identifier, remote=True)
        wait_for(lambda: answers(identifier), "an answer to the remote frame")
        assert answers(identifier) == [b"\x03" if transmission_type == 252 else b"\x01"]


def test_ismc_refuses_types_it_has_not(ismc):
    ismc.write(0x1800, INVALID | 0x181, 1)
    for transmission_type in (241, 251, 252, 253):
        with pytest.raises(SdoAbortedError) as refusal:
            ismc.write(0x1800, transmission_type, 2)
        assert refusal.value.code in (0x06090030, 0x06090031)


@pytest.mark.parametrize("transmission_type", [0, 1, 240])
def test_synchronous_rpdo_takes_effect_with_the_sync(drive, network, transmission_type):
    identifier = set_rpdo(drive, 1, transmission_type, [MODE, TARGET])
    start(network, drive)
    network.send(identifier, struct.pack("<bi", 3, 123_456))
    network.settle(drive.node.id)
    assert (drive.read(0x6060), drive.read(0x607A)) == (0, 0), "not before the SYNC"
    network.send_sync()
    network.settle(drive.node.id)
    assert (drive.read(0x6060), drive.read(0x607A)) == (3, 123_456)


@pytest.mark.parametrize("transmission_type", [254, 255])
def test_event_driven_rpdo_takes_effect_at_once(drive, network, transmission_type):
    identifier = set_rpdo(drive, 1, transmission_type, [MODE, TARGET])
    start(network, drive)
    network.send(identifier, struct.pack("<bi", 3, -5))
    network.settle(drive.node.id)
    assert (drive.read(0x6060), drive.read(0x607A)) == (3, -5)


def test_no_pdo_outside_operational(drive, network):
    identifier = set_rpdo(drive, 1, 255, [MODE, TARGET])
    transmit = set_tpdo(drive, 1, 1, [STATUS])
    network.seen.clear()
    network.send(identifier, struct.pack("<bi", 3, 77))
    assert syncs(network, drive, transmit, 2) == [0, 0]
    assert drive.read(0x607A) == 0


def test_the_factory_pdos_command_the_drive(drive, network):
    """Enables the drive by PDO only, with the factory mapping."""
    start(network, drive)
    tail = struct.pack("<bi", 1, 0) if drive.name == "ismc" else b""
    for word, state in ((0x06, 0x21), (0x07, 0x23), (0x0F, 0x27)):
        network.send(0x200 + drive.node.id, struct.pack("<H", word) + tail)
        wait_for(
            lambda: any(data[0] & 0x6F == state for data in network.seen.data(0x180 + drive.node.id)[-1:]),
            f"state {state:02X}h by PDO",
        )


def test_the_client_maps_by_name(reference, network):
    """canopen's own PDO interface, with the names of the EDS."""
    node = reference.node
    node.tpdo.read()
    node.rpdo.read()
    node.tpdo[5].clear()
    node.tpdo[5].add_variable("Position actual value")
    node.tpdo[5].add_variable("Statusword")
    node.tpdo[5].cob_id = 0x2A2
    node.tpdo[5].trans_type = 1
    node.tpdo[5].enabled = True
    node.tpdo.save()
    node.nmt.state = "OPERATIONAL"
    network.settle(2)
    node.rpdo[2]["Modes of operation"].raw = 3
    node.rpdo[2]["Controlword"].raw = 0
    node.rpdo[2].transmit()
    wait_for(lambda: reference.read(0x6061) == 3, "mode by PDO")
    network.send_sync()
    network.seen.wait(0x2A2)
    wait_for(lambda: node.tpdo[5].is_received, "the PDO")
    assert node.tpdo[5]["Statusword"].raw == reference.statusword
    # Two different times, and the encoder has noise.
    assert abs(node.tpdo[5]["Position actual value"].raw - reference.position) < 4
