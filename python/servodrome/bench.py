"""The test bench of an axis: its wires, its machine, and what can be broken."""

from __future__ import annotations

from typing import Any, Dict, Iterator, List, Mapping, NamedTuple

from ._backend import Backend, path
from .errors import UnknownName, WrongType


class Fault(NamedTuple):
    """An active or past fault, or a warning. Texts are "" where neither the maker nor the standard has one."""

    code: int
    """The error code, as in 603Fh."""
    name: str
    text: str
    cause: str
    remedy: str
    alarm: str
    """The maker's own number."""

    def __str__(self) -> str:
        return f"{self.code:04X}h {self.name}"


def fault_of(view: Mapping[str, Any]) -> Fault:
    """A fault in an answer of the bench API."""
    texts = [str(view.get(key, "")) for key in ("text", "cause", "remedy", "alarm")]
    return Fault(int(view["code"], 16), view["name"], *texts)


class Lamp(NamedTuple):
    """A lamp on the drive's front."""

    name: str
    colour: str
    light: str
    """"off", "on", "blinking", "flickering" or "flashes"."""
    flashes: int
    """Flashes in a group, if the light is "flashes"."""


class Inputs(Mapping[str, bool]):
    """The digital inputs: `x.inputs["DI0"]` is the level, `x.inputs["DI0"] = True` forces it, `release` ends that."""

    def __init__(self, backend: Backend, axis: str) -> None:
        self._backend = backend
        self._axis = axis
        self._path = path("axes", axis, "inputs")

    def __getitem__(self, name: str) -> bool:
        """The present level. Raises UnknownName."""
        return bool(self._views()[self._known(name)]["level"])

    def __setitem__(self, name: str, level: bool) -> None:
        """Forces an input, until release(). Raises UnknownName, WrongType."""
        if not isinstance(level, bool):
            raise WrongType(
                f"{name} is of type {type(level).__name__}", self._axis, "give True or False; release() ends the forcing"
            )
        self._backend.json("PUT", self._path, {self._known(name): level})

    def __iter__(self) -> Iterator[str]:
        return iter(self._views())

    def __len__(self) -> int:
        return len(self._views())

    def release(self, *names: str) -> None:
        """Connects inputs to the switches of the travel again; without a name all."""
        wanted = [self._known(name) for name in names] or list(self._views())
        self._backend.json("PUT", self._path, dict.fromkeys(wanted))

    @property
    def forced(self) -> List[str]:
        """The inputs that are forced."""
        return [name for name, view in self._views().items() if view["forced"]]

    def _views(self) -> Dict[str, Dict[str, bool]]:
        views: Dict[str, Dict[str, bool]] = self._backend.json("GET", self._path)["inputs"]
        return views

    def _known(self, name: str) -> str:
        names = self._views()
        if not isinstance(name, str) or name not in names:
            raise UnknownName(f'there is no input "{name}"', self._axis, f"the inputs are {', '.join(names)}")
        return name

    def __repr__(self) -> str:
        return f"<inputs of {self._axis}: {dict(self)}>"


class Plant:
    """The machine behind the drive. Each attribute can be read and set; a change acts from the next tick on.

    A wrong value raises BadValue or WrongType, and nothing changes. `set` changes several together.
    """

    __slots__ = ("_axis", "_backend", "_path")

    def __init__(self, backend: Backend, axis: str) -> None:
        self._backend = backend
        self._axis = axis
        self._path = path("axes", axis, "plant")

    def set(self, **values: object) -> None:
        """Changes several values together, or none: `x.plant.set(load_torque_nm=0.4, friction_nm=0.02)`."""
        self._backend.json("PUT", self._path, values)

    def view(self) -> Dict[str, Any]:
        """All values."""
        values: Dict[str, Any] = self._backend.json("GET", self._path)
        return values

    @property
    def locked_rotor(self) -> bool:
        """True holds the shaft."""
        return bool(self.view()["locked_rotor"])

    @locked_rotor.setter
    def locked_rotor(self, value: bool) -> None:
        self.set(locked_rotor=value)

    @property
    def load_torque_nm(self) -> float:
        """The torque that the motor must hold, in Nm; positive: the load pulls towards smaller counts."""
        return float(self.view()["load_torque_nm"])

    @load_torque_nm.setter
    def load_torque_nm(self, value: float) -> None:
        self.set(load_torque_nm=value)

    @property
    def load_inertia_kgm2(self) -> float:
        """Inertia of the load at the motor's shaft, in kg m2."""
        return float(self.view()["load_inertia_kgm2"])

    @load_inertia_kgm2.setter
    def load_inertia_kgm2(self, value: float) -> None:
        self.set(load_inertia_kgm2=value)

    @property
    def friction_nm(self) -> float:
        """Coulomb friction of the load, in Nm."""
        return float(self.view()["friction_nm"])

    @friction_nm.setter
    def friction_nm(self, value: float) -> None:
        self.set(friction_nm=value)

    @property
    def supply_v(self) -> float:
        """The rectified supply, in V; 0 is a mains failure."""
        return float(self.view()["supply_v"])

    @supply_v.setter
    def supply_v(self, value: float) -> None:
        self.set(supply_v=value)

    @property
    def ambient_c(self) -> float:
        """The ambient temperature, in degrees Celsius."""
        return float(self.view()["ambient_c"])

    @ambient_c.setter
    def ambient_c(self, value: float) -> None:
        self.set(ambient_c=value)

    @property
    def position_counts(self) -> int:
        """The true position in encoder counts. Setting it puts the axis there at rest; Refused while the motor is energised."""
        return int(self.view()["position_counts"])

    @position_counts.setter
    def position_counts(self, value: int) -> None:
        self.set(position_counts=value)

    def __repr__(self) -> str:
        return f"<plant of {self._axis}: {self.view()}>"


class Injectable(NamedTuple):
    """What `inject` accepts."""

    plant: List[str]
    """Faults of the machine: "encoder_loss", "brake_stuck" ..."""
    drive: Dict[str, int]
    """Causes of faults of the drive, with their error codes."""
