"""Runs about windings, bridge, DC link and heat. The voltages are given in advance; there is no current control."""

import math

from bare_machine import BARE_MACHINE
from machine import flux_linkage_vs
from runs import Hold, Run
from state import TICK_S

RATED_A = 2.7 * math.sqrt(2.0)  # amplitude
PEAK_A = 3.0 * RATED_A
FLUX_VS = flux_linkage_vs(BARE_MACHINE)
POLE_PAIRS = BARE_MACHINE["motor.pole_pairs"]
OHM = BARE_MACHINE["motor.resistance_ohm"]
HENRY = BARE_MACHINE["motor.direct_inductance_h"]
FLYWHEEL_KGM2 = 0.01
SPIN_TICKS = 10


def vector(amplitude, angle):
    return tuple(amplitude * math.cos(angle - 2.0 * math.pi / 3.0 * phase) for phase in range(3))


def of_rotor(direct_v, quadrature_v, angle):
    """Returns the phase voltages of a vector in the rotor's frame."""
    return vector(math.hypot(direct_v, quadrature_v), angle + math.atan2(quadrature_v, direct_v))


def spin(speed_rad_s, inertia=FLYWHEEL_KGM2 + BARE_MACHINE["motor.rotor_inertia_kgm2"], **kept):
    """Accelerates the shaft to a speed by an external torque, with all switches open."""
    return Hold(SPIN_TICKS, external_nm=-speed_rad_s * inertia / (SPIN_TICKS * TICK_S), **kept)


def synchronous(ticks, speed_rad_s, direct_v, quadrature_v, pole_pairs=POLE_PAIRS, first=0, **kept):
    """A voltage vector that rotates with a rotor of constant speed, after spin(); `first`: ticks since then."""
    electrical = pole_pairs * speed_rad_s
    begin = electrical * TICK_S * (0.5 * SPIN_TICKS + first)
    angles = (begin + electrical * TICK_S * (tick + 0.5) for tick in range(ticks))
    return [Hold(1, of_rotor(direct_v, quadrature_v, angle), pwm=True, **kept) for angle in angles]


def for_current(current_a, electrical, direct_h=HENRY, quadrature_h=HENRY, flux=FLUX_VS, ohm=OHM):
    """Returns the direct and quadrature voltages that keep a quadrature current at a speed."""
    return -electrical * quadrature_h * current_a, ohm * current_a + electrical * flux


def rad_s(rpm):
    return rpm * math.pi / 30.0


def standing_step():
    return [Run({"locked": 1}, [Hold(400, vector(OHM * RATED_A, 0.5 * math.pi), pwm=True)])]


def turning_step(rpm, current_a=5.0):
    speed = rad_s(rpm)
    steps = synchronous(400, speed, *for_current(current_a, POLE_PAIRS * speed))
    return [Run({"load.inertia_kgm2": FLYWHEEL_KGM2}, [spin(speed), *steps])]


def salient_step():
    """Both mounting directions of the encoder."""
    runs = []
    for direction in (1, -1):
        quadrature_h = 1.6 * HENRY
        speed, pole_pairs = rad_s(3000.0), direction * POLE_PAIRS
        volts = for_current(5.0, pole_pairs * speed, quadrature_h=quadrature_h)
        changes = {"motor.quadrature_inductance_h": quadrature_h, "encoder.direction": direction}
        holds = [spin(speed), *synchronous(400, speed, *volts, pole_pairs=pole_pairs)]
        runs.append(Run({"load.inertia_kgm2": FLYWHEEL_KGM2, **changes}, holds))
    return runs


def saturated_step():
    """A step to twice the rated current, with a direct current, at a speed."""
    speed = rad_s(2000.0)
    changes = {"motor.quadrature_saturation_a": 6.0, "load.inertia_kgm2": FLYWHEEL_KGM2}
    left_h = HENRY * (0.4 + 0.6 / (1.0 + 8.0 / 6.0))
    direct_v, quadrature_v = for_current(8.0, POLE_PAIRS * speed, quadrature_h=left_h)
    steps = synchronous(400, speed, direct_v - OHM * 3.0, quadrature_v - POLE_PAIRS * speed * HENRY * 3.0)
    return [Run(changes, [spin(speed), *steps])]


