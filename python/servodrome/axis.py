"""An axis of a running line: its drive, its motor and load."""

from __future__ import annotations

import math
from typing import Any, Dict, List, Optional, Union

from ._backend import Backend, object_text, path, seconds
from .bench import Fault, Injectable, Inputs, Lamp, Plant, fault_of
from .errors import Refused, UnknownName, WrongType
from .jobs import Job
from .objects import ObjectKey, Objects
from .signals import Signal
from .states import AlState, Mode, NmtState, PowerState, al_state_of, mode_of, nmt_state_of, power_state_of

_TIMEOUT_S = 60.0
_LONGEST_TIMEOUT_S = 3600.0
_ROOM_FOR_STOPPING_S = 30.0  # a job that takes longer than its timeout stops the axis before it fails


class LiveAxis:
    """An axis of a line. Positions are encoder counts; the true values are those of the machine, independent of the drive's
    sensors.

    Attributes that the drive must be switched on for raise Refused without power.
    """

    name: str
    product: str
    """As `servodrome products` lists it."""
    objects: Objects
    """The object dictionary."""
    inputs: Inputs
    """The digital inputs."""
    plant: Plant
    """The machine: load, friction, supply."""

    def __init__(self, backend: Backend, view: Dict[str, Any]) -> None:
        self._backend = backend
        self.name = view["name"]
        self.product = view["product"]
        self.objects = Objects(backend, self.name)
        self.inputs = Inputs(backend, self.name)
        self.plant = Plant(backend, self.name)

    def view(self) -> Dict[str, Any]:
        """The axis as the bench API shows it (docs/bench-api.md, "Axes"), at one instant."""
        view: Dict[str, Any] = self._backend.json("GET", path("axes", self.name))
        return view

    def __repr__(self) -> str:
        return f"<axis {self.name}: {self.product}>"

    # ---- The true values ----

    @property
    def position(self) -> int:
        """The true position, in encoder counts."""
        return int(self._backend.number(self.name, "position_counts"))

    @property
    def velocity_rpm(self) -> float:
        """The true velocity of the shaft, in revolutions per minute."""
        return self._backend.number(self.name, "velocity_rpm")

    @property
    def torque_nm(self) -> float:
        """The torque of the motor, in Nm."""
        return self._backend.number(self.name, "torque_nm")

    @property
    def current_a(self) -> float:
        """The amplitude of the torque-producing current, in A."""
        return self._backend.number(self.name, "current_a")

    @property
    def temperature_c(self) -> float:
        """The temperature of the winding, in degrees Celsius."""
        return self._backend.number(self.name, "temperature_c")

    @property
    def stage_temperature_c(self) -> float:
        """The temperature of the power stage, in degrees Celsius."""
        return self._backend.number(self.name, "stage_temperature_c")

    @property
    def supply_v(self) -> float:
        """The voltage of the DC link, in V."""
        return self._backend.number(self.name, "supply_v")

    @property
    def brake_engaged(self) -> bool:
        """True while the holding brake holds."""
        return bool(self.view()["brake_engaged"])

    # ---- The drive ----

    @property
    def powered(self) -> bool:
        """False while the drive is switched off."""
        return bool(self.view()["powered"])

    @property
    def state(self) -> PowerState:
        """The CiA 402 power state; PowerState.NO_POWER while the drive is switched off."""
        if self._backend.is_real:
            view = self.view()
            return power_state_of(view["state"]) if view["powered"] else PowerState.NO_POWER
        number = self._backend.number(self.name, "state")
        return PowerState.NO_POWER if math.isnan(number) else PowerState(int(number))

    @property
    def statusword(self) -> int:
        """6041h."""
        return int(self._of_drive("statusword"))

    @property
    def controlword(self) -> int:
        """6040h."""
        return int(self._of_drive("controlword"))

    @property
    def mode(self) -> Union[Mode, int]:
        """The present mode (6061h); a plain int if `Mode` does not have it."""
        return mode_of(self._of_drive("mode"))

    @property
    def error_code(self) -> int:
        """603Fh: the code of the latest fault, 0 without one."""
        return int(self._of_drive("error_code"))

    @property
    def homed(self) -> bool:
        """True if the drive knows its home position."""
        return bool(self._of_drive("homed"))

    @property
    def in_motion(self) -> bool:
        """True while the drive moves the axis."""
        return bool(self._of_drive("in_motion"))

    @property
    def node_id(self) -> Optional[int]:
        """The present CANopen node-ID; None if the drive is not on CAN."""
        return self.view().get("node_id")

    @property
    def nmt_state(self) -> Optional[NmtState]:
        """The NMT state; None if the drive is not on CAN."""
        view = self._powered_view()
        return nmt_state_of(view["nmt_state"]) if "nmt_state" in view else None

    @property
    def al_state(self) -> Optional[AlState]:
        """The state of the EtherCAT state machine; None if the drive is not on EtherCAT."""
        view = self._powered_view()
        return al_state_of(view["al_state"]) if "al_state" in view else None

    @property
    def outputs(self) -> Dict[str, bool]:
        """The levels of the digital outputs: {"DO0": True, ...}."""
        return dict(self._of_drive("outputs"))

    @property
    def lamps(self) -> List[Lamp]:
        """The lamps on the drive's front; empty if its manual has none."""
        return [Lamp(one["name"], one["colour"], one["light"], one.get("flashes", 0)) for one in self._of_drive("lamps")]

    def power(self, action: str) -> None:
        """Switches the drive "off" or "on", or off and on ("cycle").

        What is not stored is lost; the shaft keeps its position.
        """
        self._backend.json("POST", path("axes", self.name, "power"), {"action": action})

    # ---- Faults ----

    @property
    def faults(self) -> List[Fault]:
        """The active faults, with their cause and remedy."""
        return [fault_of(one) for one in self._faults()["active"]]

    @property
    def warnings(self) -> List[Fault]:
        """The active warnings: the motion continues."""
        return [fault_of(one) for one in self._faults()["warnings"]]

    @property
    def fault_history(self) -> List[Fault]:
        """The drive's own history of faults, the newest first."""
        return [fault_of(one) for one in self._faults()["history"]]

    @property
    def injections(self) -> List[str]:
        """What is injected at present."""
        return list(self._faults()["injected"])

    @property
    def injectable(self) -> Injectable:
        """What can be injected."""
        able = self._faults()["injectable"]
        return Injectable(list(able["plant"]), {one["cause"]: int(one["code"], 16) for one in able["drive"]})

    def inject(self, fault: Union[str, int]) -> None:
        """Breaks something: "encoder_loss", or the cause of a fault code of the drive: 0x7380.

        It stays through a power cycle. Raises BadValue for a fault that the axis does not have.
        """
        self._backend.json("POST", path("axes", self.name, "faults"), {"inject": _fault_name(fault)})

    def remove(self, *faults: Union[str, int]) -> None:
        """Removes injections; without a name all."""
        for fault in faults:
            self._backend.json("DELETE", path("axes", self.name, "faults"), {"inject": _fault_name(fault)})
        if not faults:
            self._backend.json("DELETE", path("axes", self.name, "faults"))

    # ---- Signals ----

    def signal(self, value: ObjectKey) -> Signal:
        """A value to read or record: a signal of docs/bench-api.md ("velocity_rpm"), an input or output ("DI0"), or an
        object ("6064:00", 0x6064, (0x607D, 1), or its name). Raises UnknownName.
        """
        if not isinstance(value, str) or ":" in value:
            return Signal(self._backend, self.name, object_text(self.objects.address(value)))
        try:
            return Signal(self._backend, self.name, value)
        except UnknownName:
            if value not in self.objects:
                raise
        return Signal(self._backend, self.name, object_text(self.objects.address(value)))

    # ---- Jobs ----

    def job(self, do: str, *, wait: bool = True, timeout: float = _TIMEOUT_S, **keys: Any) -> Job:
        """Begins any job of docs/bench-api.md ("Jobs") with its keys: `x.job("sweep", amplitude=1, units="revolutions")`.

        With `wait` line time passes until it is over, at most `timeout` seconds; JobFailed then has the reason of a
        failure. Without it returns at once. Keys that are None are left out. Raises Refused if the axis has a job or no
        power.
        """
        seconds(timeout, "timeout")
        given = {key: value for key, value in keys.items() if value is not None}
        job = Job(self._backend, self._backend.json("POST", path("axes", self.name, "jobs"), {"do": do, **given}))
        return job.wait(timeout) if wait else job

    def _motion(self, do: str, wait: bool, timeout: float, **keys: Any) -> Job:
        """A motion has the timeout itself, and stops the axis before it fails."""
        limit = seconds(timeout, "timeout")
        if limit <= _LONGEST_TIMEOUT_S:
            keys["timeout_s"] = limit
        return self.job(do, wait=wait, timeout=limit + _ROOM_FOR_STOPPING_S, **keys)

    def enable(self, *, wait: bool = True, timeout: float = _TIMEOUT_S) -> Job:
        """Enables the drive, without a motion. Raises JobFailed, as the other jobs do."""
        return self.job("enable", wait=wait, timeout=timeout)

    def disable(self, *, wait: bool = True, timeout: float = _TIMEOUT_S) -> Job:
        """Disables the drive. Replaces a running job."""
        return self.job("disable", wait=wait, timeout=timeout)

    def reset_fault(self, *, wait: bool = True, timeout: float = _TIMEOUT_S) -> Job:
        """Resets a fault; fails if its cause is still there."""
        return self.job("reset_fault", wait=wait, timeout=timeout)

    def stop(self, *, wait: bool = True, timeout: float = _TIMEOUT_S) -> Job:
        """Halts the axis; it stays enabled. Replaces a running job."""
        return self.job("stop", wait=wait, timeout=timeout)

    def quick_stop(self, *, wait: bool = True, timeout: float = _TIMEOUT_S) -> Job:
        """Stops the axis as 605Ah says. Replaces a running job."""
        return self.job("quick_stop", wait=wait, timeout=timeout)

    def home(
        self,
        *,
        method: Optional[int] = None,
        speed: Optional[float] = None,
        zero_speed: Optional[float] = None,
        acceleration: Optional[float] = None,
        offset: Optional[float] = None,
        units: str = "drive",
        wait: bool = True,
        timeout: float = _TIMEOUT_S,
    ) -> Job:
        """Homes the axis, which must be enabled. What is not given stays as it is in the drive (6098h, 6099h, 609Ah, 607Ch)."""
        return self._motion(
            "home",
            wait,
            timeout,
            method=method,
            speed=speed,
            zero_speed=zero_speed,
            acceleration=acceleration,
            offset=offset,
            units=units,
        )

    def move(
        self,
        *,
        to: Optional[float] = None,
        by: Optional[float] = None,
        velocity: Optional[float] = None,
        acceleration: Optional[float] = None,
        deceleration: Optional[float] = None,
        units: str = "drive",
        beyond: bool = False,
        wait: bool = True,
        timeout: float = _TIMEOUT_S,
    ) -> Job:
        """Moves to a position or by a distance, in profile position mode. The axis must be enabled.

        `units` is "drive" (numbers as in the objects) or "revolutions" (of the motor; per second, per second squared).
        A target beyond the travel is refused, unless `beyond` is true.
        """
        profile = {"velocity": velocity, "acceleration": acceleration, "deceleration": deceleration}
        return self._motion("move", wait, timeout, to=to, by=by, units=units, beyond=beyond or None, **profile)

    def velocity(
        self,
        velocity: float,
        *,
        acceleration: Optional[float] = None,
        deceleration: Optional[float] = None,
        units: str = "drive",
        wait: bool = True,
        timeout: float = _TIMEOUT_S,
    ) -> Job:
        """Runs at a velocity, in profile velocity mode; over when it is reached. The axis continues until stop()."""
        profile = {"acceleration": acceleration, "deceleration": deceleration}
        return self._motion("velocity", wait, timeout, velocity=velocity, units=units, **profile)

    def torque(self, percent: float, *, slope: Optional[float] = None, wait: bool = True, timeout: float = _TIMEOUT_S) -> Job:
        """Runs at a torque in percent of the rated one; over when it is reached. `slope` is in percent per second."""
        return self._motion("torque", wait, timeout, percent=percent, slope=slope)

    # ---- Inside ----

    def _powered_view(self) -> Dict[str, Any]:
        view = self.view()
        if not view["powered"]:
            raise Refused("the axis has no power", self.name, 'switch it on: power("on")')
        return view

    def _of_drive(self, key: str) -> Any:
        return self._powered_view()[key]

    def _faults(self) -> Dict[str, Any]:
        faults: Dict[str, Any] = self._backend.json("GET", path("axes", self.name, "faults"))
        return faults


def _fault_name(fault: Union[str, int]) -> str:
    if isinstance(fault, str):
        return fault
    if isinstance(fault, int) and not isinstance(fault, bool):
        return f"0x{fault:04X}"
    raise WrongType(f"a fault of type {type(fault).__name__}", "fault", 'give a name ("encoder_loss") or a code (0x7380)')
