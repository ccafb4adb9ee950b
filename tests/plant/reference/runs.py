"""A run of the machine, tick by tick: through the reference and through the plant. Both return the same columns."""

import functools
import hashlib
import os
import pathlib
import pickle
import subprocess
from dataclasses import dataclass, field

import numpy
import scipy
from bare_machine import BARE_MACHINE
from machine import Machine
from scipy.integrate import solve_ivp
from state import (
    ANGLE,
    CASE,
    CHOPPED,
    COPPER,
    DIRECT,
    IMPULSE,
    LINK,
    LOAD_ANGLE,
    LOAD_SPEED,
    QUADRATURE,
    RELATIVE_TOLERANCES,
    SPEED,
    STAGE,
    STAGE_LOSS,
    STANDBY,
    SUPPLIED,
    TICK_S,
    TICKS_PER_SECOND,
    TO_MOTOR,
    TOLERANCES,
    WINDING,
    WORK,
)

PROGRAM = os.environ.get("PLANT_TRACE") or str(
    pathlib.Path(__file__).parents[3] / "build/release/tests/plant/reference/plant_trace"
)
CACHE = pathlib.Path(__file__).parents[3] / "build/reference"
RPM = 30.0 / numpy.pi


@dataclass(frozen=True)
class Hold:
    """Inputs that are constant for a number of ticks."""

    ticks: int
    volts: tuple = (0.0, 0.0, 0.0)  # of the phases, in the stator's frame
    pwm: bool = False
    short: bool = False
    brake_released: bool = True
    external_nm: float = 0.0
    chopper: bool = False
    connected: bool = True

    def text(self):
        numbers = [self.ticks, *(float(numpy.float32(volts)) for volts in self.volts), int(self.pwm), int(self.short)]
        numbers += [int(self.brake_released), float(self.external_nm), int(self.chopper), int(self.connected)]
        return " ".join(map(repr, numbers))


@dataclass
class Run:
    changes: dict  # differences to the bare machine
    holds: list
    every: int = 1  # keeps one of this number of ticks
    longest_step_ticks: float = 2.0  # of the reference

    @property
    def parameters(self):
        return BARE_MACHINE | self.changes


@dataclass
class Trace:
    columns: dict  # name: array, by ticks
    every: int = 1
    happened: list = field(default_factory=list)  # (tick, name) of events in the reference

    def __getitem__(self, name):
        return self.columns[name]

    def tick_of(self, name, nth=0):
        """Returns the time of the nth occurrence of an event, with the fraction of the tick."""
        return [tick for tick, what in self.happened if what == name][nth]


def plant_trace(run):
    lines = [f"{name} = {value!r}" for name, value in run.parameters.items()]
    lines += [f"every = {run.every}", "ticks", *(hold.text() for hold in run.holds)]
    done = subprocess.run([PROGRAM], input="\n".join(lines).encode(), capture_output=True)
    assert done.returncode == 0, done.stderr.decode()
    names, _, numbers = done.stdout.partition(b"\n")
    names = names.decode().split()
    rows = numpy.frombuffer(numbers).reshape(-1, len(names))
    return Trace(dict(zip(names, rows.T)), run.every)


def reference_trace(run, halvings=0):
    """Runs the reference, or the same with its steps halved this number of times (its method is of order 8).

    The trace is cached in build/reference until the source of the reference or the run changes.
    """
    key = hashlib.sha256(source())
    key.update(pickle.dumps((run.parameters, run.holds, run.every, run.longest_step_ticks, halvings)))
    cached = CACHE / key.hexdigest()
    if cached.exists():
        return pickle.loads(cached.read_bytes())
    trace = Simulation(run, halvings).trace()
    CACHE.mkdir(parents=True, exist_ok=True)
    unfinished = cached.with_suffix(f".{os.getpid()}")
    unfinished.write_bytes(pickle.dumps(trace))
    unfinished.replace(cached)
    return trace


@functools.cache
def source():
    files = sorted(pathlib.Path(__file__).parent.glob("*.py"))
    return b"".join([numpy.__version__.encode(), scipy.__version__.encode(), *(file.read_bytes() for file in files)])


