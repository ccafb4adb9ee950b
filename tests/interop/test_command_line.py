"""The program's client commands on its own line, its log, and its messages for wrong use."""

import json
import pathlib
import re
import signal
import socket
import subprocess

import can
import pytest
from line import COUNTS, PROGRAM, TWO_DRIVES, ApiError, servodrome, wait_for

pytestmark = pytest.mark.program("the commands of the program connect to the line")


@pytest.fixture
def client(line):
    """client(COMMAND, ...): a client command on the line's bus."""
    link = line.links["can0"][0]
    return lambda command, *arguments, **options: servodrome(command, "--bus", link, *arguments, **options)


def test_scan(client):
    found = json.loads(client("scan", "--timeout", "5", "--json"))
    assert [node["node"] for node in found["nodes"]] == [1, 2]
    assert "Sapphire" in client("scan", "--timeout", "5")
    assert [(node["recognised_as"], node["recognised_by"]) for node in found["nodes"]] == [
        ("ismc", "identity"), ("generic402", "identity")]


def test_scan_lists_the_buses_of_this_computer():
    found = json.loads(servodrome("scan", "--buses", "--json", status=None))["buses"]
    interfaces = [folder for folder in pathlib.Path("/sys/class/net").iterdir() if (folder / "type").exists()]
    kinds = {folder.name: (folder / "type").read_text().strip() for folder in interfaces}
    cards = {name for name, kind in kinds.items() if kind == "1" and not (pathlib.Path("/sys/class/net") / name / "wireless").exists()
             and not (pathlib.Path("/sys/class/net") / name / "bridge").exists()}
    assert {bus["bus"] for bus in found if bus["bus"].startswith("raw:")} == {f"raw:{name}" for name in cards}
    assert {bus["bus"] for bus in found if bus["bus"].startswith("socketcan:")} == {
        f"socketcan:{name}" for name, kind in kinds.items() if kind == "280"}


@pytest.mark.once
def test_a_drive_is_recognised_by_a_makers_file_or_by_its_objects(start_line, tmp_path):
    sheet = tmp_path / "ax402.eds"
    text = servodrome("export", "eds", "ismc")
    sheet.write_text(re.sub(r"(?m)^VendorNumber=.*$", "VendorNumber=0x12345678", text))
    values = sheet.read_text()
    # 1018h sub 1, as the node reports it.
    values = re.sub(r"(?ms)(^\[1018sub1\].*?^DefaultValue=)\S*", r"\g<1>0x12345678", values)
    sheet.write_text(values)
    line = start_line(f'[[bus]]\nname = "can0"\n[[axis]]\nname = "ax"\ndescription = "{sheet}"\nbus = "can0"\nnode = 3\n')
    scan = ["scan", "--bus", line.links["can0"][0], "--timeout", "5", "--json"]
    (node,) = json.loads(servodrome(*scan))["nodes"]
    assert node["vendor_id"] == 0x12345678
    assert (node["recognised_as"], node["recognised_by"], node["product"]) == ("ismc", "objects", "ismc"), node
    (node,) = json.loads(servodrome(*scan, "--eds", sheet))["nodes"]
    assert node["recognised_by"] == "description" and node["recognised_as"].endswith("(ax402.eds)"), node
    assert str(tmp_path) in servodrome(*scan, "--eds", tmp_path / "none.eds", status=2)
    assert "each drive answers to 127" in servodrome("scan", "--bus", "serial10:serial:/nowhere", "--last", 127, status=2)


def test_get_and_set(client, bench):
    client("set", "--timeout", "30", "--node", "2", "6083", "123456")
    assert "123456" in client("get", "--timeout", "30", "--node", "2", "6083")
    assert bench.get("axes/reference/objects/6083/0")["value"] == 123456
    assert "0602" in client("get", "--timeout", "30", "--node", "1", "5FFF", status=1)


