"""The state of the machine as one vector, and the events at which its equations change."""

import numpy

TICKS_PER_SECOND = 16000
TICK_S = 1.0 / TICKS_PER_SECOND

# With a rigid load its speed and angle are the rotor's. After the temperatures come energies: sums since the start.
DIRECT, QUADRATURE, SPEED, ANGLE, LOAD_SPEED, LOAD_ANGLE, LINK, WINDING, CASE, STAGE = range(10)
IMPULSE, TO_MOTOR, COPPER, WORK, SUPPLIED, CHOPPED, STANDBY, STAGE_LOSS = range(10, 18)
STATES = 18

# The tolerances of a step. For angles, a relative tolerance would be too large because stops are stiff.
TOLERANCES = numpy.full(STATES, 1.0e-9)
TOLERANCES[[ANGLE, LOAD_ANGLE]] = 1.0e-10
TOLERANCES[IMPULSE:] = 1.0e-11
RELATIVE_TOLERANCES = numpy.full(STATES, 1.0e-9)
RELATIVE_TOLERANCES[[ANGLE, LOAD_ANGLE]] = 1.0e-13


class Event:
    """A function of the state whose zero crossing (falling) ends a mode, and the change of the state at that time."""

    terminal = True
    direction = -1.0

    def __init__(self, function, then, name=""):
        self.function = function
        self.then = then
        self.name = name

    def __call__(self, _, state):
        return self.function(state)


def sign(value):
    return int(value > 0.0) - int(value < 0.0)
