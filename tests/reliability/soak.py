"""A line that runs for days of line time: no drift, no growth of memory, the same figures of motion at the end.

Every axis repeats a cycle: it is enabled, moves forward and back, turns forward for 2.5 seconds, the ramp included,
stops, is disabled, and rests until the cycle is over. So over time it moves without limit in one direction, and its
32-bit position overflows every few hours. Once a day the power of each axis is switched off and on.

After each move these must hold: the true shaft moved by the demanded distance; the drive's position object differs from
the true shaft by the same offset as before; the drive has no fault. The figures of a move (its duration, peak torque,
peak velocity, largest following error, final error) and the winding's temperature must stay in the range that they had
in the reference hours, with a small margin, and their means closer to those of the reference hours. Memory must not grow
after the first hours.
"""

import heapq
import random
import sys

import report

import servodrome
from servodrome import Axis, Bus, Line

TICKS_PER_S = 16000
COUNT_RANGE = 2**32
MOVE_REVOLUTIONS = 8.0
MOVE = {"velocity": 20.0, "acceleration": 200.0, "units": "revolutions"}
MOVE_S = 1.4  # for a move of 0.5 s and its rest
TURN = {"velocity": 30.0, "acceleration": 300.0, "units": "revolutions"}
TURN_S = 1.0
STOP_S = 0.8
TURN_BEGINS_S = 1.5  # with the ramp
MOVES_RPM = 1.0  # faster than that is motion
PRODUCTS = ("generic402", "ismc", "pronet", "ismk", "generic402-ec", "jmc_ec", "ismk-ea")
# Objects that are set after each power-on: the factory's limits of the jmc_ec are 216 rpm and 25 revolutions/s^2.
SET_UP = {"jmc_ec": {0x607F: 160_000, 0x6080: 160_000, 0x60C5: 2_000_000, 0x60C6: 2_000_000}}
# Margins of the figures, absolute and relative. Peaks may lie between two samples. A move ends at a poll of its master,
# which comes every 5 ms, so equal moves may differ by one poll. Static friction holds the shaft of some moves beside the
# target: of 7200 moves of a generic402, 18 ended 4 to 8 counts away, all others at most 3.
MARGINS = {
    "duration_s": (0.006, 0.0),
    "final_error_counts": (4.0, 0.0),
    "peak_torque_nm": (0.005, 0.03),
    "peak_velocity_rpm": (0.5, 0.002),
    "following_error": (2.0, 0.15),
    "winding_c": (2.0, 0.0),
}
MEAN_SHARE = 0.25  # of the margin: a mean varies less than the single values
VALUES_FOR_MEAN = 100
# Largest error of a reading: eccentricity and interpolation of the encoder (20 + 5 + 3 arc seconds) and six times its
# r.m.s. noise (2).
ENCODER_ERROR_REVOLUTIONS = (28 + 6 * 2) / 1_296_000
MOST_GROWTH_KIB = 2048
READ_PER_S = 1000
MOTION_READ_PER_S = 100


class Span:
    """The range of a figure."""

    def __init__(self):
        self.low = float("inf")
        self.high = float("-inf")
        self.sum = 0.0
        self.count = 0

    def add(self, value):
        self.low = min(self.low, value)
        self.high = max(self.high, value)
        self.sum += value
        self.count += 1

    @property
    def mean(self):
        return self.sum / self.count

    def as_list(self):
        """Lowest, mean and highest value."""
        return [round(value, 6) for value in (self.low, self.mean, self.high)] if self.count else None


class Figures:
    """The ranges of one axis in the reference hours, and in the hours since."""

    def __init__(self):
        self.reference = {}
        self.later = {}

    def add(self, name, value, is_reference):
        (self.reference if is_reference else self.later).setdefault(name, Span()).add(value)

    def margin(self, name):
        absolute, share = MARGINS[name]
        return absolute + share * self.reference[name].high

    def outside(self, name, value):
        """True if the value is outside of the reference range, widened by the margin."""
        span = self.reference.get(name)
        if span is None:
            return False
        margin = self.margin(name)
        return not span.low - margin <= value <= span.high + margin

    def changed_means(self):
        """The figures whose mean has changed since the reference hours, each with both means."""
        for name, span in self.reference.items():
            later = self.later.get(name)
            if later is None or min(span.count, later.count) < VALUES_FOR_MEAN:
                continue
            if abs(later.mean - span.mean) > MEAN_SHARE * self.margin(name):
                yield name, span.mean, later.mean


