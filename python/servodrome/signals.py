"""Values of axes that can be read and recorded."""

from __future__ import annotations

from ._backend import Backend


class Signal:
    """A number of an axis that changes with time: `x.signal("velocity_rpm")`, `x.signal("6064:00")`, `x.signal("DI0")`."""

    __slots__ = ("_backend", "axis", "channel", "name")

    axis: str
    name: str
    channel: int
    """Its number in the line."""

    def __init__(self, backend: Backend, axis: str, name: str) -> None:
        self._backend = backend
        self.axis = axis
        self.name = name
        self.channel = backend.channel(axis, name)

    @property
    def value(self) -> float:
        """The present value; NaN: the axis has no power."""
        return self._backend.read((self.channel,))[0]

    def belongs_to(self, backend: Backend) -> bool:
        """True if the signal is of this line."""
        return self._backend is backend

    def __repr__(self) -> str:
        return f"<signal {self.name} of {self.axis}>"
