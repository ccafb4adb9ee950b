"""A CiA 402 drive over SDO, as a master uses it."""

import canopen

from line import wait_for

# 6041h, masked to the state (CiA 402-2 table 29)
STATES = {
    "Not ready to switch on": (0x4F, 0x00),
    "Switch on disabled": (0x4F, 0x40),
    "Ready to switch on": (0x6F, 0x21),
    "Switched on": (0x6F, 0x23),
    "Operation enabled": (0x6F, 0x27),
    "Quick stop active": (0x6F, 0x07),
    "Fault reaction active": (0x4F, 0x0F),
    "Fault": (0x4F, 0x08),
}
TARGET_REACHED = 1 << 10
BIT_12 = 1 << 12
BIT_13 = 1 << 13

PROFILE_POSITION, VELOCITY, PROFILE_VELOCITY, PROFILE_TORQUE = 1, 2, 3, 4
HOMING, INTERPOLATED_POSITION = 6, 7
CYCLIC_POSITION, CYCLIC_VELOCITY, CYCLIC_TORQUE = 8, 9, 10


class Drive402:
    def __init__(self, node, bench, name):
        self.node = node
        self.bench = bench
        self.name = name

    def _variable(self, index, sub):
        found = self.node.sdo[index]
        return found if isinstance(found, canopen.sdo.SdoVariable) else found[sub]

    def read(self, index, sub=0):
        return self._variable(index, sub).raw

    def write(self, index, value, sub=0):
        self._variable(index, sub).raw = value

    @property
    def statusword(self):
        return self.read(0x6041)

    @property
    def position(self):
        return self.read(0x6064)

    @property
    def true_position(self):
        return self.bench.true_position(self.name)

    @property
    def state(self):
        word = self.statusword
        found = [name for name, (mask, value) in STATES.items() if word & mask == value]
        assert len(found) == 1, f"statusword {word:04X}h"
        return found[0]

    def control(self, word):
        self.write(0x6040, word)

    def wait_state(self, state):
        wait_for(lambda: self.state == state, lambda: f"{state}, is {self.state} ({self.read(0x603F):04X}h)")

    def wait_bits(self, mask, value):
        wait_for(
            lambda: self.statusword & mask == value,
            lambda: f"statusword & {mask:04X}h == {value:04X}h, is {self.statusword:04X}h, {self.state}, "
            f"error {self.read(0x603F):04X}h, position {self.position}",
        )

    def set_mode(self, mode):
        self.write(0x6060, mode)
        wait_for(lambda: self.read(0x6061) == mode, f"mode {mode}")

    def enable(self):
        for word, state in ((0x06, "Ready to switch on"), (0x07, "Switched on"), (0x0F, "Operation enabled")):
            self.control(word)
            self.wait_state(state)

    def disable(self):
        self.control(0x00)
        self.wait_state("Switch on disabled")

    def reset_fault(self):
        """Repeats edges of the reset bit until the drive accepts one, because a cause may last for some time."""

        def left():
            self.control(0x00)
            self.control(0x80)
            return self.state != "Fault"

        wait_for(left, lambda: f"the fault {self.read(0x603F):04X}h to be reset")
        self.control(0x00)
        self.wait_state("Switch on disabled")

    def place(self, network, counts):
        """Turns the shaft to a true position from outside, while the drive has no power."""
        self.bench.post(f"axes/{self.name}/power", {"action": "off"})
        self.bench.put(f"axes/{self.name}/plant", {"position_counts": counts})
        network.seen.clear()
        self.bench.post(f"axes/{self.name}/power", {"action": "on"})
        network.seen.wait(0x700 + self.node.id)
        self.wait_state("Switch on disabled")

    def set_ramps(self, velocity=1_000_000, acceleration=5_000_000):
        self.write(0x6081, velocity)
        self.write(0x6083, acceleration)
        self.write(0x6084, acceleration)

    def wait_standstill(self):
        wait_for(lambda: not self.bench.axis(self.name)["in_motion"], "standstill")
        # Friction may hold the shaft for some milliseconds until the loops move it again. It is at rest if it does not
        # move for some time of the line.
        last, since = None, 0.0

        def rests():
            nonlocal last, since
            now, position = self.bench.get("clock")["time_ms"], self.true_position
            if position != last:
                last, since = position, now
            return now - since >= 300

        wait_for(rests, "the shaft at rest")

    def set_point(self, position, relative=False, immediately=False):
        """The handshake of CiA 402-2 10.2: new set-point, acknowledge, release."""
        word = 0x0F | (0x40 if relative else 0) | (0x20 if immediately else 0)
        self.control(word)
        self.wait_bits(BIT_12, 0)
        self.write(0x607A, position)
        self.control(word | 0x10)
        self.wait_bits(BIT_12, BIT_12)
        self.control(word)
        self.wait_bits(BIT_12, 0)

    def move_to(self, position, relative=False):
        self.set_point(position, relative)
        self.wait_bits(TARGET_REACHED, TARGET_REACHED)
        self.wait_standstill()

    def home(self, method, fast=500_000, slow=50_000, acceleration=5_000_000):
        self.set_mode(HOMING)
        self.write(0x6098, method)
        self.write(0x6099, fast, 1)
        self.write(0x6099, slow, 2)
        self.write(0x609A, acceleration)
        if self.state != "Operation enabled":
            self.enable()
        self.control(0x0F)
        self.control(0x1F)
        self.wait_bits(BIT_12 | BIT_13 | TARGET_REACHED, BIT_12 | TARGET_REACHED)
        self.control(0x0F)
        self.wait_standstill()
