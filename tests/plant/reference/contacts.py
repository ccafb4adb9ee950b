"""Springs with dampers that push and never pull: the two flanks of a coupling with play, and the hard stops.

A contact begins where the bodies meet, and ends when the sum of spring and damper no longer pushes; with a damper this
is before the spring has relaxed.
"""

from state import ANGLE, LOAD_ANGLE, LOAD_SPEED, SPEED, Event


class Contacts:
    """Two contacts of which at most one is active, at side +1 or -1; `depth(angle, side)` is the compression of the
    spring."""

    name = ""

    def __init__(self, stiffness, damping, sides):
        self.stiffness = stiffness
        self.damping = damping
        self.sides = sides
        self.touching = 0

    def push_nm(self, rate, angle, side):
        return self.stiffness * self.depth(angle, side) + self.damping * side * rate

    def torque_nm(self, rate, angle):
        return self.touching * self.push_nm(rate, angle, self.touching) if self.touching != 0 else 0.0

    def events(self):
        if self.touching == 0:
            return [self.closing(side) for side in self.sides]
        side = self.touching
        return [Event(lambda s: self.push_nm(*self.rate_and_angle(s), side), self.touch(0), f"{self.name} opens")]

    def closing(self, side):
        def gap(state):
            rate, angle = self.rate_and_angle(state)
            return -min(self.depth(angle, side), self.push_nm(rate, angle, side))

        return Event(gap, self.touch(side), f"{self.name} closes")

    def touch(self, side):
        return lambda _: setattr(self, "touching", side)

    def stored_j(self, angle):
        deepest = max((self.depth(angle, side) for side in self.sides), default=0.0)
        return 0.5 * self.stiffness * max(deepest, 0.0) ** 2


class Flanks(Contacts):
    """The contact between rotor and load, by the twist. Without backlash it is one spring that also pulls."""

    name = "flank"

    def __init__(self, p):
        self.half_play = 0.5 * p["load.backlash_rad"]
        super().__init__(p["load.stiffness_nm_per_rad"], p["load.damping_nms"], (1, -1))
        if self.half_play == 0.0:
            self.touching = 1

    def depth(self, twist, side):
        return side * twist - self.half_play

    def rate_and_angle(self, state):
        return state[SPEED] - state[LOAD_SPEED], state[ANGLE] - state[LOAD_ANGLE]

    def events(self):
        return super().events() if self.half_play > 0.0 else []


class Stops(Contacts):
    name = "stop"

    def __init__(self, p, rad_per_count):
        names = {1: "load.high_stop_counts", -1: "load.low_stop_counts"}
        self.places = {side: p[name] * rad_per_count for side, name in names.items() if name in p}
        super().__init__(p["load.stop_stiffness_nm_per_rad"], p["load.stop_damping_nms"], tuple(self.places))

    def depth(self, angle, side):
        return side * (angle - self.places[side])

    def rate_and_angle(self, state):
        return state[LOAD_SPEED], state[LOAD_ANGLE]
