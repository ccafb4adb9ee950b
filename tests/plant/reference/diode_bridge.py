"""Six diodes between a star of three windings and the DC link, all switches open: which diodes conduct, and until when.

A phase whose current flows out of the motor is clamped to the upper rail by its diode, one whose current flows in to
the lower rail. The voltage of a phase without current follows from its own back-EMF and the star point, between the
rails; beyond a rail its diode begins to conduct. So no phase conducts, or two, or all three. The diodes have no voltage
drop.
"""

import math

from state import ANGLE, DIRECT, LINK, QUADRATURE, SPEED, WINDING, Event, sign

PHASES = (0, 1, 2)
AXES = [2.0 * math.pi / 3.0 * phase for phase in PHASES]
NO_CURRENT_A = 1.0e-9
NO_VOLTAGE_V = 1.0e-9  # above the link's voltage: a motor at rest on an empty link does not open a diode


class DiodeBridge:
    def __init__(self, machine):
        self.m = machine
        self.rails = [0, 0, 0]  # of each phase: +1 the upper diode conducts, -1 the lower, 0 neither

    def conducting(self):
        return [phase for phase in PHASES if self.rails[phase] != 0]

    # --- The equations.

    def derivative(self, values, resistance):
        """Returns the derivatives of the currents, and the power into the motor."""
        conducting = self.conducting()
        if not conducting:
            return 0.0, 0.0, 0.0
        link_v = values[LINK]
        d_direct, d_quadrature = self.slopes(values, resistance, conducting)
        out_a = sum(self.phase_current(values, phase) for phase in conducting if self.rails[phase] > 0)
        return d_direct, d_quadrature, link_v * out_a

    def slopes(self, values, resistance, conducting):
        m = self.m
        direct, quadrature, electrical = values[DIRECT], values[QUADRATURE], m.pole_pairs * values[SPEED]
        theta = m.pole_pairs * values[ANGLE]
        terminals = [values[LINK] if rail > 0 else 0.0 for rail in self.rails]
        if len(conducting) == 3:
            # The terminals are known, and the star point is their mean.
            alpha_v = (2.0 * terminals[0] - terminals[1] - terminals[2]) / 3.0
            beta_v = (terminals[1] - terminals[2]) / math.sqrt(3.0)
            direct_v = alpha_v * math.cos(theta) + beta_v * math.sin(theta)
            quadrature_v = beta_v * math.cos(theta) - alpha_v * math.sin(theta)
            return m.current_slopes(direct, quadrature, direct_v, quadrature_v, resistance, electrical)
        # If two phases conduct, one current flows through them in series, along one axis of the stator. The change of
        # the flux along that axis is the voltage between the two phases minus that of their resistance.
        first, second = conducting
        d, q = self.axis(first, second, theta)
        along_a = d * direct + q * quadrature
        inductance = m.direct_h * d * d + m.quadrature_h * q * q
        inductance_slope = 2.0 * electrical * d * q * (m.direct_h - m.quadrature_h)
        along_v = (terminals[first] - terminals[second]) / math.sqrt(3.0)
        back_v = electrical * m.flux * q + inductance_slope * along_a
        slope = (along_v - resistance * along_a - back_v) / inductance
        # The axis turns backwards as seen from the rotor.
        return d * slope + electrical * q * along_a, q * slope - electrical * d * along_a

    def axis(self, first, second, theta):
        """Returns the axis from the second phase to the first, in the rotor frame."""
        d = math.cos(AXES[first] - theta) - math.cos(AXES[second] - theta)
        q = math.sin(AXES[first] - theta) - math.sin(AXES[second] - theta)
        return d / math.sqrt(3.0), q / math.sqrt(3.0)

    def phase_current(self, values, phase):
        angle = AXES[phase] - self.m.pole_pairs * values[ANGLE]
        return values[DIRECT] * math.cos(angle) + values[QUADRATURE] * math.sin(angle)

    def blocked_v(self, values, phase):
        """Returns the voltage between a phase without current and the star point: the change of the flux along its
        axis."""
        m = self.m
        conducting = self.conducting()
        electrical = m.pole_pairs * values[SPEED]
        slopes = 0.0, 0.0
        if conducting:
            # The axis of a phase without current has no resistive voltage.
            slopes = self.slopes(values, m.resistance_ohm(values[WINDING]), conducting)
        flux_d = m.direct_h * slopes[0] - electrical * m.quadrature_h * values[QUADRATURE]
        flux_q = m.quadrature_h * slopes[1] + electrical * (m.direct_h * values[DIRECT] + m.flux)
        angle = AXES[phase] - m.pole_pairs * values[ANGLE]
        return flux_d * math.cos(angle) + flux_q * math.sin(angle)

    def blocked_terminal_v(self, values):
        """Returns, with two phases conducting, the third terminal's voltage to the lower rail. The phase voltages add
        up to 0."""
        blocked = self.rails.index(0)
        return 0.5 * (values[LINK] + 3.0 * self.blocked_v(values, blocked))

    def least_gap_v(self, values):
        """Returns, without any current, the voltage that is missing to open two diodes."""
        voltages = [self.blocked_v(values, phase) for phase in PHASES]
        return values[LINK] + NO_VOLTAGE_V - (max(voltages) - min(voltages))

    # --- Modes.

    def open(self, state):
        """Opens the switches: each current continues through the diode of its direction."""
        for phase in PHASES:
            current = self.phase_current(state, phase)
            self.rails[phase] = -sign(current) if abs(current) > NO_CURRENT_A else 0
        self.clear(state)

    def clear(self, state):
        """Sets the current of phases that do not conduct to exactly 0."""
        conducting = self.conducting()
        if len(conducting) == 2:
            d, q = self.axis(*conducting, self.m.pole_pairs * state[ANGLE])
            along_a = d * state[DIRECT] + q * state[QUADRATURE]
            state[DIRECT], state[QUADRATURE] = d * along_a, q * along_a
        elif len(conducting) < 2:
            self.rails = [0, 0, 0]
            state[DIRECT] = state[QUADRATURE] = 0.0

    def settle(self, state):
        """Returns the diodes that the voltages open immediately."""
        if not self.conducting() and self.least_gap_v(state) < 0.0:
            self.begin(state)
        if len(self.conducting()) == 2:
            terminal_v = self.blocked_terminal_v(state)
            if not 0.0 <= terminal_v <= state[LINK]:
                self.rails[self.rails.index(0)] = 1 if terminal_v > 0.0 else -1

    def begin(self, state):
        voltages = [self.blocked_v(state, phase) for phase in PHASES]
        self.rails[voltages.index(max(voltages))] = 1
        self.rails[voltages.index(min(voltages))] = -1

    def events(self):
        conducting = self.conducting()
        if not conducting:
            return [Event(self.least_gap_v, self.begin)]
        events = []
        for phase in conducting if len(conducting) == 3 else conducting[:1]:
            events.append(Event(lambda s, k=phase: -self.rails[k] * self.phase_current(s, k), self.end_of(phase)))
        if len(conducting) == 2:
            blocked = self.rails.index(0)
            for rail, function in ((1, lambda s: s[LINK] - self.blocked_terminal_v(s)), (-1, self.blocked_terminal_v)):
                events.append(Event(function, lambda _, k=blocked, r=rail: self.rails.__setitem__(k, r)))
        return events

    def end_of(self, phase):
        def then(state):
            self.rails[phase] = 0
            self.clear(state)
            self.settle(state)

        return then
