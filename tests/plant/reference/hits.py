"""Hits on a hard stop, selected by the duration of the contact and by the rebound speed.

For a spring with a damper that does not pull, the duration of the contact and the rebound speed follow from the damping
ratio alone. The runs choose stiffness and damping for the required contact.
"""

import math

from runs import Hold, Run
from scipy.optimize import brentq
from state import TICK_S

HIT_TICKS = (0.3, 1.0, 5.0, 20.0)
RESTITUTIONS = (0.67, 0.3, 0.01)
SPEEDS_RAD_S = (10.0, 50.0, 200.0)
PHASES = (0.15, 0.5, 0.85)  # position within the tick at which the stop is met, one for each speed

ROTOR_KGM2 = 0.28e-4
RIGID_LOAD_KGM2 = 0.28e-4
ELASTIC_LOAD_KGM2 = 1.0e-4
RAD_PER_COUNT = 2.0 * math.pi / 131072


def contact_angle(ratio):
    """Returns the duration of the contact, times the natural frequency, until spring and damper together no longer
    push."""
    if ratio < 1.0:
        free = math.sqrt(1.0 - ratio * ratio)
        return (math.pi - math.atan2(2.0 * ratio * free, 1.0 - 2.0 * ratio * ratio)) / free
    free = math.sqrt(ratio * ratio - 1.0)
    return math.log((ratio + free) / (ratio - free)) / free


def restitution_of(ratio):
    return math.exp(-ratio * contact_angle(ratio))


def stop_for(inertia, contact_ticks, restitution):
    """Returns stiffness and damping of a stop for an inertia, a duration of contact and a share of rebound speed."""
    ratio = brentq(lambda x: restitution_of(x) - restitution, 1.0e-3, 20.0)
    frequency = contact_angle(ratio) / (contact_ticks * TICK_S)
    return {
        "load.stop_stiffness_nm_per_rad": inertia * frequency * frequency,
        "load.stop_damping_nms": 2.0 * ratio * frequency * inertia,
    }


def hits(contact_ticks, elastic):
    one = elastic_hit if elastic else rigid_hit
    speeds = list(zip(SPEEDS_RAD_S, PHASES))
    return [one(contact_ticks, restitution, *speed) for restitution in RESTITUTIONS for speed in speeds]


def rigid_hit(contact_ticks, restitution, speed, phase):
    inertia = ROTOR_KGM2 + RIGID_LOAD_KGM2
    changes = {"load.inertia_kgm2": RIGID_LOAD_KGM2, **stop_for(inertia, contact_ticks, restitution)}
    return hit(changes, inertia, speed, 60 + phase, contact_ticks)


def elastic_hit(contact_ticks, restitution, speed, phase):
    """The coupling (340 Hz, damped) comes to rest before the stop is met; only the load hits the stop."""
    changes = {
        "load.elastic": 1,
        "load.inertia_kgm2": ELASTIC_LOAD_KGM2,
        "load.stiffness_nm_per_rad": 100.0,
        "load.damping_nms": 0.03,
        **stop_for(ELASTIC_LOAD_KGM2, contact_ticks, restitution),
    }
    return hit(changes, ROTOR_KGM2 + ELASTIC_LOAD_KGM2, speed, 400 + phase, contact_ticks)


def hit(changes, inertia, speed, after_ticks, contact_ticks):
    """The shaft moves towards a stop and reaches it after this number of ticks."""
    distance = speed * TICK_S * after_ticks
    changes = changes | {"load.high_stop_counts": round(distance / RAD_PER_COUNT)}
    holds = [Hold(1, external_nm=-speed * inertia / TICK_S), Hold(math.ceil(after_ticks + 2.0 * contact_ticks) + 80)]
    return Run(changes, holds)


def fall():
    """A hanging load falls on a stop, rebounds, and comes to rest on it."""
    inertia = ROTOR_KGM2 + RIGID_LOAD_KGM2
    changes = {"load.inertia_kgm2": RIGID_LOAD_KGM2, "load.gravity_torque_nm": 0.3, "load.low_stop_counts": -2000}
    return [Run(changes | stop_for(inertia, 5.0, 0.3), [Hold(800)])]