class Subject:
    """One axis with its program."""

    def __init__(self, soak, axis, phase_s):
        self.soak = soak
        self.axis = axis
        self.phase_s = phase_s
        self.figures = Figures()
        self.cycles = 0
        self.moves = 0
        self.overflows = 0
        self.seconds_in_motion = 0.0
        self.offset = None
        self.shown = None
        self.day = 0
        units = soak.line.request("GET", f"axes/{axis.name}/units")
        self.units_per_revolution = round(units["position_per_revolution"])
        self.counts_per_revolution = soak.line.request("GET", f"axes/{axis.name}/geometry")["index_every"]
        self.signals = {name: axis.signal(name) for name in ("torque_nm", "velocity_rpm", "following_error")}

    def fail(self, text):
        self.soak.report.finding(f"{self.axis.name} at {self.soak.line.now:.4f} s, cycle {self.cycles}: {text}")

    def run(self):
        """The program of the axis; yields the seconds that it waits."""
        yield self.phase_s
        while True:
            began = self.soak.line.now
            self.power_cycle_if_due()
            yield 0.2
            self.set_up()
            yield from self.cycle()
            self.cycles += 1
            yield max(0.0, began + self.soak.given.period - self.soak.line.now)

    def power_cycle_if_due(self):
        day = int(self.soak.line.now / 86400)
        if day != self.day:
            self.day = day
            self.axis.power("cycle")
            self.offset = self.shown = None

    def set_up(self):
        for index, value in SET_UP.get(self.axis.view()["product"], {}).items():
            self.axis.objects[index] = value

    def cycle(self):
        yield from self.job("enable", 1.5)
        with self.soak.line.record({"v": self.axis.signal("velocity_rpm")}, rate=MOTION_READ_PER_S) as recording:
            for direction in (1, -1):
                yield from self.move(direction * MOVE_REVOLUTIONS)
            yield from self.job("velocity", TURN_BEGINS_S, **TURN)
            yield TURN_S
            yield from self.job("stop", STOP_S)
        self.seconds_in_motion += float((abs(recording.numpy()) > MOVES_RPM).sum()) / MOTION_READ_PER_S
        self.check_offset()
        yield from self.job("disable", 0.5)
        self.look()

    def job(self, do, seconds, **keys):
        """Starts a job, waits for a fixed time, and checks that it is done."""
        job = self.axis.job(do, wait=False, **keys)
        yield seconds
        if job.state is not servodrome.JobState.DONE:
            self.fail(f"{do} is {job.state.value} after {seconds} s: {job.view().get('error')}; statusword {self.axis.statusword:04X}")
            if not job.is_over:
                job.end()
            yield 2.0
            self.axis.reset_fault(wait=False)
            yield 1.0
        return job

    def move(self, revolutions):
        axis = self.axis
        start = axis.position
        recording = self.soak.line.record(self.signals, rate=READ_PER_S)
        job = yield from self.job("move", MOVE_S, by=revolutions, **MOVE)
        recording.stop()
        result = job.result
        if result is None:
            return
        self.moves += 1
        error = axis.position - start - revolutions * self.counts_per_revolution
        values = abs(recording.numpy()).max(axis=0)
        figures = {"duration_s": result.seconds, "final_error_counts": abs(error), "peak_torque_nm": values[0]}
        figures |= {"peak_velocity_rpm": values[1], "following_error": values[2]}
        figures |= {"winding_c": axis.temperature_c}
        for name, value in figures.items():
            self.judge(name, float(value))
        self.check_offset()

    def judge(self, name, value):
        now = self.soak.line.now
        first, last = self.soak.reference
        if now < first:
            return
        is_reference = now < last
        if not is_reference and self.figures.outside(name, value):
            self.fail(f"{name} is {value:.6g}, in the reference hours {self.figures.reference[name].as_list()}")
        self.figures.add(name, value, is_reference)

    def judge_means(self):
        for name, before, later in self.figures.changed_means():
            self.fail(f"the mean of {name} is {later:.6g}, in the reference hours {before:.6g}")

    def check_offset(self):
        """Checks that the position object and the true shaft have moved by the same distance since the last
        power-on."""
        shown = self.axis.objects[0x6064]
        true = self.axis.position
        units, counts = self.units_per_revolution, self.counts_per_revolution
        if self.shown is not None and abs(shown - self.shown) > COUNT_RANGE // 2:
            self.overflows += 1
        self.shown = shown
        drive_range = COUNT_RANGE * counts  # in units times counts per revolution
        offset = (shown * counts - true * units) % drive_range
        if self.offset is None:
            self.offset = offset
        difference = (offset - self.offset + drive_range // 2) % drive_range - drive_range // 2
        # Two readings, each rounded, and each with the errors of the encoder.
        allowed = 2 * (max(units, counts) + ENCODER_ERROR_REVOLUTIONS * units * counts)
        if abs(difference) > allowed:
            self.fail(f"6064h and the shaft have drifted apart by {difference / counts:.2f} units")
            self.offset = offset

    def look(self):
        faults = self.axis.faults
        if faults:
            self.fail(f"faults {[str(fault) for fault in faults]}")
            self.axis.reset_fault(wait=False)


class Soak:
    """The line and the schedule of its programs."""

    def __init__(self, given, out):
        self.given = given
        self.report = out
        self.line = make_line(given.axes, given.product)
        draw = random.Random(given.seed)
        self.reference = (given.warm_up * 3600.0, (given.warm_up + given.reference) * 3600.0)
        self.subjects = [Subject(self, axis, draw.uniform(0.1, given.period)) for axis in self.line.axes.values()]
        self.memory = []

    def run(self):
        end = round(self.given.hours * 3600 * TICKS_PER_S)
        queue = [(0, number, subject.run()) for number, subject in enumerate(self.subjects)]
        next_hour = 3600 * TICKS_PER_S
        while queue[0][0] < end:
            tick, number, program = heapq.heappop(queue)
            while next_hour <= tick:
                self.pass_to(next_hour)
                self.hour()
                next_hour += 3600 * TICKS_PER_S
            self.pass_to(tick)
            wait = round(next(program) * TICKS_PER_S)
            heapq.heappush(queue, (tick + max(1, wait), number, program))
        self.pass_to(end)
        if end >= next_hour:
            self.hour()

    def pass_to(self, tick):
        self.line.run_ticks(max(0, tick - self.line.ticks))

    def hour(self):
        self.memory.append(report.resident_kib())
        hours = self.line.now / 3600
        self.report.progress(f"{hours:.0f} h of {self.given.hours:g} h, {self.moves} moves, {self.memory[-1]} KiB")

    @property
    def moves(self):
        return sum(subject.moves for subject in self.subjects)

    def tell(self):
        figures = self.report.figures
        figures["axes"] = len(self.subjects)
        figures["line_hours"] = round(self.line.now / 3600, 3)
        figures["cycles"] = sum(subject.cycles for subject in self.subjects)
        figures["moves"] = self.moves
        figures["position_overflows"] = sum(subject.overflows for subject in self.subjects)
        in_motion = sum(subject.seconds_in_motion for subject in self.subjects)
        figures["share_in_motion"] = round(in_motion / (self.line.now * len(self.subjects)), 4)
        figures["figures"] = {subject.axis.name: self.ranges(subject) for subject in self.subjects[: len(PRODUCTS)]}
        for subject in self.subjects:
            subject.judge_means()
        self.check_memory(figures)

    @staticmethod
    def ranges(subject):
        figures = subject.figures
        later = {name: span.as_list() for name, span in figures.later.items()}
        return {name: {"reference": span.as_list(), "later": later.get(name)} for name, span in figures.reference.items()}

    def check_memory(self, figures):
        """The reference is the memory at the end of the reference hours."""
        if not self.memory:
            return
        first = self.memory[min(len(self.memory) - 1, int(self.reference[1] / 3600))]
        figures["memory_kib"] = {"reference": first, "last": self.memory[-1], "most": max(self.memory)}
        if max(self.memory) - first > MOST_GROWTH_KIB and len(self.memory) > self.reference[1] / 3600:
            self.report.finding(f"memory grew from {first} KiB to {max(self.memory)} KiB")


def make_line(count, product):
    """Axes of one product, or of all in turn; CAN drives on two buses, EtherCAT drives on a segment."""
    buses = [Bus("can0"), Bus("can1"), Bus("ecat", "ethercat")]
    used = set()
    axes = []
    for number in range(count):
        name = product or PRODUCTS[number % len(PRODUCTS)]
        if name.endswith("ec") or name == "ismk-ea":
            place = {"bus": "ecat"}
        else:
            place = {"bus": f"can{number % 2}", "node": 1 + number // 2}
        used.add(place["bus"])
        axes.append(Axis(f"a{number}", name, **place))
    return Line(axes=axes, buses=[bus for bus in buses if bus.name in used])


def main(arguments=None):
    parser = report.options("soak", __doc__)
    parser.add_argument("--hours", type=float, default=24.0, help="of line time (24)")
    parser.add_argument("--axes", type=int, default=1, help="number of axes (1)")
    parser.add_argument("--product", choices=PRODUCTS, help="of all axes (default: all products in turn)")
    parser.add_argument("--period", type=float, default=60.0, help="seconds of a cycle, of which some 4 s are motion (60)")
    parser.add_argument("--warm-up", type=float, default=2.0, help="hours before the reference hours (2)")
    parser.add_argument("--reference", type=float, default=10.0, help="reference hours (10)")
    given = parser.parse_args(arguments)
    out = report.Report("soak", given)
    soak = Soak(given, out)
    interrupted = False
    try:
        soak.run()
    except KeyboardInterrupt:
        interrupted = True
    soak.tell()
    return out.finish(interrupted)


if __name__ == "__main__":
    sys.exit(main())
