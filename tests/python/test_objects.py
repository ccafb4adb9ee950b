"""The object dictionary of an axis."""

import math

import numpy
import pytest
import servodrome

RANGE = 0x607D  # software position limit: 1 the minimum, 2 the maximum


def test_all_ways_to_name_an_object(x):
    objects = x.objects
    objects["607D:01"] = -5
    for key in ((RANGE, 1), "607D:01", "607d:1", "0x607D:01", (numpy.int64(RANGE), numpy.uint8(1))):
        assert objects[key] == -5
    objects["Target position"] = 12
    for key in (0x607A, (0x607A, 0), "607A", "607A:00", "0x607a"):
        assert objects[key] == 12
        assert key in objects
        assert objects.info(key).name == "Target position"
        assert objects.address(key) == (0x607A, 0)


def test_types_of_values(x, line):
    assert x.objects[0x1008] == "Reference drive" or isinstance(x.objects[0x1008], str)
    assert x.objects[0x1000] == 0x00020192
    x.objects["Target velocity"] = -1000
    assert x.objects["Target velocity"] == -1000
    x.objects["Target velocity"] = numpy.int32(7)
    assert x.objects["Target velocity"] == 7
    kinds = {x.objects.info(address).type for address in x.objects}
    readable = [a for a in x.objects if x.objects.info(a).access != "wo"]
    by_type = {"VISIBLE_STRING": str, "BOOLEAN": bool, "REAL32": float, "OCTET_STRING": bytes, "DOMAIN": bytes}
    seen = set()
    for address, value in zip(readable, x.objects.read(*readable[:128])):
        if value is not None:
            kind = x.objects.info(address).type
            assert type(value) is by_type.get(kind, int), (address, kind)
            seen.add(kind)
    assert seen & kinds >= {"UNSIGNED32", "UNSIGNED16", "UNSIGNED8", "VISIBLE_STRING"}


def test_iteration_and_length(x):
    addresses = list(x.objects)
    assert len(addresses) == len(x.objects) > 300
    assert addresses == sorted(addresses)
    assert all(address in x.objects for address in addresses)
    assert (0x6041, 0) in addresses


def test_the_row_of_an_object(x):
    info = x.objects.info("Statusword")
    assert (info.index, info.sub, info.type, info.access) == (0x6041, 0, "UNSIGNED16", "ro")
    assert str(info) == "6041:00 Statusword"
    assert (10, "target reached") in [(bit.bit, bit.name) for bit in info.bits]
    modes = x.objects.info("Modes of operation")
    assert (1, "profile_position") in [(one.value, one.name) for one in modes.enumeration]
    limits = x.objects.info("Modes of operation")
    assert limits.minimum <= 1 <= limits.maximum


@pytest.mark.parametrize("key", ["No such name", "9999:00", 0x9999, (0x607D, 9), (0x9999, 1)])
def test_objects_that_do_not_exist(x, key):
    assert key not in x.objects
    assert x.objects.get(key, "none") == "none"
    for use in (lambda: x.objects[key], lambda: x.objects.__setitem__(key, 1), lambda: x.objects.info(key)):
        with pytest.raises(servodrome.UnknownObject) as caught:
            use()
        assert isinstance(caught.value, KeyError)
        assert caught.value.abort in (0x06020000, 0x06090011)
        assert "x" in caught.value.where


def test_a_name_of_several_objects_lists_them(x):
    with pytest.raises(servodrome.UnknownObject, match="have the name") as caught:
        x.objects["Transmission type"]
    assert "1400:02" in caught.value.hint


@pytest.mark.parametrize("key", [1.5, None, (1,), (1, 2, 3), b"6041", ("6041", 0)])
def test_keys_of_another_type(x, key):
    assert key not in x.objects
    with pytest.raises(TypeError):
        x.objects[key]


@pytest.mark.parametrize("key", [-1, 0x10000, (0x607D, 256), (0x607D, -1)])
def test_keys_out_of_range(x, key):
    with pytest.raises(ValueError):
        x.objects[key]


@pytest.mark.parametrize(
    "key, value, abort, says",
    [
        ("Statusword", 1, 0x06010002, None),  # read only
        ("Target position", 2**40, 0x06090031, "outside INTEGER32, -2147483648 .. 2147483647"),
        ("Target position", -(2**40), 0x06090032, "outside INTEGER32, -2147483648 .. 2147483647"),
        ("Homing method", 99, 0x06090030, None),
    ],
)
def test_refusals_have_the_abort_code(x, key, value, abort, says):
    before = x.objects[key]
    with pytest.raises(servodrome.ObjectError) as caught:
        x.objects[key] = value
    assert caught.value.abort == abort
    assert (says or caught.value.abort_text) in caught.value.what
    assert not isinstance(caught.value, KeyError)
    assert x.objects[key] == before


@pytest.mark.parametrize("value", ["1", 1.5, None, [1], {}, object()])
def test_values_of_another_type(x, value):
    with pytest.raises(servodrome.WrongType):
        x.objects["Target position"] = value
    assert x.objects["Target position"] == 0


def test_a_value_that_is_no_number(x):
    with pytest.raises(servodrome.BadValue, match="NaN or infinite"):
        x.objects["Target position"] = math.nan


def test_several_objects_at_once(x, line):
    assert x.objects.read("Statusword", (0x607D, 1), "9999:00") == [x.statusword, x.objects[RANGE, 1], None]
    assert x.objects.read() == []
    with pytest.raises(servodrome.WrongType, match="128"):
        x.objects.read(*[0x6041] * 129)


def test_without_power(x):
    x.power("off")
    with pytest.raises(servodrome.Refused, match="no power"):
        x.objects["Statusword"]
    with pytest.raises(servodrome.Refused, match="no power"):
        x.objects["Target position"] = 1
    assert x.objects.read("Statusword") == [None]
    assert x.objects.info("Statusword").index == 0x6041
    x.power("on")
    assert x.objects["Target position"] == 0
