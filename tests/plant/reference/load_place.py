"""The position-dependent parts of the load: weight and inertia in the cycle of an arm or crank, stiffness along a
belt."""

import math


class LoadPlace:
    def __init__(self, p):
        self.p = p
        self.rad_per_rad = 1.0 / p["load.cycle_revolutions"]  # of the cycle, by the motor's angle
        self.begin = 2.0 * math.pi * p["load.cycle_offset_turns"]
        self.length = 2.0 * math.pi * p["load.belt_length_revolutions"]
        self.middle = 2.0 * math.pi * p["load.belt_middle_revolutions"]

    def cycle(self, angle):
        return self.begin + self.rad_per_rad * angle

    def slide(self, angle):
        """Returns the position of the slider by the angle of the crank, in radii: the rod adds a second harmonic."""
        a = self.cycle(angle)
        return math.sin(a) + 0.5 * self.p["load.crank_ratio"] * math.sin(2.0 * a)

    def weight_nm(self, angle):
        arm_nm, crank_nm = self.p["load.arm_torque_nm"], self.p["load.crank_torque_nm"]
        return arm_nm * math.cos(self.cycle(angle)) + crank_nm * self.slide(angle)

    def inertia(self, angle):
        return self.p["load.inertia_kgm2"] + self.p["load.crank_inertia_kgm2"] * self.slide(angle) ** 2

    def inertia_slope(self, angle):
        a = self.cycle(angle)
        slide_slope = (math.cos(a) + self.p["load.crank_ratio"] * math.cos(2.0 * a)) * self.rad_per_rad
        return 2.0 * self.p["load.crank_inertia_kgm2"] * self.slide(angle) * slide_slope

    def stiffness(self, angle):
        """Returns the stiffness of both spans together; the stiffness of a span is inversely proportional to its
        length."""
        middle = self.p["load.stiffness_nm_per_rad"]
        if self.length == 0.0:
            return middle
        one = 0.5 * self.length + angle - self.middle
        other = self.length - one
        return 0.25 * middle * self.length * (1.0 / one + 1.0 / other)

    def stiffness_slope(self, angle):
        if self.length == 0.0:
            return 0.0
        one = 0.5 * self.length + angle - self.middle
        other = self.length - one
        return 0.25 * self.p["load.stiffness_nm_per_rad"] * self.length * (1.0 / other**2 - 1.0 / one**2)
