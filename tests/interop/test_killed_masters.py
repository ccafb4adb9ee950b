"""Kills masters (`servodrome studio` and the commands) at random moments. The axis must come to rest, because the drive
monitors its master."""

import fcntl
import json
import os
import pty
import random
import resource
import signal
import subprocess
import termios
import time

import pytest
from line import COUNTS, PROGRAM, Line, axis_text, bus_text, wait_for
from studio import Studio, patiently

DRIVES = (
    bus_text("can0")
    + bus_text("ecat", "ethercat")
    + axis_text("ismc", "ismc", bus="can0", node=1)
    + axis_text("reference", "generic402", bus="can0", node=2)
    + axis_text("jmc", "jmc_ec", 4000, bus="ecat")
)
# Their names in the studio, units per revolution (for a drive that does not report them), and the time of monitoring
# and stop.
AXES = {"ismc": ("ismc-1", COUNTS, 3.0), "reference": ("generic402-2", None, 3.0), "jmc": ("jmc_ec-1", None, 1.5)}
ROUNDS = 4

pytestmark = [pytest.mark.once, pytest.mark.program("the program is the master")]


@pytest.fixture
def line(tmp_path):
    line = Line(tmp_path, DRIVES, ("can0=socketcand:127.0.0.1:0/can0", "ecat=udp:127.0.0.1:0"))
    yield line
    line.stop()


def speed(line, name):
    return abs(line.bench.axis(name)["velocity_rpm"])


def rests_within(line, name, seconds):
    """Waits in the time of the line, which a busy machine may slow down."""
    begun = line.bench.get("clock")["time_ms"]
    while line.bench.get("clock")["time_ms"] - begun < seconds * 1000:
        time.sleep(0.02)
    assert speed(line, name) < 1, f"{name} turns {seconds} s after its master died"
    time.sleep(0.2)
    assert speed(line, name) < 1


def test_a_drive_that_restarted_watches_the_studio_again(line):
    """The restart takes less time than the studio waits for an answer. Afterwards the studio dies."""
    studio = Studio(line.links["can0"][0])
    axis = "reference"
    name = AXES[axis][0]
    try:
        wait_for(lambda: studio.bench.axis(name).get("watch"), name)
        line.bench.post(f"axes/{axis}/power", {"action": "cycle"})
        wait_for(lambda: line.bench.get(f"axes/{axis}/values?objects=1016:01")["values"]["1016:01"] or 0, "the monitoring")
        wait_for(lambda: studio.bench.axis(name).get("watch"), name)
        studio.does(name, do="enable")
        studio.job(name, do="velocity", velocity=1, acceleration=20, units="revolutions")
        wait_for(lambda: speed(line, axis) > 50, "the motion")
    finally:
        studio.process.kill()
        studio.process.wait()
    rests_within(line, axis, AXES[axis][2])


@pytest.mark.parametrize("axis", AXES)
def test_studio_is_killed_at_random_moments(line, axis):
    name, counts, longest = AXES[axis]
    moments = random.Random(f"studio {axis}")
    order = {"velocity": 0.3 * (counts or 1), "acceleration": 5 * (counts or 1), "units": "drive" if counts else "revolutions"}

    def kill_it():
        studio = Studio(line.links["can0"][0], line.links["ecat"][0])
        try:
            wait_for(lambda: studio.bench.axis(name)["powered"], name)
            assert studio.bench.axis(name)["watch"]["within_s"] < longest
            studio.does(name, do="reset_fault")
            studio.does(name, do="enable")
            studio.job(name, do="velocity", **order)
            time.sleep(moments.uniform(0.0, 1.0))
        finally:
            studio.process.kill()
            studio.process.wait()
        rests_within(line, axis, longest)

    for _ in range(ROUNDS):
        patiently(kill_it)


@pytest.mark.parametrize("axis", AXES)
def test_commands_are_killed_at_random_moments(line, axis):
    _, counts, longest = AXES[axis]
    moments = random.Random(f"command {axis}")
    bus = line.links["ecat" if axis == "jmc" else "can0"][0]
    node = {"ismc": "1", "reference": "2", "jmc": "1"}[axis]
    units = ["--velocity", str(0.3 * counts)] if counts else ["--revolutions", "--velocity", "0.3"]
    command = [PROGRAM, "jog", "--bus", bus, "--node", node, *units, "--seconds", "60", "--reset-fault"]
    for _ in range(ROUNDS):
        process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
        try:
            wait_for(lambda: speed(line, axis) > 5 or process.poll() is not None, "the axis to turn")
            time.sleep(moments.uniform(0.0, 1.0))
        finally:
            process.kill()
            process.wait()
        rests_within(line, axis, longest)


