"""The objects of a drive, as its service port sees them."""

from __future__ import annotations

import dataclasses
import re
from typing import Any, Dict, Iterator, List, Mapping, NamedTuple, Optional, Sequence, Tuple, Union

from ._backend import Backend, ObjectAddress, object_text, path, whole
from .errors import UnknownObject, WrongType

ObjectKey = Union[str, int, Tuple[int, int]]
"""An object: 0x607A (sub-index 0), (0x607D, 1), "607D:01", or its name, "Target position"."""

ObjectValue = Union[int, float, bool, str, bytes]
"""The value of an object: bytes of OCTET_STRING and DOMAIN, str of VISIBLE_STRING."""

_ADDRESS = re.compile(r"(?:0[xX])?([0-9A-Fa-f]{4})(?::([0-9A-Fa-f]{1,2}))?")
_OF_BYTES = ("OCTET_STRING", "DOMAIN")
_ABSENT = 0x06020000


class Bit(NamedTuple):
    """A bit of a status, control or I/O word."""

    bit: int
    name: str


class EnumeratedValue(NamedTuple):
    """A value of an object with its meaning."""

    value: int
    name: str


@dataclasses.dataclass(frozen=True)
class ObjectInfo:
    """A row of a drive's object dictionary."""

    index: int
    sub: int
    name: str
    type: str
    """As in the standard: "INTEGER32"."""
    access: str
    """"ro", "wo", "rw" or "const"."""
    unit: str
    pdo: str
    """In which PDOs it can be mapped."""
    saved: bool
    """It survives a power cycle once it is stored (1010h)."""
    minimum: Optional[int]
    maximum: Optional[int]
    default: Optional[int]
    text: str
    """An explanation, or ""."""
    bits: List[Bit]
    enumeration: List[EnumeratedValue]

    @property
    def address(self) -> ObjectAddress:
        """(index, sub), a key of `Objects`."""
        return self.index, self.sub

    def __str__(self) -> str:
        return f"{object_text(self.address)} {self.name}"


def _info_of(row: Mapping[str, Any]) -> ObjectInfo:
    return ObjectInfo(
        index=int(row["index"], 16),
        sub=row["sub"],
        name=row["name"],
        type=row["type"],
        access=row["access"],
        unit=row["unit"],
        pdo=row["pdo"],
        saved=row["saved"],
        minimum=row.get("minimum"),
        maximum=row.get("maximum"),
        default=row.get("default"),
        text=row.get("text", ""),
        bits=[Bit(bit["bit"], bit["name"]) for bit in row.get("bits", ())],
        enumeration=[EnumeratedValue(one["value"], one["name"]) for one in row.get("enumeration", ())],
    )


class Objects(Mapping[ObjectKey, ObjectValue]):
    """The objects of an axis: `x.objects["Target position"] = 1000`, `x.objects[0x607D, 1]`, `x.objects["607D:01"]`.

    Access is that of the drive's service port: it needs no bus and no line time, and the drive refuses what it would refuse
    over its bus (ObjectError, with the abort code). Iteration gives (index, sub) of all objects. Units are those of the
    drive.
    """

    def __init__(self, backend: Backend, axis: str) -> None:
        self._backend = backend
        self._axis = axis
        self._list: Optional[Dict[ObjectAddress, ObjectInfo]] = None
        self._by_name: Dict[str, List[ObjectAddress]] = {}

    def __getitem__(self, key: ObjectKey) -> ObjectValue:
        """Reads an object, as an SDO upload would. Raises UnknownObject, ObjectError, Refused (no power)."""
        answer = self._backend.json("GET", self._path(self.address(key)))
        return _value_of(answer["type"], answer["value"])

    def __setitem__(self, key: ObjectKey, value: ObjectValue) -> None:
        """Writes an object, as an SDO download would. Raises UnknownObject, ObjectError, Refused (no power), WrongType."""
        sent = bytes(value).hex() if isinstance(value, (bytes, bytearray)) else value
        self._backend.json("PUT", self._path(self.address(key)), {"value": sent})

    def __iter__(self) -> Iterator[ObjectAddress]:
        return iter(self._dictionary())

    def __len__(self) -> int:
        return len(self._dictionary())

    def __contains__(self, key: object) -> bool:
        try:
            return self.address(key) in self._dictionary()  # type: ignore[arg-type]
        except (UnknownObject, WrongType):
            return False

    def __repr__(self) -> str:
        return f"<objects of {self._axis}>"

    def info(self, key: ObjectKey) -> ObjectInfo:
        """The row of the dictionary: name, type, access, unit, range. Raises UnknownObject."""
        address = self.address(key)
        try:
            return self._dictionary()[address]
        except KeyError:
            raise self._unknown(object_text(address)) from None

    def address(self, key: ObjectKey) -> ObjectAddress:
        """(index, sub) of an object. Raises UnknownObject for a name that the drive does not have, or has several times."""
        if isinstance(key, str):
            match = _ADDRESS.fullmatch(key)
            return (int(match[1], 16), int(match[2] or "0", 16)) if match else self._named(key)
        index, sub = key if isinstance(key, tuple) and len(key) == 2 else (key, 0)
        if isinstance(index, tuple):
            raise WrongType("a tuple that is not (index, sub-index)", self._axis, "write objects[0x607D, 1]")
        return whole(index, "index", 0, 0xFFFF), whole(sub, "sub-index", 0, 0xFF)

    def read(self, *keys: ObjectKey) -> List[Optional[ObjectValue]]:
        """The values of several objects at one instant, at most 128; None for an object that cannot be read now."""
        addresses = [self.address(key) for key in keys]
        if not addresses:
            return []
        texts = [object_text(address) for address in addresses]
        answer = self._backend.json("GET", path("axes", self._axis, "values", objects=",".join(texts)))["values"]
        known = self._dictionary()
        return [
            None if answer[text] is None else _value_of(known[address].type, answer[text])
            for text, address in zip(texts, addresses)
        ]

    def _path(self, address: ObjectAddress) -> str:
        return path("axes", self._axis, "objects", f"{address[0]:04X}", f"{address[1]:02X}")

    def _dictionary(self) -> Dict[ObjectAddress, ObjectInfo]:
        if self._list is None:
            rows = self._backend.json("GET", path("axes", self._axis, "objects"))["objects"]
            infos = [_info_of(row) for row in rows]
            by_name: Dict[str, List[ObjectAddress]] = {}
            for info in infos:
                by_name.setdefault(info.name, []).append(info.address)
            self._by_name = by_name
            self._list = {info.address: info for info in infos}
        return self._list

    def _named(self, name: str) -> ObjectAddress:
        self._dictionary()
        found: Sequence[ObjectAddress] = self._by_name.get(name, ())
        if len(found) == 1:
            return found[0]
        if not found:
            raise self._unknown(f'"{name}"')
        places = ", ".join(object_text(address) for address in found[:8])
        raise UnknownObject(f'{len(found)} objects have the name "{name}"', self._axis, f"give the index: {places}", _ABSENT)

    def _unknown(self, what: str) -> UnknownObject:
        hint = "`objects.info(key)` and iteration have the objects of this drive; names are those of its data sheet"
        return UnknownObject(f"there is no object {what}", self._axis, hint, _ABSENT, "object does not exist")


def _value_of(kind: str, value: Any) -> ObjectValue:
    if value is None:
        return float("nan")  # a REAL32 that is no number
    if kind in _OF_BYTES:
        return bytes.fromhex(value)
    if kind == "BOOLEAN":
        return bool(value)
    if kind == "REAL32":
        return float(value)
    result: ObjectValue = value
    return result
