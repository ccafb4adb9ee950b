"""Faults by injection: EMCY, error register, history, statusword, reset (CiA 301 7.2.7)."""

import pytest
from line import wait_for


def test_a_fault_is_told_kept_and_reset(drive, network):
    code = {"ismc": 0x4310, "reference": 0x4210}[drive.name]
    drive.write(0x1003, 0, 0)
    drive.enable()
    network.seen.clear()
    drive.bench.post(f"axes/{drive.name}/faults", {"inject": "stage_overheat"})
    assert network.seen.wait(0x080 + drive.node.id)[0][:2] == code.to_bytes(2, "little")
    emergency = wait_for(lambda: drive.node.emcy.active, "the client's own view of it")[0]
    assert emergency.code == code and emergency.register & 0x09 == 0x09, "generic and temperature"
    drive.wait_state("Fault")
    assert drive.read(0x603F) == code
    assert drive.read(0x1001) & 0x09 == 0x09
    assert drive.read(0x1003, 0) == 1
    assert drive.read(0x1003, 1) & 0xFFFF == code
    assert f"0x{code:04X}" in [fault["code"] for fault in drive.bench.axis(drive.name)["faults"]]

    drive.control(0x00)
    drive.control(0x80)
    network.settle(drive.node.id)
    assert drive.state == "Fault", "the cause is still there"

    network.seen.clear()
    drive.bench.delete(f"axes/{drive.name}/faults")
    drive.reset_fault()
    assert network.seen.wait(0x080 + drive.node.id)[-1][:3] == b"\x00\x00\x00", "error reset"
    assert drive.read(0x1001) == 0
    assert code in (drive.read(0x1003, sub) & 0xFFFF for sub in range(1, drive.read(0x1003, 0) + 1)), "history stays"
    drive.write(0x1003, 0, 0)
    assert drive.read(0x1003, 0) == 0
    drive.enable()


def test_supply_fails_while_enabled(drive, network):
    drive.enable()
    network.seen.clear()
    drive.bench.put(f"axes/{drive.name}/plant", {"supply_v": 50})
    assert network.seen.wait(0x080 + drive.node.id)[0][:2] == b"\x20\x32"
    drive.wait_state("Fault")
    assert drive.read(0x603F) == 0x3220
    drive.bench.put(f"axes/{drive.name}/plant", {"supply_v": 325})
    drive.reset_fault()
    drive.enable()
    wait_for(lambda: drive.bench.axis(drive.name)["supply_v"] > 300, "the DC link to charge")


def test_encoder_fault_by_injection(drive, network):
    drive.enable()
    drive.bench.post(f"axes/{drive.name}/faults", {"inject": "encoder_loss"})
    drive.wait_state("Fault")
    code = drive.read(0x603F)
    assert network.seen.wait(0x080 + drive.node.id)[0][:2] == code.to_bytes(2, "little")
    shown = drive.bench.get(f"axes/{drive.name}/faults")
    assert "encoder_loss" in shown["injected"]
    assert [fault["code"] for fault in shown["active"]] == [f"0x{code:04X}"]
    drive.bench.delete(f"axes/{drive.name}/faults")
    assert drive.bench.get(f"axes/{drive.name}/faults")["injected"] == []


def test_every_code_of_the_drive_can_be_injected_and_is_told(drive, network):
    """Each row of the drive's fault table: EMCY code and 603Fh have the row's code. A warning is not an error: 603Fh
    does
    not show it."""
    rows = drive.bench.get(f"axes/{drive.name}/faults")["injectable"]["drive"]
    assert len(rows) >= 25
    masked = {"0x8483", "0x8900"} if drive.name == "ismc" else set()  # by factory setting, by 2200h and 2017h
    warnings = {"0x6300"} if drive.name == "reference" else set()  # a full buffer 60C4h
    for code in sorted({row["code"] for row in rows} - masked):
        network.seen.clear()
        drive.bench.post(f"axes/{drive.name}/faults", {"inject": code})
        expected = int(code, 16).to_bytes(2, "little")
        wait_for(lambda: expected in [d[:2] for d in network.seen.data(0x080 + drive.node.id)], f"EMCY {code}")
        shown = 0 if code in warnings else int(code, 16)
        wait_for(lambda: drive.read(0x603F) == shown, f"603Fh {shown:04X}h")
        drive.bench.delete(f"axes/{drive.name}/faults")
        network.seen.clear()
        drive.bench.post(f"axes/{drive.name}/power", {"action": "cycle"})
        network.seen.wait(0x700 + drive.node.id)
        wait_for(lambda: drive.state == "Switch on disabled", f"a fresh drive after {code}")


def test_emergency_can_be_switched_off(drive, network):
    drive.write(0x1014, 0x80000080 + drive.node.id)
    network.seen.clear()
    drive.bench.post(f"axes/{drive.name}/faults", {"inject": "encoder_loss"})
    drive.wait_state("Fault")
    network.quiet()
    assert not network.seen.of(0x080 + drive.node.id)
    assert drive.read(0x1001) & 1, "the register and the history are kept all the same"
    assert drive.read(0x1003, 0) >= 1


@pytest.mark.parametrize("action", ["off", "cycle"])
def test_power_is_taken_away(drive, network, action):
    drive.enable()
    network.seen.clear()
    drive.bench.post(f"axes/{drive.name}/power", {"action": action})
    if action == "off":
        network.send(0x600 + drive.node.id, bytes.fromhex("4000100000000000"))
        network.quiet()
        assert not network.seen.of(0x580 + drive.node.id)
        drive.bench.post(f"axes/{drive.name}/power", {"action": "on"})
    network.seen.wait(0x700 + drive.node.id)
    assert drive.state == "Switch on disabled"