def test_jog_is_killed_while_a_studio_watches_another_drive(line):
    """Each program sends its own heartbeat, so that of the studio does not keep the axis moving."""
    bus = line.links["can0"][0]
    studio = Studio(f"{bus}=1")
    try:
        wait_for(lambda: studio.bench.axis("ismc-1")["powered"], "the drive of the studio")
        kill_while_it_turns(line, "jog", "--bus", bus, "--node", "2", "--revolutions", "--velocity", "0.3", "--seconds", "60")
        rests_within(line, "reference", 3.0)
        assert studio.bench.axis("ismc-1")["watch"]["by"] == "heartbeat"
        assert line.bench.axis("ismc")["state"] != "fault"
    finally:
        studio.stop()


def kill_while_it_turns(line, *command):
    process = subprocess.Popen([PROGRAM, *command], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
    try:
        wait_for(lambda: speed(line, "reference") > 5 or process.poll() is not None, "the axis to turn")
        assert process.poll() is None
    finally:
        process.kill()
        process.wait()


def test_conform_is_killed_while_the_axis_turns(line):
    kill_while_it_turns(line, "conform", "--bus", line.links["can0"][0], "--node", "2", "--only", "pv")
    rests_within(line, "reference", 3.0)


@pytest.mark.parametrize("name_of_signal", ["SIGTERM", "SIGHUP", "SIGINT"])
def test_studio_that_is_told_to_end_stops_its_axes(line, name_of_signal):
    studio = Studio(line.links["can0"][0])
    name = AXES["reference"][0]
    wait_for(lambda: studio.bench.axis(name)["powered"], name)
    studio.does(name, do="enable")
    studio.does(name, do="velocity", velocity=0.5, acceleration=5, units="revolutions")
    studio.process.send_signal(getattr(signal, name_of_signal))
    assert studio.process.wait(60) == 0
    assert speed(line, "reference") < 1
    assert line.bench.axis("reference")["state"] != "operation enabled"


def in_a_terminal(command):
    """The process, leader of its own session, and the other end of its terminal; closing that end simulates the loss of
    the terminal."""
    ours, its = pty.openpty()
    process = subprocess.Popen(
        command,
        stdin=its,
        stdout=its,
        stderr=its,
        start_new_session=True,
        preexec_fn=lambda: (fcntl.ioctl(0, termios.TIOCSCTTY, 0), signal.signal(signal.SIGHUP, signal.SIG_DFL)),
    )
    os.close(its)
    return process, ours


def test_a_command_whose_terminal_is_closed_stops_its_axis(line):
    command = [PROGRAM, "jog", "--bus", line.links["can0"][0], "--node", "2", "--revolutions", "--velocity", "0.3", "--seconds", "60"]
    process, terminal = in_a_terminal(command)
    wait_for(lambda: speed(line, "reference") > 5, "the axis to turn")
    os.close(terminal)
    process.wait(60)
    assert speed(line, "reference") < 1
    assert line.bench.axis("reference")["state"] != "operation enabled"


def test_a_studio_whose_terminal_is_closed_stops_its_axes(line):
    process, terminal = in_a_terminal([PROGRAM, "studio", "--api", "127.0.0.1:0", "--json", "--bus", line.links["can0"][0]])
    said = b""
    while b"\n" not in said:
        said += os.read(terminal, 4096)
    studio = Studio.at(json.loads(said)["api"])
    name = AXES["reference"][0]
    wait_for(lambda: studio.bench.axis(name)["powered"], name)
    studio.does(name, do="enable")
    studio.does(name, do="velocity", velocity=0.5, acceleration=5, units="revolutions")
    assert speed(line, "reference") > 5
    os.close(terminal)
    process.wait(60)
    assert speed(line, "reference") < 1
    assert line.bench.axis("reference")["state"] != "operation enabled"


def test_a_script_that_cannot_write_stops_its_axis(line, tmp_path):
    """Writes its output to a full disk."""
    script = tmp_path / "turn.script"
    script.write_text(f'axis a 2\na enable\na velocity {COUNTS // 4} acceleration {COUNTS}\nwait 1\nprint "turns"\nwait 60\n')
    command = [PROGRAM, "run", "--quiet", "--bus", line.links["can0"][0], str(script)]
    with open("/dev/full", "wb") as full:
        process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=full, stderr=subprocess.PIPE, text=True)
    wait_for(lambda: speed(line, "reference") > 5, "the axis to turn")
    _, said = process.communicate(timeout=40)
    assert process.returncode == 1 and "is the disk full" in said, (process.returncode, said)
    assert speed(line, "reference") < 1
    assert line.bench.axis("reference")["state"] != "operation enabled"