def warm_magnets():
    """A short circuit: the back-EMF drives the current, with magnets at 85 degC."""
    changes = {"motor.magnet_temperature_coefficient": 1.1e-3, "thermal.ambient_c": 85.0}
    return [Run(run.changes | changes, run.holds) for run in short_circuit()]


def torque_step(ticks=400, inertia=5.0e-4):
    """A torque and then the opposite one. The voltages are calculated for the resulting motion of the shaft: each
    current approaches its value exponentially, which gives speed and angle in closed form."""
    tau = HENRY / OHM
    gain = 1.5 * POLE_PAIRS * FLUX_VS / (inertia + BARE_MACHINE["motor.rotor_inertia_kgm2"])
    holds = []
    for tick in range(2 * ticks):
        current = final = speed = angle = 0.0
        for begin, amperes in ((0, RATED_A), (ticks, -2.0 * RATED_A)):
            since = (tick + 0.5 - begin) * TICK_S
            if since < 0.0:
                continue
            missing = math.exp(-since / tau)
            final += amperes
            current += amperes * (1.0 - missing)
            speed += gain * amperes * (since - tau * (1.0 - missing))
            angle += gain * amperes * (0.5 * since * since - tau * since + tau * tau * (1.0 - missing))
        electrical = POLE_PAIRS * speed
        volts = -electrical * HENRY * current, OHM * final + electrical * FLUX_VS
        holds.append(Hold(1, of_rotor(*volts, POLE_PAIRS * angle), pwm=True))
    return [Run({"load.inertia_kgm2": inertia}, holds)]


def short_circuit():
    inertia = 5.0e-4
    begin = spin(rad_s(3000.0), inertia + BARE_MACHINE["motor.rotor_inertia_kgm2"])
    return [Run({"load.inertia_kgm2": inertia}, [begin, Hold(1600, short=True)])]


def rotating(rad_per_tick):
    """A fast vector with a motor of many poles. Half of the voltage balances the back-EMF."""
    pole_pairs, flux = 50, 0.005
    speed = rad_per_tick / TICK_S / pole_pairs
    electrical = pole_pairs * speed
    changes = {
        "motor.pole_pairs": pole_pairs,
        "motor.torque_constant_nm_per_a": 1.5 * pole_pairs * flux * math.sqrt(2.0),
        "motor.direct_inductance_h": 1.0e-3,
        "motor.quadrature_inductance_h": 1.0e-3,
        "load.inertia_kgm2": FLYWHEEL_KGM2,
    }
    steps = synchronous(160, speed, 0.0, 2.0 * electrical * flux, pole_pairs=pole_pairs)
    return [Run(changes, [spin(speed), *steps], longest_step_ticks=0.5)]


def stepper():
    """One full step of a hybrid stepper, in which the rotor oscillates."""
    changes = {
        "motor.phases": 2,
        "motor.pole_pairs": 50,
        "motor.resistance_ohm": 0.4,
        "motor.direct_inductance_h": 2.3e-3,
        "motor.quadrature_inductance_h": 2.3e-3,
        "motor.torque_constant_nm_per_a": 0.74,
        "motor.rotor_inertia_kgm2": 1.4e-4,
        "load.inertia_kgm2": 1.4e-4,
        "load.viscous_friction_nms": 0.01,
        "supply.volts": 72.0,
    }
    holds = [Hold(200, (2.4, 0.0, 0.0), pwm=True), Hold(400, (0.0, 2.4, 0.0), pwm=True)]
    return [Run(changes, holds)]


# --- All switches open.

GENERATED_V = 100.0
GENERATED_TICKS = 800


