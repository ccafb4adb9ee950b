"""Descriptions of axes and buses in Python."""

import math
import pathlib

import numpy
import pytest
import servodrome
from servodrome.tables import line_text

Axis, Bus = servodrome.Axis, servodrome.Bus


def test_the_text_is_that_of_a_line_file():
    axes = [
        Axis("x", "ismc", bus="can0", node=3, travel={"counts_per_unit": 10, "home": {"from": -1.5, "to": 2}}, stage={}),
        Axis("y", description='a "b"\\\n.eds', device=None, bus="can0", ratio=[1, 2.5, {"a": True}]),
    ]
    folder = pathlib.Path.cwd()
    assert line_text(axes, [Bus("can0", bit_rate=500_000)]) == (
        '[[bus]]\nname = "can0"\ntype = "can"\nbit_rate = 500000\n'
        '[[axis]]\nname = "x"\nproduct = "ismc"\nbus = "can0"\nnode = 3\n'
        "[axis.travel]\ncounts_per_unit = 10\n[axis.travel.home]\nfrom = -1.5\nto = 2\n[axis.stage]\n"
        f'[[axis]]\nname = "y"\nbus = "can0"\ndescription = "{folder}/a \\"b\\"\\\\\\u000A.eds"\n'
        "ratio = [1, 2.5, { a = true }]\n"
    )


def test_every_key_reaches_the_parser():
    axis = Axis(
        "x",
        "generic402",
        node=numpy.int32(5),
        serial="rs485",
        bus="can0",
        station=7,
        serial_number=99,
        travel={"start": numpy.float64(12), "switch": [{"wire": 3, "from": 1, "to": 5, "normally_closed": numpy.bool_(True)}]},
        motor={"pole_pairs": 4, "rotor_inertia_kgm2": 1e-05},
        load={"external_torque_nm": 0.25},
        encoder={"counts_per_revolution": 4096},
    )
    with servodrome.Line(axes=[axis]) as line:
        x = line.axes["x"]
        assert x.view()["serial"]["station"] == 7
        assert x.node_id == 5
        assert x.position == 12
        assert x.plant.load_torque_nm == 0.25
        assert x.objects["1018:04"] == 99
        assert "DI3" in x.inputs
        assert {name: bus.type for name, bus in line.buses.items()} == {"can0": "can", "rs485": "rs485"}


@pytest.mark.parametrize(
    "axes, buses",
    [
        ([Axis("x", "jmc_ec")], {"ecat": "ethercat"}),
        ([Axis("x", "ismc")], {"can0": "can"}),
        ([Axis("x", "generic402"), Axis("y", "generic402-ec"), Axis("z", "jmc_ec")], {"can0": "can", "ecat": "ethercat"}),
        ([Axis("x", "jmc_ec", bus="e1"), Axis("y", "jmc_ec", bus="e2")], {"e1": "ethercat", "e2": "ethercat"}),
        ([Axis("x", "jmc_ec", bus="e1"), Axis("y", "jmc_ec")], {"e1": "ethercat"}),
        ([Axis("x", "generic402", serial="line")], {"line": "rs485"}),
        ([Axis("x", "ismk", model="80-075")], {"can0": "can"}),
    ],
)
def test_buses_that_are_not_given_are_made(axes, buses):
    with servodrome.Line(axes=axes) as line:
        assert {name: bus.type for name, bus in line.buses.items()} == buses
        assert list(line.axes) == [axis.name for axis in axes]
        line.advance(0.01)


def test_an_axis_is_on_the_given_bus_of_its_kind():
    buses = [Bus("fast"), Bus("ring", "ethercat")]
    with servodrome.Line([Axis("x", "jmc_ec"), Axis("y", "ismc")], buses) as line:
        assert line.axes["x"].view()["bus"] == "ring"
        assert line.axes["y"].view()["bus"] == "fast"


@pytest.mark.parametrize(
    "axes, buses, what",
    [
        ([Axis("x", "jmc_e")], [], "jmc_ec"),
        ([], [], "no bus"),
        ([Axis("x")], [], "product"),
        ([Axis("x", "ismc")], [Bus("e", "ethercat")], ""),
        ([Axis("x", "ismc")], [Bus("a"), Bus("b")], "bus"),
        ([Axis("x", "ismc", bus="c")], [Bus("a")], "bus"),
        ([Axis("x", "ismc", travel={"low_stp": 1})], [], "low_stop"),
        ([Axis("x", "ismc", travel=[1])], [], "travel"),
        ([Axis("x", "ismc", node=math.nan)], [], "node"),
        ([Axis("x", "ismc", node=500)], [], "node"),
        ([Axis("x y", "ismc")], [], "name"),
        ([Axis("x", "ismc"), Axis("x", "ismc", node=9)], [], "x"),
        ([Axis("x", "ismc", **{"a b": 1})], [], "a b"),
        ([Axis("x", "ismc", motor={"pole_pairs": math.inf})], [], "pole_pairs"),
        ([Axis("x", description="none.eds")], [], "none.eds"),
        ([Axis("\udcff", "ismc")], [], ""),
    ],
)
def test_errors_are_those_of_the_parser(axes, buses, what):
    with pytest.raises(servodrome.LineFileError) as caught:
        servodrome.Line(axes=axes, buses=buses)
    error = caught.value
    assert what in str(error)
    assert error.file == "line.toml"
    text = line_text(axes, buses)
    with pytest.raises(servodrome.LineFileError) as of_text:
        servodrome.Line.from_text(text)
    assert str(of_text.value) == str(error)


@pytest.mark.parametrize(
    "axes, buses",
    [
        (["x"], []),
        ([Axis("x", "ismc")], ["can0"]),
        ([Axis("x", "ismc", node=object())], []),
        ([Axis("x", "ismc", node={1: 2})], []),
        ([Axis("x", "ismc", node=[None])], []),
    ],
)
def test_values_that_toml_does_not_have(axes, buses):
    with pytest.raises(servodrome.WrongType):
        servodrome.Line(axes=axes, buses=buses)


def test_integers_of_more_than_64_bits():
    with pytest.raises(servodrome.BadValue, match="64 bits"):
        servodrome.Line(axes=[Axis("x", "ismc", node=2**63)])


def test_descriptions_can_be_printed():
    assert repr(Axis("x", "ismc", node=1)) == "Axis('x', 'ismc', node=1)"
    assert repr(Bus("can0", bit_rate=5)) == "Bus('can0', 'can', bit_rate=5)"
