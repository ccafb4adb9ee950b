"""`servodrome fit` as a user runs it: a motion on a running line, recorded by `scope` over the bus and by the line."""

import json
import pathlib
import re
import tomllib
import urllib.request

import pytest
from line import bus_text, servodrome

DOCS = pathlib.Path(__file__).parents[2] / "docs"
LOAD = {
    "inertia_kgm2": 1.4e-4,
    "viscous_friction_nms": 1e-4,
    "coulomb_friction_nm": 0.05,
    "static_friction_nm": 0.06,
    "gravity_torque_nm": 0.1,
}
AXIS = (
    bus_text("can0")
    + '[[axis]]\nname = "x"\nproduct = "generic402"\nbus = "can0"\nnode = 2\n'
    + "[axis.motor]\nbrake_torque_nm = 1.5\n[axis.load]\n"
    + "".join(f"{key} = {value}\n" for key, value in LOAD.items())
)
# Of the default motor (docs/line-file.md) with this load.
TRUE = {
    "resistance_ohm": 0.775,
    "quadrature_inductance_h": 3.355e-3,
    "torque_constant_nm_per_a": 0.47,
    "inertia_kgm2": 0.28e-4 + LOAD["inertia_kgm2"],
    "coulomb_friction_nm": 0.05,
    "viscous_friction_nms": 1e-4,
    "gravity_torque_nm": 0.1,
}
SIGNALS = [
    "position_counts",
    "velocity_rpm",
    "temperature_c",
    "current_a",
    "direct_current_a",
    "quadrature_voltage_v",
    "direct_voltage_v",
]


def figures_of(*arguments):
    figures = json.loads(servodrome("fit", "--json", *arguments))["figures"]
    return {figure["parameter"]: figure for figure in figures}


@pytest.mark.once
@pytest.mark.program("the program is the master")
def test_an_axis_is_found_again(start_line, tmp_path):
    line = start_line(AXIS)
    script = tmp_path / "fit.script"
    script.write_text(re.search(r"```\n(units revolutions\n.*?)```", (DOCS / "fit.md").read_text(), re.S)[1])
    channels = [{"axis": "x", "signal": signal} for signal in SIGNALS]
    recording = line.bench.post("recordings", {"channels": channels, "duration_ms": 15000})["id"]
    by_bus = [tmp_path / "run.csv", tmp_path / "run.mcap"]
    link = line.links["can0"][0]
    outputs = [word for file in by_bus for word in ("-o", file)]
    what = ["position", "velocity", "torque", "--rate", "500", "--run", script, *outputs]
    servodrome("scope", "--bus", link, "--node", "2", *what)
    line.bench.post(f"recordings/{recording}/stop", {})
    own = tmp_path / "x.csv"
    with urllib.request.urlopen(f"{line.bench.url}/recordings/{recording}/data.csv", timeout=60) as data:
        own.write_bytes(data.read())

    # The line's own recording shows all parameters, as in the blind test.
    line_file = line.folder / "line.toml"
    figures = figures_of(own, "--line", line_file)
    for name, true in TRUE.items():
        assert abs(figures[name]["value"] / true - 1) < 0.02, (name, figures[name])
    assert figures["direct_inductance_h"]["value"] is None
    # One and a half ticks of 62.5 us.
    assert abs(figures["voltage_delay_s"]["value"] - 93.75e-6) < 16e-6

    # Over the bus there are only torques in steps of 0.1 % at a low rate: the result is less exact, and the text says
    # so.
    for file in by_bus:
        figures = figures_of(file, "--rated-torque", "1.27", "--counts-per-revolution", "131072")
        for name in ("inertia_kgm2", "coulomb_friction_nm", "gravity_torque_nm"):
            figure = figures[name]
            allowed = max(0.1 * TRUE[name], 2 * figure["half_width_95"])
            assert abs(figure["value"] - TRUE[name]) < allowed, (name, figure)
        assert "vd, vq, id, iq" in figures["resistance_ohm"]["remedy"]
    assert "--counts-per-revolution" in servodrome("fit", by_bus[0], status=1)

    # The output can be pasted into the axis of a line file.
    found = servodrome("fit", own, "--line", line_file, "--toml")
    keys = tomllib.loads(found)["axis"]
    assert abs(keys["motor"]["resistance_ohm"] / TRUE["resistance_ohm"] - 1) < 0.02, found
    assert abs(keys["load"]["inertia_kgm2"] / LOAD["inertia_kgm2"] - 1) < 0.02, found
    pasted = tmp_path / "pasted.toml"
    pasted.write_text(f'{bus_text("can0")}[[axis]]\nname = "x"\nproduct = "generic402"\nnode = 2\n{found}')
    assert "no errors" in servodrome("check", pasted)
    table = servodrome("fit", own, "--line", line_file)
    assert re.search(r"inertia J +0\.00016\d+ +\+-\S+ +kgm2", table), table


@pytest.mark.once
def test_what_is_no_recording(tmp_path):
    short = tmp_path / "short.csv"
    short.write_text("seconds,velocity_actual_value [rpm]\n" + "".join(f"{n / 100},{n}\n" for n in range(50)))
    standing = tmp_path / "standing.csv"
    standing.write_text("seconds,velocity_actual_value [rpm]\n" + "".join(f"{n / 100},0\n" for n in range(500)))
    for file, status, says in (
        (DOCS / "fit.md", 2, 'no column "seconds" or "time_s" comes first'),
        (tmp_path / "nowhere.csv", 2, "cannot be read; check the path"),
        (tmp_path, 2, "cannot be read; check the path"),
        (short, 1, "50 samples are too few; record at least 200"),
        (standing, 1, "the shaft turns by no more than 0 degrees; record while it moves"),
    ):
        said = servodrome("fit", file, status=status)
        assert str(file) in said and says in said, said
    assert "roles are position" in servodrome("fit", short, "--signal", "speed=x", status=2)
    assert "factor" in servodrome("fit", short, "--signal", "velocity=velocity_actual_value@0rpm", status=2)
    assert "omit --axis" in servodrome("fit", short, "--axis", "x", status=2)
    # With a line file, --axis selects the axis of that file.
    line_file = DOCS.parent / "lines/default.toml"
    axis = tomllib.loads(line_file.read_text())["axis"][0]["name"]
    assert "50 samples are too few" in servodrome("fit", short, "--line", line_file, "--axis", axis, status=1)
    assert "choose one with --axis" in servodrome("fit", short, "--line", DOCS.parent / "lines/default.toml", status=2)
    assert "--torque-constant" in servodrome("fit", "--help")
