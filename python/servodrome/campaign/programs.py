"""Programs for campaigns about motion. A program gets a line, the parameters and the seed, and returns figures."""

from __future__ import annotations

from typing import Any, Dict, Mapping

from ..line import Line

_SETTLED = 0.02  # of the step


def velocity_step(line: Line, parameters: Mapping[str, Any], seed: int) -> Dict[str, float]:
    """A step of velocity on the first axis. The parameters step_rev_s (5), acceleration_rev_s2 (2000) and time_s (0.3) set it.

    Figures: overshoot_percent, rise_ms (10 to 90 %), settling_ms (to 2 %), error_rpm (at the end).
    """
    axis = next(iter(line.axes.values()))
    target = float(parameters.get("step_rev_s", 5.0))
    acceleration = float(parameters.get("acceleration_rev_s2", 2000.0))
    duration = float(parameters.get("time_s", 0.3))
    axis.enable()
    recording = line.record({"v": axis.signal("velocity_rpm")}, rate=16000)
    axis.velocity(target, acceleration=acceleration, units="revolutions", wait=False)
    line.advance(duration)
    recording.stop()
    axis.disable()
    columns = recording.columns()
    return step_figures(columns["time_s"], columns["v"], 60 * target)


def step_figures(times: Any, values: Any, target: float) -> Dict[str, float]:
    """The figures of a step response from 0 to `target`, in the units of the values."""
    shares = [value / target for value in values]
    begin = times[0]

    def first_above(share: float) -> float:
        return next((time - begin for time, value in zip(times, shares) if value >= share), float("nan"))

    settled = begin
    for time, value in zip(times, shares):
        if abs(value - 1) > _SETTLED:
            settled = time
    return {
        "overshoot_percent": 100 * max(0.0, max(shares) - 1),
        "rise_ms": 1000 * (first_above(0.9) - first_above(0.1)),
        "settling_ms": 1000 * (settled - begin),
        "error_rpm": (shares[-1] - 1) * target,
    }
