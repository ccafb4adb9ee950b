"""A motion in every mode of operation: checks the final position of the drive and of the true shaft."""

import struct

import pytest
from canopen import SdoAbortedError
from drive402 import (
    BIT_12,
    CYCLIC_POSITION,
    CYCLIC_TORQUE,
    CYCLIC_VELOCITY,
    INTERPOLATED_POSITION,
    PROFILE_POSITION,
    PROFILE_TORQUE,
    PROFILE_VELOCITY,
    TARGET_REACHED,
    VELOCITY,
)
from line import COUNTS, LIMITS, wait_for

CLOSE = 8  # counts: the errors of the drive's encoder (20 arc seconds and more) and of its control


def turning_at(drive, speed_rpm, tolerance=0.02):
    def near():
        return abs(drive.bench.axis(drive.name)["velocity_rpm"] - speed_rpm) <= abs(speed_rpm) * tolerance + 1

    wait_for(near, lambda: f"{speed_rpm} rpm, is {drive.bench.axis(drive.name)['velocity_rpm']}")


def test_profile_position(drive):
    drive.set_mode(PROFILE_POSITION)
    drive.set_ramps()
    drive.enable()
    start, true_start = drive.position, drive.true_position
    for target in (100_000, -262_144, 0):
        drive.move_to(start + target)
        assert abs(drive.position - (start + target)) <= CLOSE
        assert abs(drive.true_position - (true_start + target)) <= CLOSE
    for _ in range(10):
        drive.move_to(10_000, relative=True)
    assert abs(drive.true_position - (true_start + 100_000)) <= CLOSE, "relative moves do not drift"


def test_profile_position_queue_and_change_immediately(drive):
    drive.set_mode(PROFILE_POSITION)
    drive.set_ramps(velocity=200_000)
    drive.enable()
    start, true_start = drive.position, drive.true_position
    drive.set_point(start + 300_000)
    drive.set_point(start + 100_000)  # after the first
    drive.set_point(start + 50_000, immediately=True)  # instead of both
    drive.wait_bits(TARGET_REACHED, TARGET_REACHED)
    drive.wait_standstill()
    assert abs(drive.true_position - (true_start + 50_000)) <= CLOSE


def test_profile_position_halt(drive):
    drive.set_mode(PROFILE_POSITION)
    drive.set_ramps(velocity=50_000)
    drive.enable()
    true_start = drive.true_position
    drive.set_point(drive.position + 10 * COUNTS)
    wait_for(lambda: drive.true_position > true_start + 1000, "motion")
    drive.control(0x10F)
    drive.wait_bits(TARGET_REACHED, TARGET_REACHED)
    drive.wait_standstill()
    assert drive.state == "Operation enabled"
    assert drive.true_position < true_start + 10 * COUNTS - COUNTS


def test_profile_velocity(drive):
    drive.set_mode(PROFILE_VELOCITY)
    drive.set_ramps()
    drive.enable()
    for revolutions_per_second in (0.5, -0.5):
        drive.write(0x60FF, int(revolutions_per_second * COUNTS))
        drive.wait_bits(TARGET_REACHED, TARGET_REACHED)
        turning_at(drive, revolutions_per_second * 60)
    drive.write(0x60FF, 0)
    drive.wait_bits(TARGET_REACHED | BIT_12, TARGET_REACHED | BIT_12)
    drive.wait_standstill()


