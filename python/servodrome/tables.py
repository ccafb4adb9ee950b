"""A line without a file: descriptions of axes and buses, written as the text of a line file."""

from __future__ import annotations

import math
import numbers
import os
import re
from typing import Any, Dict, Iterator, List, Mapping, Optional, Sequence, Tuple, Union

from .errors import BadValue, Error, WrongType

TomlValue = Union[str, bool, int, float, "os.PathLike[str]", Sequence[Any], Mapping[str, Any], None]
"""A value of a key of the line file; None leaves the key out."""

_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")
_FILES = ("store", "description")  # keys with a file's name
_DEFAULT_NAMES = {"can": "can0", "ethercat": "ecat", "rs485": "rs485"}


class Axis:
    """The description of an axis: `Axis("x", "jmc_ec", bus="ecat", travel={"counts_per_unit": 4000, "low_stop": -11})`.

    The keywords are the keys of `[[axis]]` in docs/line-file.md, and its tables (`travel`, `motor`, `load` ...) are dicts.
    A wrong one raises LineFileError when the line is made. Files (`store`, `description`) are relative to the working
    folder. `product` is left out if there is a `description`. Without `bus` and `serial`, the axis is on the line's only
    bus of the kind it needs; a line without buses gets one: "can0" or "ecat".
    """

    name: str
    product: Optional[str]
    keys: Dict[str, TomlValue]

    def __init__(self, name: str, product: Optional[str] = None, **keys: TomlValue) -> None:
        self.name = name
        self.product = product
        self.keys = keys

    def __repr__(self) -> str:
        return f"Axis({self.name!r}, {self.product!r}{_keywords(self.keys)})"


class Bus:
    """The description of a bus: `Bus("can0", bit_rate=500_000)`; `type` is "can", "ethercat" or "rs485".

    The keywords are the keys of `[[bus]]` in docs/line-file.md.
    """

    name: str
    type: str
    keys: Dict[str, TomlValue]

    def __init__(self, name: str, type: str = "can", **keys: TomlValue) -> None:
        self.name = name
        self.type = type
        self.keys = keys

    def __repr__(self) -> str:
        return f"Bus({self.name!r}, {self.type!r}{_keywords(self.keys)})"


def _keywords(keys: Mapping[str, TomlValue]) -> str:
    return "".join(f", {key}={value!r}" for key, value in keys.items())


def line_text(axes: Sequence[Axis], buses: Sequence[Bus]) -> str:
    """The text of a line file with these axes and buses, and with the buses that the axes need besides."""
    for axis in axes:
        if not isinstance(axis, Axis):
            raise WrongType(f"an axis of type {type(axis).__name__}", "axes", "give servodrome.Axis(name, product, ...)")
    for bus in buses:
        if not isinstance(bus, Bus):
            raise WrongType(f"a bus of type {type(bus).__name__}", "buses", "give servodrome.Bus(name, type, ...)")
    tables, used = _with_buses(axes, buses)
    lines: List[str] = []
    for bus in tables:
        lines += ["[[bus]]", *_table("bus", {"name": bus.name, "type": bus.type, **bus.keys})]
    for axis, on in zip(axes, used):
        head: Dict[str, TomlValue] = {"name": axis.name, "product": axis.product, "bus": on, **axis.keys}
        for key in _FILES:
            if head.get(key) is not None and isinstance(head[key], (str, os.PathLike)):
                head[key] = os.path.abspath(os.fspath(head[key]))  # type: ignore[arg-type]
        lines += ["[[axis]]", *_table("axis", head)]
    return "\n".join(lines) + "\n"


def _with_buses(axes: Sequence[Axis], buses: Sequence[Bus]) -> Tuple[List[Bus], List[Optional[str]]]:
    """The buses, with those that are named or needed but not described; and for each axis the bus of its fieldbus."""
    tables = {bus.name: bus for bus in buses}
    used: List[Optional[str]] = []
    for axis in axes:
        name = axis.keys.get("bus")
        serial = axis.keys.get("serial")
        if isinstance(serial, str) and not buses and serial not in tables:
            tables[serial] = Bus(serial, "rs485")
        if name is None and serial is None:
            name = _bus_for(axis, tables, can_add=not buses)
        elif isinstance(name, str) and not buses and name not in tables:
            tables[name] = Bus(name, kind_of(axis) or "can")
        used.append(name if isinstance(name, str) else None)
    return list(tables.values()), used


