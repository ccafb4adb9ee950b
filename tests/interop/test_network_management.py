"""NMT, boot-up, heartbeat, node and life guarding, heartbeat consumer (CiA 301 7.2.8)."""

import pytest
from line import wait_for

PRE_OPERATIONAL, OPERATIONAL, STOPPED = 0x7F, 0x05, 0x04
NODES = {"ismc": 1, "reference": 2}


def test_both_nodes_boot_up_after_power_on(line, network):
    for name, node_id in NODES.items():
        network.seen.clear()
        line.bench.post(f"axes/{name}/power", {"action": "cycle"})
        assert network.seen.wait(0x700 + node_id) == [b"\x00"]


@pytest.mark.parametrize("command", [0x81, 0x82], ids=["reset_node", "reset_communication"])
def test_nmt_reset_ends_in_boot_up_and_pre_operational(drive, network, command):
    network.settle(drive.node.id)
    network.seen.clear()
    network.send(0x000, [command, drive.node.id])
    assert network.seen.wait(0x700 + drive.node.id) == [b"\x00"]
    assert drive.read(0x1000) == 0x00020192
    assert drive.bench.axis(drive.name)["nmt_state"] == "pre_operational"


def test_reset_of_all_nodes_by_node_0(network, ismc, reference):
    network.nmt.send_command(0x81)
    for node_id in NODES.values():
        assert network.seen.wait(0x700 + node_id) == [b"\x00"]


def test_states_as_the_heartbeat_tells_them(drive, network):
    drive.write(0x1017, 20)
    for command, state in ((0x01, OPERATIONAL), (0x80, PRE_OPERATIONAL), (0x02, STOPPED), (0x01, OPERATIONAL)):
        network.send(0x000, [command, drive.node.id])
        wait_for(lambda: network.seen.data(0x700 + drive.node.id)[-1:] == [bytes([state])], f"heartbeat {state:02X}h")
    drive.node.nmt.wait_for_heartbeat(timeout=30)
    assert drive.node.nmt.state == "OPERATIONAL"
    drive.write(0x1017, 0)
    network.seen.clear()
    network.quiet()
    assert not network.seen.of(0x700 + drive.node.id)


def test_a_stopped_node_answers_no_sdo(drive, network):
    network.send(0x000, [0x02, drive.node.id])
    wait_for(lambda: drive.bench.axis(drive.name)["nmt_state"] == "stopped", "stopped")
    network.seen.clear()
    network.send(0x600 + drive.node.id, bytes.fromhex("4000100000000000"))
    network.quiet()
    assert not network.seen.of(0x580 + drive.node.id)
    network.send(0x000, [0x80, drive.node.id])
    assert drive.read(0x1000) == 0x00020192


def test_commands_to_another_node_do_nothing(drive, network):
    network.send(0x000, [0x01, 100])
    network.settle(drive.node.id)
    assert drive.bench.axis(drive.name)["nmt_state"] == "pre_operational"


@pytest.mark.remote_frames
def test_node_guarding_toggles(drive, network):
    identifier = 0x700 + drive.node.id

    def answers():
        return [bytes(frame.data) for frame in network.seen.of(identifier) if not frame.is_remote_frame]

    network.settle(drive.node.id)  # its boot-up message may come after this master's start
    network.seen.clear()
    expected = []
    for state in (0x7F, 0xFF, 0x7F):
        expected.append(bytes([state]))
        network.send(identifier, remote=True)
        wait_for(lambda: len(answers()) >= len(expected), "an answer to guarding")
        assert answers() == expected
    network.send(0x000, [0x01, drive.node.id])
    network.send(identifier, remote=True)
    wait_for(lambda: len(answers()) == 4, "an answer to guarding")
    assert answers()[-1] == b"\x85", "operational, toggled"


@pytest.mark.remote_frames
def test_life_guarding_raises_8130h_when_the_master_is_silent(drive, network):
    drive.write(0x100C, 100)
    drive.write(0x100D, 2)
    network.seen.clear()
    network.quiet(0.5)
    assert not network.seen.of(0x080 + drive.node.id), "guarding starts with the first request only"
    network.send(0x000, [0x01, drive.node.id])
    network.send(0x700 + drive.node.id, remote=True)
    emergency = network.seen.wait(0x080 + drive.node.id)[0]
    assert emergency[:2] == b"\x30\x81"
    assert emergency[2] & 0x11 == 0x11, "error register: generic and communication"
    assert drive.bench.axis(drive.name)["nmt_state"] == "pre_operational", "1029h sub 1 = 0"


def test_heartbeat_consumer_raises_8130h_when_the_producer_is_silent(drive, network):
    drive.write(0x1016, 0x007E0064, 1)  # node 126, 100 ms
    network.seen.clear()
    network.quiet(0.3)
    assert not network.seen.of(0x080 + drive.node.id), "watched from the first heartbeat on"
    network.send(0x77E, [0x05])
    assert network.seen.wait(0x080 + drive.node.id)[0][:2] == b"\x30\x81"
