"""LSS: node id and bit rate of the reference drive by its identity (CiA 305)."""

import pytest
from canopen.lss import LssError, LssMaster
from line import PATIENCE, wait_for

IDENTITY = {"vendorId": 0x53455256, "productCode": 0x34303252, "revisionNumber": 0x00010000}


@pytest.fixture
def patient(monkeypatch):
    """A timeout for answers that must come. Requests to missing nodes use a short timeout."""
    monkeypatch.setattr(LssMaster, "RESPONSE_TIMEOUT", PATIENCE)


def identity(reference):
    return [reference.read(0x1018, sub) for sub in (1, 2, 3, 4)]


def test_selective_switching_and_inquiry(network, reference, patient):
    words = identity(reference)
    assert words[:3] == list(IDENTITY.values())
    assert network.lss.send_switch_state_selective(*words)
    assert network.lss.inquire_node_id() == 2
    assert [network.lss.inquire_lss_address(command) for command in (0x5A, 0x5B, 0x5C, 0x5D)] == words
    network.lss.send_switch_state_global(network.lss.WAITING_STATE)


def test_a_new_node_id_from_the_next_reset_on_and_stored(network, reference, line, patient):
    assert network.lss.send_switch_state_selective(*identity(reference))
    network.lss.configure_node_id(42)
    network.lss.store_configuration()
    network.lss.send_switch_state_global(network.lss.WAITING_STATE)
    assert reference.read(0x1000) == 0x00020192, "still node 2"
    network.send(0x000, [0x82, 2])
    assert network.seen.wait(0x700 + 42) == [b"\x00"]
    node = network.add_node(42, reference.node.object_dictionary)
    assert node.sdo[0x1018][2].raw == IDENTITY["productCode"]
    assert node.sdo[0x1200][1].raw == 0x600 + 42
    network.seen.clear()
    line.bench.post("axes/reference/power", {"action": "cycle"})
    assert network.seen.wait(0x700 + 42) == [b"\x00"], "stored"


def test_fastscan_finds_the_node_without_an_id(network, reference, line, monkeypatch):
    reference.write(0x2F00, 255)
    reference.write(0x1010, int.from_bytes(b"save", "little"), 1)
    words = identity(reference)
    line.bench.post("axes/reference/power", {"action": "cycle"})
    wait_for(lambda: line.bench.axis("reference")["node_id"] == 255, "no node id")
    # A bit is 1 if no answer comes, or if it comes too late: on a busy machine the scan needs a longer timeout.
    for answer_time in (0.1, 0.5, 2.0, 8.0):
        monkeypatch.setattr(LssMaster, "RESPONSE_TIMEOUT", answer_time)
        found, scanned = network.lss.fast_scan()
        if found:
            break
    assert found and list(scanned) == words
    monkeypatch.setattr(LssMaster, "RESPONSE_TIMEOUT", PATIENCE)
    network.seen.clear()
    network.lss.configure_node_id(5)
    network.lss.send_switch_state_global(network.lss.WAITING_STATE)
    assert network.seen.wait(0x705) == [b"\x00"]


def test_bit_timing(network, reference, patient):
    assert network.lss.send_switch_state_selective(*identity(reference))
    network.lss.configure_bit_timing(2)  # 500 kbit/s, after its activation
    with pytest.raises(LssError):
        network.lss.configure_bit_timing(99)
    network.lss.send_switch_state_global(network.lss.WAITING_STATE)
    assert reference.read(0x1000) == 0x00020192, "still at the old rate"


def test_ismc_knows_no_lss(network, ismc):
    words = [ismc.read(0x1018, sub) for sub in (1, 2, 3, 4)]
    with pytest.raises(LssError, match="No LSS response"):
        network.lss.send_switch_state_selective(*words)
    assert ismc.read(0x1000) == 0x00020192