def test_a_command_that_fails_leaves_no_axis_enabled(line):
    """A move that exceeds its time, also without --disable."""
    bus = line.links["can0"][0]
    for options in (["--disable"], []):
        command = [PROGRAM, "move", "--bus", bus, "--node", "2", "--revolutions", "--by", "50", "--velocity", "1", "--timeout", "0.5"]
        process = subprocess.run([*command, *options], stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=120)
        assert process.returncode == 1 and "took longer" in process.stderr, process.stderr
        assert line.bench.axis("reference")["state"] != "operation enabled"
        assert speed(line, "reference") < 1


@pytest.fixture
def slow_line(tmp_path):
    """An SDO transfer takes 26 ms here, so a signal arrives between two of them. 6007h is 0, so each command changes it."""
    text = bus_text("can0") + "bit_rate = 10000\n" + axis_text("reference", "generic402", bus="can0", node=2)
    line = Line(tmp_path, text, ("can0=socketcand:127.0.0.1:0/can0",))
    line.bench.put("axes/reference/objects/6007/0", {"value": 0})
    yield line
    line.stop()


def watch_objects(line):
    return [line.bench.get(f"axes/reference/objects/{path}")["value"] for path in ("1016/1", "6007/0")]


def start_move(line):
    command = [PROGRAM, "move", "--bus", line.links["can0"][0], "--node", "2", "--revolutions", "--by", "0.1", "--velocity", "1"]
    process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    wait_for(lambda: watch_objects(line)[0] != 0 or process.poll() is not None, "the monitoring of the master")
    return process


@pytest.mark.parametrize("name_of_signal, status", [("SIGINT", 130), ("SIGTSTP", 148)])
def test_a_signal_before_the_motion_leaves_the_drive_as_it_was(slow_line, name_of_signal, status):
    process = start_move(slow_line)
    process.send_signal(getattr(signal, name_of_signal))
    try:
        _, said = process.communicate(timeout=60)
    finally:
        process.kill()
    assert process.returncode == status, (process.returncode, said)
    assert watch_objects(slow_line) == [0, 0]
    assert slow_line.bench.axis("reference")["state"] != "operation enabled"


def test_a_signal_at_the_end_leaves_the_drive_as_it_was(slow_line):
    """The command restores 1016h:01 first, then 6007h; the signal arrives between the two."""
    process = start_move(slow_line)
    wait_for(lambda: watch_objects(slow_line)[0] == 0 or process.poll() is not None, "the end of the monitoring")
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=60)
    assert watch_objects(slow_line) == [0, 0], said


def test_ctrl_s_does_not_block_jog(line):
    """A terminal that Ctrl-S has stopped blocks the next output; jog could then neither stop the axis nor end."""
    command = [PROGRAM, "jog", "--bus", line.links["can0"][0], "--node", "2", "--revolutions", "--velocity", "0.3"]
    process, terminal = in_a_terminal(command)
    try:
        said = b""
        while b"q: end" not in said:
            said += os.read(terminal, 4096)
        wait_for(lambda: line.bench.axis("reference")["state"] == "operation enabled", "the enabled axis")
        os.write(terminal, b"\x13")
        time.sleep(0.5)  # until the next output
        os.write(terminal, b"q")
        assert process.wait(30) == 0
    finally:
        process.kill()
        process.wait()
        os.close(terminal)


def test_ctrl_s_does_not_lengthen_a_jog_of_a_given_time(line):
    """The progress is not printed while the terminal is stopped."""
    command = [PROGRAM, "jog", "--bus", line.links["can0"][0], "--node", "2", "--revolutions", "--velocity", "0.3", "--seconds", "3"]
    process, terminal = in_a_terminal(command)
    try:
        wait_for(lambda: speed(line, "reference") > 5, "the axis to turn")
        os.write(terminal, b"\x13")
        wait_for(lambda: line.bench.axis("reference")["state"] != "operation enabled" or speed(line, "reference") < 1, "the end", 20)
        os.write(terminal, b"\x11")
        assert process.wait(30) == 0
    finally:
        process.kill()
        process.wait()
        os.close(terminal)