def generator(emf_share):
    """Coasting; the back-EMF (peak, line to line) is this multiple of the voltage of a large capacitor."""
    inertia = 0.1
    speed = emf_share * GENERATED_V / (math.sqrt(3.0) * FLUX_VS * POLE_PAIRS)
    changes = {"supply.volts": GENERATED_V, "supply.capacitance_f": 10.0, "load.inertia_kgm2": inertia}
    holds = [spin(speed, inertia + BARE_MACHINE["motor.rotor_inertia_kgm2"]), Hold(GENERATED_TICKS)]
    return [Run(changes, holds, longest_step_ticks=0.5)]


def settled_periods(emf_share):
    """The ticks of whole electrical periods after the transient of the currents."""
    period = 2.0 * math.pi / (emf_share * GENERATED_V / (math.sqrt(3.0) * FLUX_VS)) / TICK_S
    periods = int(0.5 * GENERATED_TICKS / period)
    last = SPIN_TICKS + GENERATED_TICKS
    return range(last - round(periods * period), last)


SWITCH_OFF_TICK = 400


def switch_off(current_a):
    """A current in several directions between the axis of a phase and the middle of two axes."""
    runs = []
    for degrees in (0.0, 5.0, 12.0, 20.0, 30.0):
        volts = vector(OHM * current_a, math.radians(degrees))
        holds = [Hold(SWITCH_OFF_TICK, volts, pwm=True), Hold(20)]
        runs.append(Run({"locked": 1, "supply.capacitance_f": 0.1}, holds, longest_step_ticks=1.0))
    return runs


# --- The DC link.


def charge():
    changes = {"supply.charged_at_start": 0, "supply.precharge_time_constant_s": 0.0}
    return [Run(changes, [Hold(16, connected=False), Hold(100)])]


def precharge():
    changes = {"supply.charged_at_start": 0, "supply.source_resistance_ohm": 5.0}
    return [Run(changes, [Hold(16, connected=False), Hold(2400)])]


def sag():
    changes = {"locked": 1, "supply.source_resistance_ohm": 5.0}
    return [Run(changes, [Hold(400, vector(OHM * 15.0, 0.0), pwm=True), Hold(100, pwm=True)])]


def mains(phases):
    """The link between the peaks of the mains, first without load and then with 370 W."""
    changes = {"locked": 1, "supply.mains_phases": phases}
    return [Run(changes, [Hold(160), Hold(640, vector(OHM * 15.0, 0.0), pwm=True)], longest_step_ticks=0.5)]


CHOPPER_FROM = 300  # ticks after the spin-up


def regeneration(chopper_from=None):
    """-4 A at 3000 rpm: 400 W flow back. The voltages are those of a current that rises exponentially."""
    speed = rad_s(3000.0)
    holds = []
    for tick in range(500):
        risen = 1.0 - math.exp(-(tick + 0.5) * TICK_S * OHM / HENRY)
        direct_v, quadrature_v = for_current(-4.0, POLE_PAIRS * speed)
        chopper = chopper_from is not None and tick >= chopper_from
        holds += synchronous(1, speed, risen * direct_v, quadrature_v, first=tick, chopper=chopper)
    inertia = 10.0 * FLYWHEEL_KGM2
    begin = spin(speed, inertia + BARE_MACHINE["motor.rotor_inertia_kgm2"])
    return [Run({"load.inertia_kgm2": inertia}, [begin, *holds])]


def buffered():
    """Without mains: electronics and bleeder discharge the capacitor."""
    changes = {"supply.standby_w": 20.0, "supply.bleeder_resistance_ohm": 5.0e3}
    return [Run(changes, [Hold(10), Hold(16000, connected=False)], every=16, longest_step_ticks=400.0)]


# --- Heat.

HEAT_SECONDS = 100


def heating():
    """24 W in the copper of a standing motor. Inductance and capacitance are large, so that the reference can use large
    steps."""
    changes = {
        "locked": 1,
        "supply.capacitance_f": 1.0,
        "motor.copper_temperature_coefficient": 3.93e-3,
        "motor.direct_inductance_h": 45.0e-3,
        "motor.quadrature_inductance_h": 45.0e-3,
    }
    hold = Hold(HEAT_SECONDS * 16000, vector(OHM * RATED_A, 0.0), pwm=True)
    return [Run(changes, [hold], every=1600, longest_step_ticks=1600.0)]
