"""The comparisons of the plant: each scenario with its runs, and its quantities with their limits.

A target is the permitted error. If the plant does not meet it, `today` is its present error, rounded up, as the limit.
"""

import functools
from collections.abc import Callable
from dataclasses import dataclass

import electric_runs as electric
import shaft_runs as shaft
from hits import HIT_TICKS, fall, hits
from measures import course, energy_lost, impulse, link_current, link_energy, mean, restitution, sunk


@dataclass
class Quantity:
    name: str
    measure: Callable
    target: float  # percent, like all of these
    today: float | None = None

    @property
    def limit(self):
        return self.target if self.today is None else self.today


@dataclass
class Scenario:
    name: str
    runs: Callable
    quantities: list


COURSES = {
    "current": course("direct_a", "quadrature_a"),
    "torque": course("torque_nm"),
    "speed": course("velocity_rpm"),
    "load speed": course("load_velocity_rpm"),
    "position": course("position_counts"),
    "speed, reversals": course("velocity_rpm", at=shaft.REVERSED_AT),
    "load speed, reversals": course("load_velocity_rpm", at=shaft.REVERSED_AT),
    "link, change": course("dc_link_v", change=True),
    "supplied": course("supplied_j"),
    "chopped": course("chopped_j"),
    "stage losses": course("stage_j"),
    "winding, rise": course("winding_c", change=True),
    "case, rise": course("case_c", change=True),
    "stage, rise": course("stage_c", change=True),
    "current, of rated": course("direct_a", "quadrature_a", peak=electric.RATED_A),
}


def courses(*names, target=0.5, today=()):
    """Quantities that are compared in every tick; `today`: present errors of those that do not meet the target."""
    return [Quantity(name, COURSES[name], target, dict(today).get(name)) for name in names]


def turning(rpm):
    runs = functools.partial(electric.turning_step, rpm)
    return Scenario(f"current step, {rpm} rpm", runs, courses("current", "torque"))


def play(name, load_kgm2, damping, today=()):
    names = ("speed", "load speed", "speed, reversals", "load speed, reversals")
    return Scenario(name, functools.partial(shaft.play, load_kgm2, damping), courses(*names, today=today))


def hit(elastic, ticks):
    measures = (("restitution", restitution, 2.0), ("impulse", impulse, 1.0), ("energy lost", energy_lost, 2.0))
    quantities = [Quantity(*measure) for measure in measures]
    name = f"{'elastic' if elastic else 'rigid'} hit, {ticks:g} ticks"
    return Scenario(name, functools.partial(hits, ticks, elastic), quantities)


def generator(share):
    ticks = electric.settled_periods(share)
    measures = (("mean torque", mean("torque_nm", ticks)), ("mean link current", link_current(ticks)))
    quantities = [Quantity(*measure, 5.0) for measure in measures]
    return Scenario(f"passive bridge, EMF {share:g}", functools.partial(electric.generator, share), quantities)


def switch_off(name, current_a):
    ticks = range(electric.SWITCH_OFF_TICK, electric.SWITCH_OFF_TICK + 20)
    quantities = [Quantity("energy to link", link_energy(ticks), 1.0), *courses("current")]
    return Scenario(f"switch-off, {name} current", functools.partial(electric.switch_off, current_a), quantities)


def mains(word, phases):
    runs = functools.partial(electric.mains, phases)
    return Scenario(f"link, {word}-phase mains", runs, courses("link, change", "supplied", target=1.0))


def rotating(rad_per_tick):
    runs = functools.partial(electric.rotating, rad_per_tick)
    return Scenario(f"rotating, {rad_per_tick:g} rad/tick", runs, courses("current", target=1.0))


SCENARIOS = [
    Scenario("current step, standing", electric.standing_step, courses("current", "torque")),
    turning(1000),
    turning(3000),
    turning(6000),
    Scenario("current step, salient", electric.salient_step, courses("current", "torque")),
    Scenario("current step, saturated", electric.saturated_step, courses("current", "torque")),
    rotating(0.2),
    rotating(0.5),
    rotating(1.0),
    Scenario("stepper, full step", electric.stepper, courses("current", "speed", "position")),
    Scenario("torque step", electric.torque_step, courses("current", "torque", "speed")),
    Scenario("short circuit", electric.short_circuit, courses("current", "torque", "speed")),
    Scenario("short circuit, 85 degC", electric.warm_magnets, courses("current", "torque", "speed")),
    Scenario("viscous spin-down", shaft.spin_down, courses("speed", "position")),
    Scenario("viscous rotor, rigid", functools.partial(shaft.stiff_viscous, False), courses("speed", "position")),
    Scenario(
        "viscous rotor, elastic",
        functools.partial(shaft.stiff_viscous, True),
        courses("speed", "load speed", "position"),
    ),
    Scenario("Coulomb stop", shaft.coulomb_stop, courses("speed", "position")),
    Scenario("breakaway", shaft.breakaway, courses("speed", "position")),
    Scenario("brake, gravity", shaft.brake, courses("speed", "position")),
    Scenario("two masses, ring-down", shaft.ring_down, courses("speed", "load speed")),
    Scenario("two masses, driven", shaft.elastic_driven, courses("current", "speed", "load speed")),
    Scenario("stick-slip", shaft.stick_slip, courses("speed", "load speed")),
    Scenario("arm", shaft.arm, courses("speed", "position")),
    Scenario("crank, rigid", functools.partial(shaft.crank, False), courses("speed", "position")),
    Scenario("crank, elastic", functools.partial(shaft.crank, True), courses("speed", "load speed", "position")),
    Scenario("Stribeck, rigid", functools.partial(shaft.stribeck, False), courses("speed", "position")),
    Scenario("Stribeck, elastic", functools.partial(shaft.stribeck, True), courses("speed", "load speed", "position")),
    Scenario("belt", shaft.belt, courses("speed", "load speed", "position")),
    Scenario("iron loss", shaft.iron_loss, courses("speed", "case, rise")),
    play("play, 10 reversals", 1.0e-4, 0.1),
    play("play, light load", 1.0e-6, 0.01, {"load speed": 9}),
    *(hit(elastic, ticks) for elastic in (False, True) for ticks in HIT_TICKS),
    Scenario("fall on a stop", fall, [*courses("position"), Quantity("sag at rest", sunk(), 0.5)]),
    Scenario(
        "coasting, EMF 0.95", functools.partial(electric.generator, 0.95), courses("current, of rated", "speed")
    ),
    generator(1.05),
    generator(1.15),
    generator(1.5),
    switch_off("rated", electric.RATED_A),
    switch_off("peak", electric.PEAK_A),
    Scenario("link, charge", electric.charge, courses("link, change")),
    Scenario("link, precharge", electric.precharge, courses("link, change")),
    mains("one", 1),
    mains("three", 3),
    Scenario("link, motoring sag", electric.sag, courses("link, change", "supplied", "stage losses")),
    Scenario("link, regenerating", electric.regeneration, courses("link, change")),
    Scenario(
        "link, chopper",
        functools.partial(electric.regeneration, electric.CHOPPER_FROM),
        courses("link, change", "chopped"),
    ),
    Scenario("link, without supply", electric.buffered, courses("link, change")),
    Scenario(
        "copper heating, 100 s",
        electric.heating,
        courses("winding, rise", "case, rise", "stage, rise", "current"),
    ),
]