SIGNALS = ["SIGUSR1", "SIGUSR2", "SIGALRM", "SIGVTALRM", "SIGPROF", "SIGXCPU"]


@pytest.mark.parametrize("name_of_signal", SIGNALS)
def test_a_signal_that_would_kill_a_command_stops_its_axis(line, name_of_signal):
    command = [PROGRAM, "jog", "--no-watch", "--bus", line.links["can0"][0], "--node", "2", "--revolutions", "--velocity", "0.3", "--seconds", "60"]
    process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
    wait_for(lambda: speed(line, "reference") > 5 or process.poll() is not None, "the axis to turn")
    number = getattr(signal, name_of_signal)
    process.send_signal(number)
    assert process.wait(60) == 128 + number
    assert speed(line, "reference") < 1
    assert line.bench.axis("reference")["state"] != "operation enabled"


def test_a_script_whose_output_reaches_the_limit_of_a_file_stops_its_axis(line, tmp_path):
    script = tmp_path / "turn.script"
    script.write_text(f'axis a 2\na enable\na velocity {COUNTS // 4} acceleration {COUNTS}\nwait 1\nprint "{"turns" * 50}"\nwait 60\n')
    command = [PROGRAM, "run", "--no-watch", "--quiet", "--bus", line.links["can0"][0], str(script)]
    with open(tmp_path / "output", "wb") as output:
        process = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=subprocess.PIPE,
            text=True,
            preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (100, 100)),
        )
    wait_for(lambda: speed(line, "reference") > 5 or process.poll() is not None, "the axis to turn")
    _, said = process.communicate(timeout=40)
    assert process.returncode == 1 and "standard output could not be written" in said, (process.returncode, said)
    assert speed(line, "reference") < 1
    assert line.bench.axis("reference")["state"] != "operation enabled"


def test_an_error_that_cannot_be_printed_keeps_its_exit_status(line):
    with open("/dev/full", "wb") as full:
        command = [PROGRAM, "get", "--bus", line.links["can0"][0], "--node", "2", "5FFF"]
        assert subprocess.run(command, stdin=subprocess.DEVNULL, stdout=full, stderr=full, timeout=60).returncode == 1


# Each command drives the axis by another part of the program.
ON_ETHERCAT = {
    "run": ["run", "{script}"],
    "scope": ["scope", "position", "--run", "{script}"],
    "scope without process data": ["scope", "position", "--poll", "--run", "{script}"],
    "jog": ["jog", "--revolutions", "--velocity", "1", "--seconds", "60", "--reset-fault"],
    "conform": ["conform", "--only", "pv"],
    "prove": ["prove", "--method", "35", "--revolutions", "10000", "--speed", "1", "--timeout", "60"],
}


@pytest.mark.parametrize("name", ON_ETHERCAT)
def test_a_command_is_killed_whose_drive_would_ignore_that(tmp_path, name):
    """The factory value of 6007h of this drive is 0; the command restores it, unless it is killed."""
    line = Line(tmp_path, bus_text("ecat", "ethercat") + '[[axis]]\nname = "kinco"\nproduct = "ismk-ea"\nbus = "ecat"\n', ("ecat=udp:127.0.0.1:0",))
    try:
        script = tmp_path / "turn.script"
        script.write_text("units revolutions\nreset\nenable\nvelocity 1 acceleration 10\nwait 60\n")
        words = [word.format(script=script) for word in ON_ETHERCAT[name]]

        def start():
            command = [PROGRAM, *words, "--bus", line.links["ecat"][0]]
            for _ in range(8):  # a busy machine may let the drive lose its master
                process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
                wait_for(lambda: speed(line, "kinco") > 30 or process.poll() is not None, "the axis to turn")
                if process.poll() is None:
                    return process
            raise AssertionError(f"{name} does not turn the axis")

        process = start()
        process.terminate()
        process.wait(60)
        assert speed(line, "kinco") < 1
        assert line.bench.get("axes/kinco/objects/6007/0")["value"] == 0
        process = start()
        process.kill()
        process.wait()
        rests_within(line, "kinco", 1.5)
    finally:
        line.stop()
