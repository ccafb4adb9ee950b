"""Dry friction of the rotor, of the load, or of both as one shaft: it slides, or it stands and holds."""

import math

from state import sign


class Mass:
    def __init__(self, place, clamped=False):
        self.place = place  # index of its speed in the state
        self.clamped = clamped  # held by the bench: it stands with any torque
        self.stands = clamped
        self.direction = 0
        self.sliding_nm = 0.0
        self.static_nm = 0.0
        self.stribeck_nm = 0.0  # additional sliding friction at standstill
        self.stribeck_rad_s = 1.0

    def settle(self, speed, torque_nm):
        """Returns the mode for this speed and for the torque of all other parts."""
        holds = speed == 0.0 and 0.0 < self.static_nm >= abs(torque_nm)
        self.stands = self.clamped or holds
        self.direction = 0 if self.stands else sign(speed) or sign(torque_nm)

    def break_away(self, torque_nm):
        self.stands = False
        self.direction = sign(torque_nm)

    def acceleration(self, torque_nm, inertia, speed):
        if self.stands:
            return 0.0
        sliding_nm = self.sliding_nm
        if self.stribeck_nm > 0.0:
            sliding_nm += self.stribeck_nm * math.exp(-((speed / self.stribeck_rad_s) ** 2))
        return (torque_nm - self.direction * sliding_nm) / inertia
