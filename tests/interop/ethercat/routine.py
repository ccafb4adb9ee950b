"""A controller's axis: PLCopen blocks for a drive in cyclic synchronous position, with a routine's data."""

from drive402 import CYCLIC_POSITION, HOMING
from line import wait_for

TURN = 4000  # counts; the factory setting of these drives
TOLERANCE = 12  # counts between the demand and the true shaft, because friction may hold the shaft there
CYCLE_NS = 4_000_000
NEGATIVE_LIMIT, POSITIVE_LIMIT, ORIGIN = 0, 1, 2  # bits of 60FDh


def ramp_to(speed, begin, acceleration, dt):
    """Yields the speed of each cycle from `begin` on; the last one is `speed`."""
    while begin != speed:
        step = acceleration * dt
        begin = min(speed, begin + step) if speed > begin else max(speed, begin - step)
        yield begin


def trapezoid(begin, end, speed, acceleration, deceleration, dt):
    """Yields the position of each cycle; the last one is `end`."""
    sign, left, now = (1 if end >= begin else -1), abs(end - begin), 0.0
    while left > 0:
        now = min(now + acceleration * dt, speed, (2 * deceleration * left) ** 0.5)
        left = max(0.0, left - max(now, deceleration * dt) * dt)
        yield end - sign * left


class Axis:
    def __init__(self, drive, routine):
        self.drive = drive
        self.master = drive.master
        self.routine = routine
        self.scale = routine["counts_per_unit"]
        self.dt = CYCLE_NS * 1e-9
        self.origin = 0.0  # 6064h at the controller's zero, in counts
        self.true_home = drive.true_position
        self.set_point = 0.0
        self.speed = 0.0  # counts/s, for a motion without a target
        self.positions = None  # for a motion with a target
        self.speeds = None
        self.master.each_cycle.insert(0, self.step)

    def step(self, _cycle):
        if self.positions:
            self.set_point = next(self.positions, self.set_point)
        else:
            self.speed = next(self.speeds, self.speed) if self.speeds else self.speed
            self.set_point += self.speed * self.dt
        if self.drive.values[0x6060, 0] == CYCLIC_POSITION:
            self.drive.values[0x607A, 0] = round(self.set_point)

    def idle(self):
        self.positions = self.speeds = None
        self.speed = 0.0

    def hold(self):
        """Makes the drive's present position the set-point."""
        self.idle()
        self.set_point = float(self.drive.position)
        self.master.pass_cycles(2)

    def input(self, bit):
        return bool(self.drive.get(0x60FD) >> bit & 1)

    def go_to(self, counts, velocity, acceleration, deceleration):
        scale = self.scale
        speeds = (velocity * scale, acceleration * scale, deceleration * scale)
        self.speed, self.positions = 0.0, trapezoid(self.set_point, counts, *speeds, self.dt)
        self.master.wait(lambda: abs(self.set_point - counts) < 0.5, "the end of the set-points")
        self.drive.wait_standstill()

    def run_at(self, velocity, acceleration):
        self.speeds = ramp_to(velocity * self.scale, self.speed, acceleration * self.scale, self.dt)
        self.positions = None

    # --- blocks
    def Ready(self):
        assert self.master.states()[self.drive.number] == (8, 0)
        self.drive.wait_state("Switch on disabled")

    def MC_Power(self):
        self.drive.set_mode(CYCLIC_POSITION)
        self.hold()
        self.drive.enable()

    def MC_Home(self):
        how = self.routine["homing"]
        (self.home_by_drive if how["by"] == "drive" else self.home_by_controller)(how)
        self.true_home = self.drive.true_position

    def home_by_drive(self, _how):
        drive = self.drive
        drive.set_mode(HOMING)
        drive.control(0x1F)
        drive.wait_bits(1 << 13 | 1 << 12 | 1 << 10, 1 << 12 | 1 << 10)
        drive.control(0x0F)
        drive.wait_standstill()
        assert abs(drive.position) <= TOLERANCE, drive.position
        self.hold()
        drive.set_mode(CYCLIC_POSITION)

    def home_by_controller(self, how):
        """Moves to the switch, then off it at creep speed; the origin is the place where the switch changes."""
        bit, direction = how["bit"], how["direction"]
        self.run_at(direction * how["speed"], how["acceleration"])
        self.master.wait(lambda: self.input(bit), "the switch")
        if bit in (0, 1):  # a limit switch: the drive stops the axis there, whatever the controller sends
            self.run_at(0.0, how["acceleration"])
            self.master.wait(lambda: self.speed == 0.0, "the end of the ramp")
            self.drive.wait_standstill()
            self.hold()
        else:
            self.MC_Stop(how["acceleration"])
        self.run_at(-direction * how["creep"], how["acceleration"])
        self.master.wait(lambda: not self.input(bit), "the switch to open")
        edge = self.drive.position
        self.MC_Stop(how["acceleration"])
        self.origin = float(edge)
        self.go_to(self.origin, how["creep"] * 4, how["acceleration"], how["acceleration"])

    def MC_MoveAbsolute(self, position, velocity, acceleration, deceleration):
        self.go_to(self.origin + position * self.scale, velocity, acceleration, deceleration)

    def MC_MoveRelative(self, distance, velocity, acceleration, deceleration):
        self.go_to(self.set_point + distance * self.scale, velocity, acceleration, deceleration)

    def MC_MoveVelocity(self, velocity, acceleration, turns):
        """Turns for some revolutions and checks the speed."""
        begin = self.drive.true_position
        self.run_at(velocity, acceleration)
        sign = 1 if velocity > 0 else -1
        self.master.wait(lambda: sign * (self.drive.true_position - begin) >= turns * TURN, "some turns")
        assert self.speed == velocity * self.scale

    def MC_Stop(self, deceleration):
        self.run_at(0.0, deceleration)
        self.master.wait(lambda: self.speed == 0.0, "the end of the ramp")
        self.drive.wait_standstill()
        position, word = self.drive.position, self.drive.statusword
        assert abs(position - self.set_point) <= TOLERANCE, f"{position}, {self.set_point} was asked for, 6041h {word:04X}h"

    def MC_Jog(self, direction, velocity, acceleration, deceleration, turns):
        self.MC_MoveVelocity(direction * velocity, acceleration, turns)
        self.MC_Stop(deceleration)

    def MC_Reset(self, fault):
        """Causes a fault, ends it and resets it; the axis must not have moved."""
        drive = self.drive
        drive.bench.post(f"axes/{drive.name}/faults", {"inject": fault})
        drive.wait_state("Fault")
        drive.bench.delete(f"axes/{drive.name}/faults")
        self.idle()
        drive.reset_fault()

    def run(self):
        for number, step in enumerate(self.routine["program"], 1):
            inputs = {key: value for key, value in step.items() if key not in ("block", "at")}
            getattr(self, step["block"])(**inputs)
            if step["block"] == "MC_Home":
                self.check_home()
            if "at" in step:
                turns = (self.drive.true_position - self.true_home) / TURN
                assert abs(turns - step["at"]) <= TOLERANCE / TURN, f"step {number}, {step['block']}: {turns} turns"
            wait_for(lambda: self.drive.state in ("Operation enabled", "Switch on disabled"), lambda: self.drive.state)

    def check_home(self):
        home = self.true_home / TURN
        assert abs(home - self.routine["home"]) <= 0.02, home