def test_profile_torque_turns_the_free_shaft(drive):
    """10 % of the rated torque: the shaft accelerates in the direction of the torque; no torque remains after disable.

    In torque mode the ISMC's speed limit reduces the torque long before the limit switch (which would be a fault
    there).
    """
    drive.set_mode(PROFILE_TORQUE)
    drive.write(0x6087, 1000)
    if drive.name == "ismc":
        drive.write(0x2115, 30)
        drive.write(0x2116, 30)
    drive.enable()
    true_start = drive.true_position
    drive.write(0x6071, 100)
    if drive.name == "ismc":
        turning_at(drive, 90)
    else:
        wait_for(lambda: drive.read(0x6074) == 100, "torque demand 10 %")
    drive.wait_bits(TARGET_REACHED, TARGET_REACHED)
    wait_for(lambda: drive.true_position > true_start + 1000, "motion in positive direction")
    drive.disable()
    wait_for(lambda: abs(drive.bench.axis(drive.name)["current_a"]) < 0.01, "no current after disable")


def test_profile_torque_against_a_locked_rotor(drive):
    drive.bench.put(f"axes/{drive.name}/plant", {"locked_rotor": True})
    drive.set_mode(PROFILE_TORQUE)
    drive.write(0x6087, 10_000)
    drive.enable()
    rated = None
    for target in (200, -300):
        drive.write(0x6071, target)
        wait_for(lambda: drive.read(0x6074) == target, "torque demand")
        drive.wait_bits(TARGET_REACHED, TARGET_REACHED)
        wait_for(lambda: abs(drive.read(0x6077) - target) <= 5, f"actual torque {target}")
        torque = drive.bench.axis(drive.name)["torque_nm"] / target
        assert rated is None or abs(torque / rated - 1) < 0.05
        rated = torque
    assert rated > 0


def test_velocity_mode(reference):
    reference.set_mode(VELOCITY)
    reference.enable()
    reference.control(0x7F)  # ramp enabled, unlocked, reference on
    for rpm in (30, -30):
        reference.write(0x6042, rpm)
        turning_at(reference, rpm)
        wait_for(lambda: abs(reference.read(0x6044) - rpm) <= 1, f"vl control effort {rpm}")
        assert reference.read(0x6043) == rpm
    reference.control(0x3F)  # reference input off: to zero
    reference.wait_standstill()


def cyclic(drive, network, mode, mapping):
    """Maps `mapping` to PDO 1 with SYNC, TPDO 1 returns the actual values; operational and enabled in the mode."""
    node = drive.node
    node.rpdo.read()
    node.tpdo.read()
    for pdo, entries in ((node.rpdo[1], ["Controlword", *mapping]), (node.tpdo[1], ["Statusword", "Position actual value"])):
        pdo.clear()
        for name in entries:
            pdo.add_variable(name)
        pdo.trans_type = 1
        pdo.enabled = True
        pdo.save()
    drive.set_mode(mode)
    node.nmt.state = "OPERATIONAL"
    network.settle(node.id)
    drive.enable()


def test_cyclic_synchronous_position(drive, network):
    cyclic(drive, network, CYCLIC_POSITION, [0x607A])
    drive.write(0x60C2, 4, 1)
    start, true_start = drive.position, drive.true_position
    target = start
    network.seen.clear()
    for step in range(1, 251):
        target = start + 2 * step * step
        network.send(drive.node.rpdo[1].cob_id, struct.pack("<Hi", 0x0F, target))
        network.send_sync()
        network.settle(drive.node.id)
    drive.wait_standstill()
    assert drive.statusword & BIT_12
    assert abs(drive.position - target) <= CLOSE
    assert abs(drive.true_position - (true_start + target - start)) <= CLOSE
    assert len(network.seen.of(drive.node.tpdo[1].cob_id)) == 250


