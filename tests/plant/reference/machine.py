"""The machine as differential equations, one set for each of its modes, and the end of each mode.

A mode defines which masses stand or slide, which contacts are closed, and which diodes conduct; within a mode all
functions are smooth. The windings are in the rotor frame (d on the magnet, amplitude-invariant): power and torque are
n/2 times the products of n phases. Signs are those of the plant: positive is the direction in which the encoder counts
up.
"""

import math

import numpy
from contacts import Flanks, Stops
from diode_bridge import DiodeBridge
from friction import Mass
from load_place import LoadPlace
from state import ANGLE, CASE, LINK, LOAD_ANGLE, LOAD_SPEED, SPEED, STAGE, STATES, WINDING, Event

EMPTY_V = 10.0  # voltage of the link below which nothing in the drive switches
PRECHARGED = 0.97  # share of the supply's voltage at which the relay bridges the precharge resistor


def flux_linkage_vs(p):
    """Torque = n/2 * pole pairs * flux * amplitude, and the amplitude is sqrt(2) times the A rms."""
    return p["motor.torque_constant_nm_per_a"] / (0.5 * p["motor.phases"] * p["motor.pole_pairs"] * math.sqrt(2.0))


class Machine:
    def __init__(self, parameters):
        p = self.p = parameters
        self.flux = self.flux_at_25_c = flux_linkage_vs(p)
        self.half_phases = 0.5 * p["motor.phases"]
        self.pole_pairs = p["motor.pole_pairs"] * p["encoder.direction"]
        self.direct_h = p["motor.direct_inductance_h"]
        self.quadrature_h = p["motor.quadrature_inductance_h"]
        self.elastic = bool(p["load.elastic"])
        self.place = LoadPlace(p)
        self.rotor_inertia = p["motor.rotor_inertia_kgm2"]
        self.rotor_viscous = p["motor.viscous_friction_nms"] + p["motor.iron_eddy_nms"]
        self.load_viscous = p["load.viscous_friction_nms"]
        self.rad_per_count = 2.0 * math.pi / p["encoder.counts_per_revolution"]
        self.precharge_ohm = max(
            p["supply.precharge_time_constant_s"] / p["supply.capacitance_f"], p["supply.source_resistance_ohm"]
        )

        # Inputs that are constant for some time.
        self.alpha_v = self.beta_v = 0.0
        self.pwm = self.open = self.chopper = self.connected = False
        self.load_nm = 0.0

        # The mode.
        self.rotor = Mass(SPEED, bool(p["locked"]))
        self.load = Mass(LOAD_SPEED)
        self.masses = [self.rotor, self.load] if self.elastic else [self.rotor]
        self.flanks = Flanks(p)
        self.stops = Stops(p, self.rad_per_count)
        self.bridge = DiodeBridge(self)
        self.precharging = False
        self.set_brake(True)

    def first_state(self):
        p = self.p
        state = numpy.zeros(STATES)
        state[[ANGLE, LOAD_ANGLE]] = p["encoder.start_position_counts"] * self.rad_per_count
        self.connected = bool(p["supply.charged_at_start"])
        state[LINK] = p["supply.volts"] if self.connected else 0.0
        state[[WINDING, CASE, STAGE]] = p["thermal.ambient_c"]
        return state

    def set_brake(self, engaged):
        p = self.p
        rotor = p["motor.coulomb_friction_nm"] + p["motor.iron_hysteresis_nm"]
        rotor += p["motor.brake_torque_nm"] if engaged else 0.0
        load = p["load.coulomb_friction_nm"], p["load.static_friction_nm"]
        if p["load.stribeck_speed_rad_s"] > 0.0:
            carried = self.load if self.elastic else self.rotor
            carried.stribeck_nm, carried.stribeck_rad_s = load[1] - load[0], p["load.stribeck_speed_rad_s"]
        if self.elastic:
            self.rotor.sliding_nm = self.rotor.static_nm = rotor
            self.load.sliding_nm, self.load.static_nm = load
        else:
            self.rotor.sliding_nm, self.rotor.static_nm = rotor + load[0], rotor + load[1]

    def hold(self, hold, state):
        """Sets the inputs from now on, and determines the modes that follow from them."""
        u, v, w = (float(numpy.float32(volts)) for volts in hold.volts)
        if not hold.pwm or hold.short:
            u = v = w = 0.0
        if self.p["motor.phases"] == 2:
            self.alpha_v, self.beta_v = u, v
        else:
            self.alpha_v, self.beta_v = (2.0 * u - v - w) / 3.0, (v - w) / math.sqrt(3.0)
            assert max(u, v, w) - min(u, v, w) <= state[LINK], "more voltage than the DC link has"
        self.pwm = hold.pwm
        was_open, self.open = self.open, not hold.pwm and not hold.short
        self.load_nm = -(self.p["load.gravity_torque_nm"] + hold.external_nm)
        self.chopper = hold.chopper
        self.precharging = hold.connected and (self.precharging or not self.connected)
        self.connected = hold.connected
        if self.open and not was_open:
            self.bridge.open(state)
        self.settle(state)

    def settle(self, state):
        """Determines the modes of precharge, bridge and friction for this state."""
        self.precharging = self.precharging and state[LINK] < PRECHARGED * self.p["supply.volts"]
        if self.open:
            self.bridge.settle(state)
        for mass, torque in zip(self.masses, self.torques_of(state)):
            mass.settle(state[mass.place], torque)

    def release(self, state):
        """Releases masses that are at rest but no longer held, because a contact has closed or opened."""
        for mass, torque in zip(self.masses, self.torques_of(state)):
            if mass.stands and not mass.clamped and abs(torque) > mass.static_nm:
                mass.break_away(torque)

    # --- The equations.

    def resistance_ohm(self, winding_c):
        p = self.p
        return p["motor.resistance_ohm"] * (1.0 + p["motor.copper_temperature_coefficient"] * (winding_c - 25.0))

    def warm_magnets(self, case_c):
        cooler = self.p["motor.magnet_temperature_coefficient"] * (case_c - 25.0)
        self.flux = self.flux_at_25_c * (1.0 - cooler)

    def saturable(self):
        """Returns the part of Lq that decreases with the current, and the scale of the current."""
        scale = self.p["motor.quadrature_saturation_a"]
        if scale == 0.0:
            return 0.0, 1.0
        return (1.0 - self.p["motor.saturated_inductance_share"]) * self.quadrature_h, scale

    def quadrature_flux(self, quadrature):
        part, scale = self.saturable()
        return (self.quadrature_h - part * abs(quadrature) / (scale + abs(quadrature))) * quadrature

    def quadrature_slope_h(self, quadrature):
        part, scale = self.saturable()
        return self.quadrature_h - part * (1.0 - (scale / (scale + abs(quadrature))) ** 2)

    def torque_nm(self, direct, quadrature):
        along = (self.flux + self.direct_h * direct) * quadrature
        return self.half_phases * self.pole_pairs * (along - self.quadrature_flux(quadrature) * direct)

    def current_slopes(self, direct, quadrature, direct_v, quadrature_v, resistance, electrical):
        """Voltage = resistance * current + change of the flux, which rotates as seen from the rotor."""
        back_d = -electrical * self.quadrature_flux(quadrature)
        back_q = electrical * (self.direct_h * direct + self.flux)
        return (
            (direct_v - resistance * direct - back_d) / self.direct_h,
            (quadrature_v - resistance * quadrature - back_q) / self.quadrature_slope_h(quadrature),
        )

    def torques(self, direct, quadrature, speed, angle, load_speed, load_angle):
        """Returns the torques on the rotor (with a rigid load: the shaft) and on the load, of all parts but dry
        friction."""
        rotor = self.torque_nm(direct, quadrature) - self.rotor_viscous * speed
        load = self.load_nm - self.load_viscous * load_speed - self.stops.torque_nm(load_speed, load_angle)
        load -= self.place.weight_nm(load_angle) + 0.5 * self.place.inertia_slope(load_angle) * load_speed**2
        if not self.elastic:
            return rotor + load, 0.0
        self.flanks.stiffness = self.place.stiffness(load_angle)
        coupling = self.flanks.torque_nm(speed - load_speed, angle - load_angle)
        load -= 0.5 * self.place.stiffness_slope(load_angle) * (angle - load_angle) ** 2
        return rotor - coupling, load + coupling

    def torques_of(self, state):
        return self.torques(*state.tolist()[: LOAD_ANGLE + 1])

    def supply_v(self, time_s):
        """Returns the voltage of a rectifier: the greatest voltage between two of its wires."""
        peak, phases = self.p["supply.volts"], self.p["supply.mains_phases"]
        if phases == 0:
            return peak
        angle = 2.0 * math.pi * self.p["supply.mains_hz"] * time_s
        wires = [math.sin(angle + math.pi / 6.0 + 2.0 * math.pi / 3.0 * n) / math.sqrt(3.0) for n in range(3)]
        return peak * (abs(math.sin(angle)) if phases == 1 else max(wires) - min(wires))

    def derivative(self, time_s, state):
        p = self.p
        values = state.tolist()
        direct, quadrature, speed, angle, load_speed, load_angle, link_v, winding_c, case_c, stage_c = values[:10]
        resistance = self.resistance_ohm(winding_c)
        self.warm_magnets(case_c)
        electrical = self.pole_pairs * speed
        if self.open:
            d_direct, d_quadrature, power = self.bridge.derivative(values, resistance)
        else:
            cosine, sine = math.cos(self.pole_pairs * angle), math.sin(self.pole_pairs * angle)
            direct_v = self.alpha_v * cosine + self.beta_v * sine
            quadrature_v = self.beta_v * cosine - self.alpha_v * sine
            d_direct, d_quadrature = self.current_slopes(
                direct, quadrature, direct_v, quadrature_v, resistance, electrical
            )
            power = self.half_phases * (direct_v * direct + quadrature_v * quadrature)

        torque = self.torque_nm(direct, quadrature)
        on_rotor, on_load = self.torques(direct, quadrature, speed, angle, load_speed, load_angle)
        load_inertia = self.place.inertia(load_angle)
        moved_inertia = self.rotor_inertia + (0.0 if self.elastic else load_inertia)
        acceleration = self.rotor.acceleration(on_rotor, moved_inertia, speed)
        load_acceleration = acceleration
        if self.elastic:
            load_acceleration = self.load.acceleration(on_load, load_inertia, load_speed)
        iron_w = p["motor.iron_hysteresis_nm"] * abs(speed) + p["motor.iron_eddy_nms"] * speed * speed

        supply_v = self.supply_v(time_s) if self.connected else 0.0
        source_ohm = self.precharge_ohm if self.precharging else p["supply.source_resistance_ohm"]
        source_a = max(0.0, supply_v - link_v) / source_ohm  # no current flows back through the rectifier
        standby_w = p["supply.standby_w"] if link_v > supply_v else 0.0  # otherwise the source feeds the electronics
        leaks = 1.0 / p["supply.bleeder_resistance_ohm"]
        if self.chopper:
            leaks += 1.0 / p["supply.chopper_resistance_ohm"]
        square_a2 = self.half_phases * (direct * direct + quadrature * quadrature)
        copper_w = square_a2 * resistance
        stage_w = square_a2 * p["thermal.stage_resistance_ohm"] + (p["thermal.stage_standby_w"] if self.pwm else 0.0)
        lost_w = stage_w if link_v > EMPTY_V else 0.0
        drawn_a = link_v * leaks + ((power + lost_w + standby_w) / link_v if link_v > 0.0 else 0.0)
        to_case_w = (winding_c - case_c) / p["thermal.winding_to_case_k_per_w"]
        from_case_w = (case_c - p["thermal.ambient_c"]) / p["thermal.case_to_ambient_k_per_w"]
        from_stage_w = (stage_c - p["thermal.ambient_c"]) / p["thermal.stage_to_ambient_k_per_w"]
        return [
            d_direct,
            d_quadrature,
            acceleration,
            speed,
            load_acceleration,
            load_speed,
            (source_a - drawn_a) / p["supply.capacitance_f"],
            (copper_w - to_case_w) / p["thermal.winding_heat_capacity_j_per_k"],
            (to_case_w + iron_w - from_case_w) / p["thermal.case_heat_capacity_j_per_k"],
            (stage_w - from_stage_w) / p["thermal.stage_heat_capacity_j_per_k"],
            torque,
            power,
            copper_w,
            torque * speed,
            source_a * link_v,
            link_v * link_v * leaks,
            standby_w,
            lost_w,
        ]

    # --- The end of a mode.

    def events(self):
        events = self.stops.events()
        if self.elastic:
            events += self.flanks.events()
        for number, mass in enumerate(self.masses):
            if mass.static_nm > 0.0 and not mass.clamped:
                events.append(self.end_of_standing(number, mass) if mass.stands else self.end_of_sliding(number, mass))
        if self.precharging:
            threshold = PRECHARGED * self.p["supply.volts"]
            events.append(Event(lambda state: threshold - state[LINK], self.end_precharge))
        if self.open:
            events += self.bridge.events()
        return events

    def end_of_standing(self, number, mass):
        def margin_nm(state):
            return mass.static_nm - abs(self.torques_of(state)[number])

        return Event(margin_nm, lambda state: mass.break_away(self.torques_of(state)[number]))

    def end_of_sliding(self, number, mass):
        def rest(state):
            state[[SPEED, LOAD_SPEED] if not self.elastic else [mass.place]] = 0.0
            mass.settle(0.0, self.torques_of(state)[number])

        return Event(lambda state: mass.direction * state[mass.place], rest)

    def end_precharge(self, _):
        self.precharging = False

    # --- Stored energy.

    def stored_j(self, state):
        """The energy in the DC link, the windings, the moving masses, and in coupling and stops."""
        direct, quadrature, speed, angle, load_speed, load_angle, link_v = state.tolist()[: LINK + 1]
        link = 0.5 * self.p["supply.capacitance_f"] * link_v * link_v
        part, scale = self.saturable()
        share = abs(quadrature) / scale
        spared = part * (0.5 * quadrature**2 - scale**2 * (math.log1p(share) - share / (1.0 + share)))
        magnetic = self.half_phases * (0.5 * self.direct_h * direct**2 + 0.5 * self.quadrature_h * quadrature**2 - spared)
        kinetic = 0.5 * self.rotor_inertia * speed**2 + 0.5 * self.place.inertia(load_angle) * load_speed**2
        elastic = self.stops.stored_j(load_angle)
        if self.elastic:
            self.flanks.stiffness = self.place.stiffness(load_angle)
            elastic += self.flanks.stored_j(angle - load_angle)
        return link, magnetic, kinetic, elastic
