"""The differences between two traces of a run: the compared quantity, and the value that is 100 %.

A measure takes the run and the traces of reference and plant. It returns both values and the error in percent.
"""

import math

import numpy
from state import TICK_S


def course(*columns, change=False, peak=None, at=None):
    """The greatest difference at any tick, in percent of the greatest value. Several columns are compared as vectors.

    change: of the values since the start. peak: another value to take the percentage of. at: these ticks only.
    """

    def measure(_, reference, plant):
        ours, theirs = (numpy.array([trace[name] for name in columns]) for trace in (reference, plant))
        if change:
            ours, theirs = ours - ours[:, :1], theirs - theirs[:, :1]
        most = peak or numpy.linalg.norm(ours, axis=0).max()
        if at is not None:
            ours, theirs = ours[:, at], theirs[:, at]
        differences = numpy.linalg.norm(ours - theirs, axis=0)
        worst = differences.argmax()
        values = (v[0, worst] if len(columns) == 1 else numpy.linalg.norm(v[:, worst]) for v in (ours, theirs))
        return *values, 100.0 * differences[worst] / most

    return measure


def ratio(value):
    """Compares one value, which `value` takes from the run and a trace; in percent of the reference's value."""

    def measure(run, reference, plant):
        ours, theirs = value(run, reference), value(run, plant)
        return ours, theirs, 100.0 * abs(theirs / ours - 1.0)

    return measure


def mean(column, ticks):
    return ratio(lambda _, trace: trace[column][ticks.start + 1 : ticks.stop + 1].mean())


def sunk():
    """The depth of the load in the lower stop at the end."""
    return ratio(lambda run, trace: run.parameters["load.low_stop_counts"] - trace["load_position_counts"][-1])


def given_j(trace, ticks):
    return trace["to_motor_j"][ticks.start] - trace["to_motor_j"][ticks.stop]


def link_energy(ticks):
    """The energy from the motor to the DC link."""
    return ratio(lambda _, trace: given_j(trace, ticks))


def link_current(ticks):
    return ratio(lambda _, t: given_j(t, ticks) / (t["dc_link_v"][ticks].mean() * len(ticks) * TICK_S))


# A hit on a hard stop, from the last tick before the contact to one after its end, by the times of the reference.


def of_hit(value):
    def measure(run, reference, plant):
        before = math.floor(reference.tick_of("stop closes"))
        after = math.ceil(reference.tick_of("stop opens")) + 1
        return value(run, reference, before, after), value(run, plant, before, after)

    return measure


@of_hit
def rebound(_, trace, before, after):
    return -trace["load_velocity_rpm"][after] / trace["load_velocity_rpm"][before]


@of_hit
def momentum_nms(run, trace, before, after):
    p = run.parameters
    rpm = p["motor.rotor_inertia_kgm2"] * trace["velocity_rpm"] + p["load.inertia_kgm2"] * trace["load_velocity_rpm"]
    return (rpm[before] - rpm[after]) * math.pi / 30.0


@of_hit
def lost_share(_, trace, before, after):
    energy = trace["kinetic_j"] + trace["elastic_j"]
    return (energy[before] - energy[after]) / energy[before]


def restitution(run, reference, plant):
    """In percent of the speed of approach."""
    ours, theirs = rebound(run, reference, plant)
    return ours, theirs, 100.0 * abs(theirs - ours)


def impulse(run, reference, plant):
    """The energy that the stop has absorbed from both masses."""
    ours, theirs = momentum_nms(run, reference, plant)
    return ours, theirs, 100.0 * abs(theirs / ours - 1.0)


def energy_lost(run, reference, plant):
    """As a share of the energy of approach; the error is in percent of that energy."""
    ours, theirs = lost_share(run, reference, plant)
    return ours, theirs, 100.0 * abs(theirs - ours)