def test_what_a_drive_refuses_does_not_keep_the_others_from_being_read(line):
    command = [PROGRAM, "get", "--bus", line.links["can0"][0], "--timeout", "30", "--node", "1", "6041", "5FFF", "6064"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 1 and "5FFF:00" in done.stderr and "0602" in done.stderr
    assert "6041:00" in done.stdout and "6064:00" in done.stdout
    done = subprocess.run([*command, "--json"], capture_output=True, text=True, timeout=120, check=False)
    read = json.loads(done.stdout)
    assert done.returncode == 1 and [("error" in one) for one in read] == [False, True, False]
    assert "0602" in read[1]["error"] and isinstance(read[2]["value"], int)


def test_objects_have_the_types_and_units_of_the_product(start_line):
    """The iSMK's 6080h is 16 bits wide; CiA 402 has 32."""
    line = start_line('[[bus]]\nname = "can0"\n[[axis]]\nname = "k"\nproduct = "ismk"\nbus = "can0"\nnode = 4\n')
    drive = ["--timeout", "30", "--node", "4"]

    def client(command, *arguments, **options):
        return servodrome(command, "--bus", line.links["can0"][0], *arguments, **options)

    client("set", *drive, "6080", "2500")
    assert json.loads(client("get", *drive, "6080", "--json"))["type"] == "UNSIGNED16"
    client("set", *drive, "6080", "40000000", status=2)
    assert "abc" in client("set", *drive, "6080", "abc", status=2)
    alone, beside = (client("monitor", *drive, *objects, "--seconds", "0.1") for objects in (["6064"], ["6064", "2601"]))
    assert " inc" in alone and " inc" in beside


def test_monitor_shows_objects(line, client, tmp_path):
    command = [PROGRAM, "monitor", "--bus", line.links["can0"][0], "--timeout", "30", "--node", "2"]
    done = subprocess.run([*command, "6040", "5FFF", "6041", "--seconds", "0.2"], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0 and "5FFF:00" in done.stderr
    assert ["6040:00" in done.stdout, "6041:00" in done.stdout] == [True, True]
    assert "5FFF" in client("monitor", "--timeout", "30", "--node", "2", "5FFF", "--seconds", "0.2", status=1)
    assert "--units" in client("monitor", "--node", "2", "6064", "--units", "rpm", status=2)
    assert "not both" in client("monitor", "--node", "2", "6064", "--axis", status=2)
    shown = tmp_path / "monitor.txt"
    with open(shown, "wb") as output:
        watching = subprocess.Popen([*command, "6083", "--interval", "1000"], stdout=output)
    try:
        wait_for(lambda: b"6083:00" in shown.read_bytes(), "the first look")
    finally:
        watching.send_signal(signal.SIGINT)
        assert watching.wait(100) == 0, "it ends though the next look is far off"


@pytest.mark.once
def test_home_and_move(client, bench):
    client("home", "--node", "2", "--method", "24", "--speed", "500000", "--zero-speed", "50000")
    before = bench.true_position("reference")
    client("move", "--node", "2", "--by", "131072")
    wait_for(lambda: abs(bench.true_position("reference") - before - COUNTS) <= 8, "the move")
    moved = json.loads(client("move", "--node", "2", "--by", "10", "--units", "mm", "--feed", "5", "--velocity", "20", "--json"))
    wait_for(lambda: abs(bench.true_position("reference") - before - 3 * COUNTS) <= 8, "two revolutions more")
    assert moved["units"] == "mm" and abs(moved["position_in_units"] - 5 * moved["position"] / COUNTS) < 1e-9
    assert " mm" in client("move", "--node", "2", "--by", "-10", "--units", "mm", "--feed", "5")
    assert " deg" in client("monitor", "--axis", "--node", "2", "--units", "degrees", "--seconds", "0.2")
    for wrong in (["--units", "mm"], ["--feed", "5"], ["--units", "miles"], ["--units", "rpm", "--revolutions"],
                  ["--units-per-revolution", "5"], ["--units", "mm", "--feed", "0"], ["--units", "mm", "--feed", "nan"]):
        client("move", "--node", "2", "--by", "1", *wrong, status=2)
    assert "--units-per-revolution" in client("move", "--node", "1", "--by", "0", "--units", "rpm", status=1)


@pytest.mark.once
def test_parameters_go_back_to_the_factorys(line, client):
    def params(*words, **options):
        return servodrome("params", *words, "--node", "2", "--bus", line.links["can0"][0], **options)

    client("move", "--node", "2", "--by", "1000")
    assert "disable it" in params("load", "--factory", status=1)
    assert json.loads(client("disable", "--node", "2", "--json")) == {"node": 2, "state": "switch on disabled"}
    client("set", "--node", "2", "6083", "123456")
    client("set", "--node", "2", "6099:01", "4321")
    assert "2 of" in params("diff", "--factory", status=1)
    assert json.loads(params("load", "--factory", "--json"))["written"] == ["6083:00", "6099:01"]
    params("diff", "--factory")
    params("load", status=2)
    params("load", "any.par", "--factory", status=2)


def leave_it_turning(line):
    """The axis turns on without a master that it monitors, and brakes in two seconds on halt."""
    command = [PROGRAM, "jog", "--bus", line.links["can0"][0], "--node", "2", "--velocity", str(-COUNTS), "--acceleration", str(COUNTS // 2),
               "--seconds", "60", "--no-watch"]
    jog = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
    try:
        wait_for(lambda: velocity_of(line) < -55 or jog.poll() is not None, "the axis to turn")
        assert jog.poll() is None
    finally:
        jog.kill()
        jog.wait()


def assert_disabled(line):
    assert line.bench.axis("reference")["state"] == "switch on disabled"
    assert abs(velocity_of(line)) < 1


@pytest.mark.once
def test_disable_stops_an_axis_after_a_controlword_that_resets_faults(line, client):
    leave_it_turning(line)
    client("set", "--node", "2", "6040", "128")
    client("disable", "--node", "2")
    assert_disabled(line)


@pytest.mark.once
def test_disable_switches_off_if_the_halt_fails(line):
    """While the axis brakes, the answers to a read and to its repetition are lost."""
    leave_it_turning(line)
    command = [PROGRAM, "disable", "--bus", line.links["can0"][0], "--node", "2"]
    disable = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    halt = 0x010F
    wait_for(lambda: line.bench.get("axes/reference/objects/6040/0")["value"] == halt or disable.poll() is not None, "the halt")
    line.bench.post("buses/can0/disturb", {"drop": 1, "id": 0x582, "limit": 2})
    out, said = disable.communicate(timeout=60)
    assert disable.returncode == 0 and "switch on disabled" in out, (disable.returncode, out, said)
    assert "The motor is off nevertheless" in said, said
    assert_disabled(line)


@pytest.mark.once
def test_jog_for_some_time_and_faults(client, bench):
    jogged = json.loads(client("jog", "--node", "2", "--velocity", "131072", "--seconds", "0.5", "--json"))
    assert jogged["result"] == "jogged" and jogged["state"] == "operation enabled"
    assert "--seconds" in client("jog", "--node", "2", "--velocity", "1", status=2)
    assert json.loads(client("faults", "--node", "2", "--json"))["active"] == []
    bench.post("axes/reference/faults", {"inject": "over_voltage"})
    wait_for(lambda: bench.get("axes/reference")["state"] == "fault", "the fault")
    said = client("faults", "--node", "2", status=1)
    assert "fault is active" in said, said


@pytest.mark.once
@pytest.mark.parametrize("command", ["jog", "torque", "monitor", "sniff", "state", "scope", "tune"])
def test_a_duration_has_the_same_name_in_every_command(command):
    text = servodrome(command, "--help")
    assert re.search(r"--seconds\b", text) and not re.search(r"--(for|duration)\b", text), text


def test_jog_and_torque_into_an_active_limit_switch_fail(client, bench):
    bench.put("axes/reference/inputs", {"DI1": True})
    for command in (["jog", "--velocity", 1], ["torque", "--percent", 5]):
        said = client(*command, "--node", 2, "--revolutions", "--seconds", 1, status=1)
        assert "where the positive limit switch is active (60FDh)" in said, said


@pytest.mark.once
def test_torque_ends_after_its_seconds_although_the_slope_takes_longer(client):
    said = client("torque", "--node", 2, "--percent", 50, "--slope", 5, "--seconds", 0.3)
    assert "stopped before the drive reported the torque as reached" in said, said
    said = client("torque", "--node", 2, "--percent", -2, "--slope", 100, "--seconds", 0.3)
    assert "applied torque and stopped" in said, said


def test_the_words_of_an_ismk_are_its_own(start_line):
    line = start_line('[[bus]]\nname = "can0"\n[[axis]]\nname = "ismk"\nproduct = "ismk"\nbus = "can0"\nnode = 4\n')
    drive = ["--bus", line.links["can0"][0], "--node", 4]
    said = servodrome("home", *drive, "--method", 17, "--speed", 1, "--zero-speed", 1, "--acceleration", 20, "--revolutions", status=1)
    assert "homing error" in said and "homing attained" not in said, said
    servodrome("set", *drive, 6060, -4)
    assert "commutation found" in servodrome("monitor", *drive, "--axis", "--seconds", 0.2)


@pytest.mark.once
def test_run_a_script(client, bench, tmp_path):
    script = tmp_path / "there.script"
    script.write_text("axis it 2\nunits revolutions\nenable\nmove by 1 velocity 4\nexpect 603F == 0\ndisable\n")
    assert "4 steps for 1 axis, no mistakes" in client("run", "--check", script)
    before = bench.true_position("reference")
    ran = json.loads(client("run", script, "--json"))
    assert ran["passed"] and [step["line"] for step in ran["steps"]] == [3, 4, 5, 6]
    wait_for(lambda: abs(bench.true_position("reference") - before - COUNTS) <= 50, "the move")
    script.write_text("axis it 2\nenable\nexpect 603F == 5\n")
    assert f"{script}:3:1: " in client("run", script, status=1)
    script.write_text("repeat 0\nenable\nend\n")
    assert client("run", "--check", script, status=2).count(f"{script}:") == 1
    script.write_text("enabel\n")
    assert f"{script}:1:1: " in client("run", script, status=2)


@pytest.mark.once
def test_prove(client):
    table = client("prove")
    assert "ismc" in table.lower() or "sapphire" in table.lower()


@pytest.mark.once
def test_prove_moves_nothing_if_other_drives_are_there_than_expected(client, bench):
    before = bench.get("axes/reference")["position_counts"]
    said = client("prove", "--expect", "ismc,ismc", status=1)
    assert "nothing has moved" in said and "ismc, generic402" in said, said
    assert "generic402" in client("prove", "--expect", "generic40", status=2)
    now = bench.get("axes/reference")
    assert now["position_counts"] == before and now["state"] == "switch on disabled"


@pytest.mark.once
def test_prove_fails_when_a_drive_does(client, bench):
    bench.put("axes/reference/plant", {"locked_rotor": True})
    client("prove", "--timeout", "5", status=1)


def test_monitor_shows_decoded_frames(line, tmp_path):
    shown = tmp_path / "monitor.txt"
    with open(shown, "wb") as output:
        monitor = subprocess.Popen([PROGRAM, "monitor", "--bus", line.links["can0"][0]], stdout=output)
    try:

        def boots():
            line.bench.post("axes/ismc/power", {"action": "cycle"})
            return "boot" in shown.read_text().lower()

        wait_for(boots, lambda: f"a boot-up in {shown.read_text()!r}")
    finally:
        monitor.send_signal(signal.SIGINT)
        assert monitor.wait(30) == 0


def velocity_of(line):
    return line.bench.axis("reference")["velocity_rpm"]


@pytest.mark.once
def test_an_axis_is_stopped_when_the_terminal_goes_away(line):
    command = [PROGRAM, "jog", "--bus", line.links["can0"][0], "--node", "2", "--velocity", str(COUNTS // 8), "--seconds", "60"]
    jog = subprocess.Popen(
        command,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        preexec_fn=lambda: signal.signal(signal.SIGHUP, signal.SIG_DFL),  # the tests' parent process may ignore it
    )
    wait_for(lambda: velocity_of(line) > 5, "the axis to turn")
    jog.send_signal(signal.SIGHUP)
    assert jog.communicate(timeout=60)[1] and jog.returncode == 128 + signal.SIGHUP
    wait_for(lambda: abs(velocity_of(line)) < 1, "the axis at rest")


@pytest.mark.once
def test_an_axis_is_stopped_when_the_reader_goes_away(line, tmp_path):
    script = tmp_path / "p.script"
    script.write_text(
        f"axis a 2\na enable\na velocity {COUNTS // 8} acceleration {COUNTS}\n" + 'print "on"\nwait 0.2\n' * 10
    )
    run = subprocess.Popen([PROGRAM, "run", "--bus", line.links["can0"][0], script], stdout=subprocess.PIPE)
    wait_for(lambda: velocity_of(line) > 5, "the axis to turn")
    run.stdout.close()
    assert run.wait(60) != -signal.SIGPIPE
    wait_for(lambda: abs(velocity_of(line)) < 1, "the axis at rest")


@pytest.mark.once
def test_parameters_are_saved_behind_a_link(line, tmp_path):
    (tmp_path / "link.par").symlink_to(tmp_path / "real.par")
    (tmp_path / "real.par").write_text("old")
    servodrome("params", "save", tmp_path / "link.par", "--bus", line.links["can0"][0], "--node", "2")
    assert (tmp_path / "link.par").is_symlink()
    assert "generic402" in (tmp_path / "real.par").read_text()


@pytest.mark.once
def test_parameters_are_saved_with_o_as_other_commands_do(line, tmp_path):
    drive = ("--bus", line.links["can0"][0], "--node", "2")
    servodrome("params", "save", tmp_path / "positional.par", *drive)
    servodrome("params", "save", "-o", tmp_path / "option.par", *drive)
    assert (tmp_path / "option.par").read_text() == (tmp_path / "positional.par").read_text()
    assert "give one FILE" in servodrome("params", "save", *drive, status=2)
    assert "give one FILE" in servodrome("params", "save", tmp_path / "a.par", "-o", tmp_path / "b.par", *drive, status=2)
    assert not (tmp_path / "a.par").exists()


@pytest.mark.once
def test_candump_log_is_read_by_python_can(start_line, connect, tmp_path):
    line = start_line(log=tmp_path / "bus.log")
    network = connect(line)
    network.send(0x601, bytes.fromhex("4000100000000000"))
    network.seen.wait(0x581)
    line.stop()
    frames = [(f.arbitration_id, bytes(f.data).hex()) for f in can.CanutilsLogReader(tmp_path / "bus.log")]
    assert (0x601, "4000100000000000") in frames
    assert (0x581, "4300100092010200") in frames
    assert frames[0] == (0x701, "00")


@pytest.mark.once
def test_a_line_that_cannot_start_says_why(tmp_path):
    assert "--nonsense" in servodrome("up", "--nonsense", status=2)
    assert "no-such.toml" in servodrome("up", tmp_path / "no-such.toml", status=2)

    wrong = tmp_path / "wrong.toml"
    wrong.write_text(TWO_DRIVES.replace('product = "ismc"', 'product = "imsc"'))
    said = servodrome("up", wrong, status=2)
    row = 1 + TWO_DRIVES.split("\n").index('product = "ismc"')
    assert re.search(rf"wrong\.toml:{row}:\d+: ", said) and "ismc" in said, said
    checked = subprocess.run([PROGRAM, "check", wrong], capture_output=True, text=True, check=False)
    assert checked.returncode == 2 and f"wrong.toml:{row}:" in checked.stdout + checked.stderr

    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        said = servodrome("up", "--api", "127.0.0.1:0", "--bus", f"socketcand:127.0.0.1:{port}/can0", status=2)
        assert str(port) in said
        said = servodrome("up", "--api", f"127.0.0.1:{port}", "--bus", "socketcand:127.0.0.1:0/can0", status=2)
        assert str(port) in said
    assert "nocan7" in servodrome("up", "--api", "127.0.0.1:0", "--bus", "socketcan:nocan7", status=2)
    assert "--bus" in servodrome("up", "--bus", "pigeon:7", status=2)

    stored = tmp_path / "stored.toml"
    stored.write_text(TWO_DRIVES.replace('product = "ismc"', 'product = "ismc"\nstore = "no-such-folder/ismc.bin"'))
    assert "no-such-folder/ismc.bin" in servodrome("up", stored, status=2)


@pytest.mark.parametrize("number", ["nan", "inf", "1e300"])
def test_what_is_no_distance_moves_nothing(client, bench, number):
    before = bench.get("axes/reference")
    said = client("move", "--node", "2", "--by", number, status=2)
    assert "--by" in said and number in said.replace("+", ""), said
    client("prove", "--revolutions", number, status=2)
    now = bench.get("axes/reference")
    assert now["state"] == before["state"] == "switch on disabled"
    assert now["position_counts"] == before["position_counts"]


def test_nmt(client, bench):
    said = client("nmt", "begin", "--all", status=2)
    assert "begin" in said and "reset-node" in said and said.strip().isprintable(), said
    sent = json.loads(client("nmt", "start", "--node", "2", "--json"))
    assert sent == {"node": 2, "command": "start", "confirmed": False}
    wait_for(lambda: bench.get("axes/reference")["nmt_state"] == "operational", "NMT start")


def test_output_that_cannot_be_written_is_a_failure(line):
    with open("/dev/full", "wb") as full:
        scan = subprocess.run([PROGRAM, "scan", "--timeout", "5", "--bus", line.links["can0"][0]], stdout=full, stderr=subprocess.PIPE)
    assert scan.returncode == 1 and b"output" in scan.stderr


@pytest.mark.once
@pytest.mark.parametrize(
    "method, path, body, status",
    [
        ("GET", "axes/nobody", None, 404),
        ("GET", "nothing", None, 404),
        ("POST", "axes/ismc", {}, 405),
        ("PUT", "axes/ismc/inputs", {"DI99": True}, 400),
        ("PUT", "axes/ismc/inputs", {"DI0": "yes"}, 400),
        ("PUT", "axes/ismc/plant", {"supply_v": -1}, 422),
        ("POST", "axes/ismc/power", {"action": "explode"}, 422),
        ("POST", "axes/ismc/faults", {"inject": "encoder_los"}, 422),
        ("PUT", "axes/ismc/objects/6060/0", {"value": 55}, 422),
        ("PUT", "axes/ismc/objects/6041/0", {"value": 1}, 409),
        ("GET", "axes/ismc/objects/xyz/0", None, 400),
        ("POST", "clock/advance", {"ms": 1}, 409),
        ("POST", "buses/can0/disturb", {"drop": 2}, 422),
    ],
)
def test_a_wrong_request_is_told_what_is_wrong(line, method, path, body, status):
    with pytest.raises(ApiError) as refusal:
        line.bench.call(method, path, body)
    assert refusal.value.status == status
    assert refusal.value.body, "says why"
    assert line.bench.get("axes/ismc")["state"] == "switch on disabled", "and nothing happened"


@pytest.mark.once
def test_virtual_time_passes_only_when_told(start_line):
    line = start_line(arguments=["--virtual"])
    clock = line.bench.get("clock")
    assert clock["mode"] == "virtual" and line.bench.get("clock") == clock
    assert line.bench.post("clock/advance", {"ms": 1000})["ticks"] == clock["ticks"] + 16_000