def test_cyclic_synchronous_velocity(reference, network):
    cyclic(reference, network, CYCLIC_VELOCITY, [0x60FF])
    for velocity in (COUNTS // 2, -COUNTS // 2):
        network.send(reference.node.rpdo[1].cob_id, struct.pack("<Hi", 0x0F, velocity))
        network.send_sync()
        turning_at(reference, velocity / COUNTS * 60)
    network.send(reference.node.rpdo[1].cob_id, struct.pack("<Hi", 0x0F, 0))
    network.send_sync()
    reference.wait_standstill()


def test_cyclic_synchronous_torque(reference, network):
    reference.bench.put("axes/reference/plant", {"locked_rotor": True})
    cyclic(reference, network, CYCLIC_TORQUE, [0x6071])
    for torque in (250, -250):
        network.send(reference.node.rpdo[1].cob_id, struct.pack("<Hh", 0x0F, torque))
        network.send_sync()
        wait_for(lambda: abs(reference.read(0x6077) - torque) <= 5, f"torque {torque}")
        assert reference.bench.axis("reference")["torque_nm"] * torque > 0


def test_interpolated_position(reference, network):
    reference.set_mode(INTERPOLATED_POSITION)
    reference.write(0x60C2, 20, 1)
    reference.write(0x60C4, 64, 2)
    reference.enable()
    start, true_start = reference.position, reference.true_position
    for point in range(1, 41):
        reference.write(0x60C1, start + 1000 * point, 1)
    assert abs(reference.position - start) <= CLOSE, "not before the mode is enabled"
    reference.control(0x1F)
    reference.wait_bits(BIT_12 | TARGET_REACHED, BIT_12 | TARGET_REACHED)
    reference.wait_standstill()
    assert abs(reference.position - (start + 40_000)) <= CLOSE
    assert abs(reference.true_position - (true_start + 40_000)) <= CLOSE


def test_modes_a_product_does_not_have(ismc, reference):
    for mode in (2, 7, 9, 10):
        with pytest.raises(SdoAbortedError) as refusal:
            ismc.write(0x6060, mode)
        assert refusal.value.code == 0x06090030
    assert ismc.read(0x6502) == 0xAD
    assert reference.read(0x6502) == 0x3EF


def test_quick_stop(drive):
    drive.set_mode(PROFILE_POSITION)
    drive.set_ramps(velocity=100_000)
    drive.enable()
    drive.write(0x605A, 6)  # ramp, then stay
    true_start = drive.true_position
    drive.set_point(drive.position - 8 * COUNTS)
    wait_for(lambda: drive.true_position < true_start - 1000, "motion")
    drive.control(0x02)
    drive.wait_state("Quick stop active")
    drive.wait_standstill()
    assert drive.true_position > LIMITS[0]
    drive.control(0x00)
    drive.wait_state("Switch on disabled")


def test_a_limit_switch_is_seen_when_the_axis_is_on_it(drive):
    drive.bench.put(f"axes/{drive.name}/plant", {"position_counts": LIMITS[1] + 10})
    wait_for(lambda: drive.read(0x60FD) & 0b111 == 0b010, "positive limit")
    drive.bench.put(f"axes/{drive.name}/plant", {"position_counts": 0})
    wait_for(lambda: drive.read(0x60FD) & 0b111 == 0b100, "home")
    drive.bench.put(f"axes/{drive.name}/inputs", {"DI0": True})
    wait_for(lambda: drive.read(0x60FD) & 0b111 == 0b101, "forced input")
    drive.bench.put(f"axes/{drive.name}/inputs", {"DI0": None})
    wait_for(lambda: drive.read(0x60FD) & 0b111 == 0b100, "given back")


def test_touch_probe_latches_the_index(drive):
    drive.set_mode(PROFILE_POSITION)
    drive.set_ramps(velocity=100_000)
    drive.enable()
    start, true_start = drive.position, drive.true_position
    drive.move_to(start + COUNTS // 4)
    drive.write(0x60B8, 0x15)  # enable, index, rising edge
    wait_for(lambda: drive.read(0x60B9) & 1, "the probe to be on")
    drive.move_to(start + COUNTS + COUNTS // 2)
    assert drive.read(0x60B9) & 3 == 3
    latched = drive.read(0x60BA) + true_start - start
    # The drive latches the position of its encoder, which has errors of some arc seconds.
    assert (latched + 5) % COUNTS <= 10, "the index is once per revolution, at 0"