def _bus_for(axis: Axis, tables: Dict[str, Bus], can_add: bool) -> Optional[str]:
    """The only bus of the kind that the axis needs, or a new one; None leaves the choice to the parser, and its error."""
    if len(tables) == 1 and not can_add:
        return None
    kind = kind_of(axis) or "can"  # if the parser accepts it nowhere, it says why
    fitting = [bus.name for bus in tables.values() if bus.type == kind]
    if len(fitting) == 1:
        return fitting[0]
    if not can_add or fitting:
        return None
    tables[_DEFAULT_NAMES[kind]] = Bus(_DEFAULT_NAMES[kind], kind)
    return _DEFAULT_NAMES[kind]


def kind_of(axis: Axis) -> Optional[str]:
    """The kind of fieldbus that the axis's product needs: the one with which the parser accepts it. None: neither."""
    from ._library import file_bytes, open_line  # the library is needed only here

    keys = {key: axis.keys.get(key) for key in ("description", "device", "model")}
    for kind in ("can", "ethercat"):
        probe = Axis("probe", axis.product, bus="probe", **keys)
        try:
            open_line(file_bytes(line_text([probe], [Bus("probe", kind)])), b"probe").close()
        except Error:
            continue
        return kind
    return None


# ---- TOML ----


def toml_text(content: Mapping[str, Any]) -> str:
    """The text of a TOML file with arrays of tables at its top, as line files have them."""
    lines: List[str] = []
    for key, value in content.items():
        if not isinstance(value, Mapping) and not _is_tables(value):
            lines.append(f"{_key(key)} = {_value(value, key)}")
    for key, value in content.items():
        if isinstance(value, Mapping):
            lines += [f"[{_key(key)}]", *_table(key, value)]
        elif _is_tables(value):
            for table in value:
                lines += [f"[[{_key(key)}]]", *_table(key, table)]
    return "\n".join(lines) + "\n"


def _is_tables(value: Any) -> bool:
    return isinstance(value, list) and bool(value) and all(isinstance(one, Mapping) for one in value)


def _table(path: str, table: Mapping[str, TomlValue]) -> Iterator[str]:
    """The rows of a table, then its tables with their heads."""
    for key, value in table.items():
        if value is not None and not isinstance(value, Mapping):
            yield f"{_key(key)} = {_value(value, f'{path}.{key}')}"
    for key, value in table.items():
        if isinstance(value, Mapping):
            inner = f"{path}.{_key(key)}"
            yield f"[{inner}]"
            yield from _table(inner, value)


def _key(key: object) -> str:
    if not isinstance(key, str):
        raise WrongType(f"a key of type {type(key).__name__}", "line", "give texts as keys")
    return key if _BARE_KEY.fullmatch(key) else _text(key)


def _text(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    escaped = re.sub(r"[\x00-\x1f\x7f]", lambda match: f"\\u{ord(match[0]):04X}", escaped)
    return f'"{escaped}"'


def _value(value: Any, where: str) -> str:
    if isinstance(value, (str, os.PathLike)):
        return _text(os.fspath(value))
    if isinstance(value, bool) or type(value).__name__ in ("bool_", "bool"):
        return "true" if value else "false"
    if isinstance(value, numbers.Integral):
        number = int(value)
        if not -(2**63) <= number < 2**63:
            raise BadValue(f"{number} has more than 64 bits", where, "give a smaller number")
        return str(number)
    if isinstance(value, numbers.Real):
        real = float(value)
        if math.isfinite(real):
            return repr(real)
        return "nan" if math.isnan(real) else "inf" if real > 0 else "-inf"
    if isinstance(value, Mapping):
        inner = ", ".join(f"{_key(key)} = {_value(one, where)}" for key, one in value.items() if one is not None)
        return "{ " + inner + " }" if inner else "{}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(_value(one, where) for one in value) + "]"
    raise WrongType(f"a value of type {type(value).__name__}", where, "give a text, number, boolean, list or dict")
