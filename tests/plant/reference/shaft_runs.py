"""Runs about friction, coupling, backlash and brake; the machine's currents follow from fixed voltages."""

import math

from electric_runs import OHM, vector
from runs import Hold, Run

ROTOR_KGM2 = 0.28e-4


def spin_down():
    inertia = ROTOR_KGM2 + 0.28e-4
    changes = {"load.inertia_kgm2": 0.28e-4, "load.viscous_friction_nms": 1.0e-3}
    return [Run(changes, [Hold(1, external_nm=-100.0 * inertia * 16000), Hold(2400)])]


def stiff_viscous(elastic):
    """A bearing that stops the rotor alone within a tick or two: the stator's field pulls it slowly."""
    changes = {"motor.viscous_friction_nms": 2.0, "load.inertia_kgm2": 1.0e-4}
    if elastic:
        changes |= TWO_MASSES
    angles = (1.57, 2.6, 2.0, 3.1)
    return [Run(changes, [Hold(250, vector(OHM * 6.0, angle), pwm=True) for angle in angles])]


def coulomb_stop():
    changes = {"load.inertia_kgm2": 0.28e-4, "load.coulomb_friction_nm": 0.1, "load.static_friction_nm": 0.15}
    return [Run(changes, [Hold(1, external_nm=-torque), Hold(1600)]) for torque in (40.0, 41.0, 100.0)]


def breakaway():
    """Held below the static torque, released above it, kept moving by less torque, and stopped."""
    changes = {"load.inertia_kgm2": 0.28e-4, "load.coulomb_friction_nm": 0.1, "load.static_friction_nm": 0.15}
    torques = (0.149, -0.149, -0.151, -0.12, 0.0, 0.0, 0.149, 0.151)
    return [Run(changes, [Hold(100, external_nm=torque) for torque in torques])]


def brake():
    """A hanging load is released, falls, and is stopped again."""
    changes = {"load.inertia_kgm2": 5.0e-4, "load.gravity_torque_nm": 0.5, "motor.brake_torque_nm": 2.0}
    holds = [Hold(100, brake_released=False), Hold(1000), Hold(800, brake_released=False)]
    return [Run(changes, holds)]


TWO_MASSES = {
    "load.elastic": 1,
    "load.inertia_kgm2": 1.0e-4,
    "load.stiffness_nm_per_rad": 100.0,  # 340 Hz with both masses free
    "load.damping_nms": 0.002,
}


def ring_down():
    return [Run(TWO_MASSES, [Hold(1, external_nm=-100.0), Hold(1000)])]


def elastic_driven():
    """The stator's field is turned in steps; the rotor oscillates into each step, with the load behind it."""
    angles = (1.57, 2.6, 2.0, 3.1)
    return [Run(TWO_MASSES, [Hold(250, vector(OHM * 6.0, angle), pwm=True) for angle in angles])]


def stick_slip():
    """The rotor follows a slow field and twists a soft coupling until the load breaks loose, repeatedly."""
    changes = TWO_MASSES | {
        "load.stiffness_nm_per_rad": 5.0,
        "load.coulomb_friction_nm": 0.05,
        "load.static_friction_nm": 0.15,
    }
    step_ticks, steps, rad_per_step = 20, 100, 0.0125
    return [Run(changes, [Hold(step_ticks, vector(OHM * 8.0, rad_per_step * n), pwm=True) for n in range(steps)])]


REVERSAL_TICKS = 320
REVERSALS = 10
REVERSED_AT = [REVERSAL_TICKS * (half + 1) for half in range(REVERSALS + 1)]


def play(load_kgm2, damping):
    """The motor reverses its torque, and each time the rotor crosses the backlash before the load follows. A weak motor
    with one pole pair has nearly the same torque at all speeds and angles of the run: 0.1 Nm."""
    changes = {
        "motor.pole_pairs": 1,
        "motor.torque_constant_nm_per_a": 0.05,
        "load.elastic": 1,
        "load.inertia_kgm2": load_kgm2,
        "load.stiffness_nm_per_rad": 500.0,
        "load.damping_nms": damping,
        "load.backlash_rad": 0.01,
    }
    current_a = 0.1 / 0.05 * math.sqrt(2.0)
    holds = []
    for half in range(REVERSALS + 1):
        amplitude = (0.5 if half == 0 else 1.0) * OHM * current_a * (-1) ** half
        holds.append(Hold(REVERSAL_TICKS, vector(amplitude, 0.5 * math.pi), pwm=True))
    return [Run(changes, holds, longest_step_ticks=1.0)]


# --- Loads that depend on their place or speed.


def arm():
    """An arm behind a gear breaks loose, oscillates, and comes to rest where friction holds it again."""
    changes = {
        "load.inertia_kgm2": 5.0e-4,
        "load.cycle_revolutions": 2.0,
        "load.arm_torque_nm": 0.5,
        "load.coulomb_friction_nm": 0.03,
        "load.static_friction_nm": 0.05,
        "encoder.start_position_counts": 40000,
    }
    return [Run(changes, [Hold(100, external_nm=-0.3), Hold(2400)])]


def crank(elastic):
    """A slider with weight, driven by the energy of its own flywheel."""
    changes = {
        "load.inertia_kgm2": 2.0e-4,
        "load.crank_inertia_kgm2": 4.0e-4,
        "load.crank_torque_nm": 0.1,
        "load.crank_ratio": 0.3,
        "load.cycle_offset_turns": 0.1,
    }
    if elastic:
        changes |= {"load.elastic": 1, "load.stiffness_nm_per_rad": 200.0, "load.damping_nms": 0.01}
    return [Run(changes, [Hold(8, external_nm=-50.0), Hold(1200)])]


def stribeck(elastic):
    """Breaks loose under a torque that only keeps it moving because the friction falls with speed, and stops again."""
    changes = {
        "load.inertia_kgm2": 1.0e-3,
        "load.coulomb_friction_nm": 0.05,
        "load.static_friction_nm": 0.15,
        "load.stribeck_speed_rad_s": 2.0,
    }
    if elastic:
        changes |= {"load.elastic": 1, "load.stiffness_nm_per_rad": 200.0, "load.damping_nms": 0.05}
    torques = (-0.149, -0.16, -0.1, -0.04, 0.02)
    return [Run(changes, [Hold(300, external_nm=torque) for torque in torques])]


def belt():
    """A carriage oscillates on a belt whose stiffness increases along the travel."""
    changes = {
        "load.elastic": 1,
        "load.inertia_kgm2": 5.0e-4,
        "load.stiffness_nm_per_rad": 20.0,
        "load.damping_nms": 0.002,
        "load.belt_length_revolutions": 6.0,
        "load.belt_middle_revolutions": -1.0,
    }
    return [Run(changes, [Hold(8, external_nm=-20.0), Hold(1600)])]


def iron_loss():
    """Coasting; the iron losses heat a small case."""
    changes = {
        "load.inertia_kgm2": 1.0e-3,
        "motor.iron_hysteresis_nm": 0.02,
        "motor.iron_eddy_nms": 1.0e-4,
        "thermal.case_heat_capacity_j_per_k": 20.0,
    }
    return [Run(changes, [Hold(16, external_nm=-200.0), Hold(7984)], every=64, longest_step_ticks=64.0)]