class Simulation:
    def __init__(self, run, halvings):
        self.run = run
        self.machine = Machine(run.parameters)
        self.state = self.machine.first_state()
        finer = 0.5**halvings
        self.longest_step_s = run.longest_step_ticks * TICK_S * finer
        self.tolerances = {"rtol": RELATIVE_TOLERANCES * finer**8, "atol": TOLERANCES * finer**8}
        self.tolerances["rtol"] = numpy.maximum(self.tolerances["rtol"], 3.0e-14)
        self.kept = []
        self.stored = []
        self.keep(self.state)
        self.happened = []
        self.brake_released = False
        self.brake_turns_s = None  # time at which the last command takes effect

    def trace(self):
        tick = 0
        for hold in self.run.holds:
            if hold.brake_released != self.brake_released:
                self.brake_released = hold.brake_released
                delay = "motor.brake_release_ms" if self.brake_released else "motor.brake_engage_ms"
                self.brake_turns_s = tick * TICK_S + 1.0e-3 * self.machine.p[delay]
            self.machine.hold(hold, self.state)
            self.advance(tick, tick + hold.ticks)
            tick += hold.ticks
        return Trace(self.columns(), self.run.every, self.happened)

    def advance(self, tick, last_tick):
        now, end = tick * TICK_S, last_tick * TICK_S
        if self.brake_turns_s is not None and self.brake_turns_s < end:
            if self.brake_turns_s > now:
                self.integrate(now, self.brake_turns_s)
            now, self.brake_turns_s = self.brake_turns_s, None
            self.machine.set_brake(not self.brake_released)
            self.machine.settle(self.state)
        self.integrate(now, end)

    def integrate(self, now, end):
        every = self.run.every * TICK_S
        while end - now > 1.0e-6 * TICK_S:
            wanted = numpy.arange(len(self.kept), int(end / every + 1.0e-6) + 1) * every
            instants = numpy.append(wanted[wanted < end - 1.0e-12], end)
            events = self.machine.events()
            found = solve_ivp(
                self.machine.derivative,
                (now, end),
                self.state,
                method="DOP853",
                t_eval=instants,
                events=events,
                max_step=self.longest_step_s,
                first_step=min(self.longest_step_s, end - now),
                **self.tolerances,
            )
            assert found.success, found.message
            for state in numpy.transpose(found.y)[: len(wanted)]:
                self.keep(state)
            if found.status == 0:
                self.state = found.y[:, -1].copy()
                return
            now = self.meet(events, found)
            if len(self.kept) * every <= now + 1.0e-12:
                self.keep(self.state)

    def keep(self, state):
        self.kept.append(state.copy())
        self.stored.append(self.machine.stored_j(state))

    def meet(self, events, found):
        """Processes the event that has ended the integration."""
        for event, times, states in zip(events, found.t_events, found.y_events):
            if len(times):
                self.state = states[0].copy()
                event.then(self.state)
                self.machine.release(self.state)
                self.happened.append((times[0] * TICKS_PER_SECOND, event.name))
                return times[0]
        raise AssertionError("no event has ended it")

    def columns(self):
        kept = numpy.array(self.kept).T
        link, magnetic, kinetic, elastic = numpy.array(self.stored).T
        counts = 1.0 / self.machine.rad_per_count
        impulse = numpy.diff(kept[IMPULSE], prepend=0.0)
        direction = self.run.parameters["encoder.direction"]
        return {
            "position_counts": kept[ANGLE] * counts,
            "velocity_rpm": kept[SPEED] * RPM,
            "load_position_counts": kept[LOAD_ANGLE] * counts,
            "load_velocity_rpm": kept[LOAD_SPEED] * RPM,
            "direct_a": kept[DIRECT],
            "quadrature_a": kept[QUADRATURE] * direction,
            "torque_nm": impulse / (self.run.every * TICK_S),
            "dc_link_v": kept[LINK],
            "supplied_j": kept[SUPPLIED],
            "chopped_j": kept[CHOPPED],
            "standby_j": kept[STANDBY],
            "stage_j": kept[STAGE_LOSS],
            "to_motor_j": kept[TO_MOTOR],
            "copper_j": kept[COPPER],
            "shaft_j": kept[WORK],
            "link_stored_j": link,
            "magnetic_j": magnetic,
            "kinetic_j": kinetic,
            "elastic_j": elastic,
            "winding_c": kept[WINDING],
            "case_c": kept[CASE],
            "stage_c": kept[STAGE],
        }
