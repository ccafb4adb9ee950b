"""Lines in real time: the program as a child process. Timeouts are for events that never come."""

import gc
import os
import pathlib
import signal
import socket
import subprocess
import sys
import threading
import time

import numpy
import pytest
import servodrome
from conftest import COUNTS, ROOT, axes
from servodrome import Mode, PowerState

PATIENCE_S = 60


def wait_until(condition, what):
    end = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < end, f"waited {PATIENCE_S} s for {what}"
        time.sleep(0.01)


def is_alive(pid):
    """Returns False also for a process that has ended and waits for its parent."""
    try:
        status = pathlib.Path(f"/proc/{pid}/stat").read_text()
    except FileNotFoundError:
        return False
    return status.rpartition(")")[2].split()[0] != "Z"


def pid_of(line):
    return line._backend._program._children[0].pid


def left_in_the_program(line):
    """Our recordings on the server, which also makes its own recordings of faults."""
    return [one for one in line.request("GET", "recordings")["recordings"] if one["name"] in ("python", "")]


@pytest.fixture(scope="module")
def shared(program):
    """One line for all tests that leave it in a usable state."""
    with servodrome.Line(axes=axes(), clock="real", program=program) as line:
        yield line


@pytest.fixture
def x(shared):
    axis = shared.axes["x"]
    yield axis
    axis.power("on")
    axis.remove()
    axis.inputs.release()
    axis.disable()


def test_a_line_in_real_time(shared):
    assert shared.clock == "real"
    assert list(shared.axes) == ["x", "y", "z"] and list(shared.buses) == ["can0", "ecat"]
    assert "real time" in repr(shared)
    begin = shared.now
    shared.advance(0.1)
    assert shared.now - begin >= 0.1
    end = shared.now + 0.2
    shared.run_until(end)
    assert shared.now >= end
    assert shared.ticks >= end * 16000
    with pytest.raises(servodrome.BadValue, match="past"):
        shared.run_until(0)
    with pytest.raises(servodrome.BadValue):
        shared.advance(-1)


def test_what_only_virtual_time_has(shared):
    with pytest.raises(servodrome.NotInRealTime, match="advance"):
        shared.run_ticks(1)
    with pytest.raises(servodrome.NotInRealTime, match="another process"):
        shared._handle


def test_values_and_jobs(shared, x):
    assert x.position == pytest.approx(2 * COUNTS, abs=2)
    assert x.state is PowerState.SWITCH_ON_DISABLED
    x.enable()
    assert x.state is PowerState.OPERATION_ENABLED
    job = x.move(by=0.5, velocity=5, acceleration=100, units="revolutions")
    assert job.result.seconds > 0.05
    assert x.mode is Mode.PROFILE_POSITION
    assert x.position == pytest.approx(2.5 * COUNTS, abs=200)
    assert shared.positions()[0] == pytest.approx(2.5 * COUNTS, abs=200)
    assert shared.positions().dtype == numpy.int64
    with pytest.raises(servodrome.JobFailed, match="0609 0030h"):
        x.home(method=99)
    job = x.velocity(1, units="revolutions", wait=False)
    with pytest.raises(servodrome.Refused, match="has a job|"):
        x.move(by=1)
        x.move(by=1)
    x.stop()


def test_reading_signals(shared, x):
    signals = [x.signal(name) for name in ("supply_v", "6041:00", "DI2", "direct_voltage_v", "Statusword")]
    shared.wait_for(lambda: shared.read(signals[:1])[0] > 309, what="the supply, which an earlier test may have switched")
    values = shared.read(signals * 4)  # more than one recording has
    assert values[0] == pytest.approx(310, abs=1)
    assert values[1] == values[4] == x.statusword
    assert values[2] == 0
    assert numpy.isnan(values[3])  # the power stage is off
    assert len(values) == 20
    assert x.signal("supply_v").value == pytest.approx(310, abs=1)
    assert left_in_the_program(shared) == []
    for name in ("velocity", "9999:00", "DI99"):
        with pytest.raises(servodrome.UnknownName):
            x.signal(name)


def test_objects_inputs_plant_faults(shared, x):
    x.objects["Target position"] = 7
    assert x.objects[0x607A] == 7
    with pytest.raises(servodrome.ObjectError) as caught:
        x.objects["Statusword"] = 1
    assert caught.value.abort == 0x06010002
    with pytest.raises(servodrome.UnknownObject):
        x.objects[0x9999]
    assert len(x.objects) > 300
    x.inputs["DI2"] = True
    assert x.inputs["DI2"] is True
    x.plant.load_torque_nm = 0.1
    assert x.plant.load_torque_nm == 0.1
    x.plant.load_torque_nm = 0
    x.inject("encoder_loss")
    shared.wait_for(lambda: x.state is PowerState.FAULT, what="the fault")
    assert x.faults[0].code == x.error_code
    x.remove()
    shared.advance(0.2)
    x.reset_fault()
    x.power("off")
    assert x.state is PowerState.NO_POWER
    with pytest.raises(servodrome.Refused):
        x.statusword


def test_a_recording(shared, x):
    x.enable()
    wanted = {"v": x.signal("velocity_rpm"), "p": x.signal("6064:00")}
    with shared.record(wanted, rate=2000) as recording:
        with pytest.raises(servodrome.Refused, match="stop"):
            recording.samples
        begin = shared.now
        x.move(by=0.2, velocity=5, acceleration=100, units="revolutions")
        end = shared.now
    assert not recording.is_full
    assert numpy.all(numpy.diff(recording.ticks) == 8)
    assert recording.time[0] <= begin + 0.001 and recording.time[-1] >= end - 0.001
    assert recording["v"].max() > 100
    assert recording["p"][-1] == pytest.approx(x.position, abs=20)
    assert recording.stop().samples == len(recording["v"])
    assert left_in_the_program(shared) == []
    with pytest.raises(servodrome.BadValue, match="divider"):
        shared.record(wanted, rate=16000 / 3)


def test_a_full_recording_says_so(shared, x, monkeypatch):
    monkeypatch.setattr(servodrome.remote, "_MOST_VALUES", 100)
    recording = shared.record({"v": x.signal("velocity_rpm")}, rate=1000)
    shared.advance(0.3)
    with pytest.warns(RuntimeWarning, match="full after 100 samples"):
        recording.stop()
    assert recording.is_full and recording.samples == 100


def test_traffic_and_captures(shared, x):
    x.objects["1017:00"] = 10
    with shared.buses["can0"].record() as bus:
        shared.wait_for(lambda: len(bus.traffic) > 5, what="heartbeats")
    assert bus.traffic.rows(node=2)[0].sender == "x"
    assert b"702#" in bus.capture("candump")
    with bus.disturb(drop=1):
        assert bus.view()["disturbance"]["drop"] == 1
    x.objects["1017:00"] = 0


def test_a_master_at_the_link(shared, x):
    """Uses the socketcand protocol directly: an SDO upload of the device type."""
    link = shared.buses["can0"].link
    kind, _, place = link.partition(":")
    host, _, rest = place.partition(":")
    port, _, bus = rest.partition("/")
    assert (kind, bus) == ("socketcand", "can0")
    with socket.create_connection((host, int(port)), timeout=PATIENCE_S) as master:
        text = b""

        def expect(end):
            nonlocal text
            while end not in text:
                text += master.recv(4096)

        expect(b"< hi >")
        master.sendall(b"< open can0 >")
        expect(b"< ok >")
        text = b""
        master.sendall(b"< rawmode >")
        expect(b"< ok >")
        master.sendall(b"< send 602 8 40 00 10 00 00 00 00 00 >")
        expect(b"4300100092010200")
    assert shared.buses["ecat"].link.startswith("udp:127.0.0.1:")


def test_a_closed_line(program):
    line = servodrome.Line(axes=axes(), clock="real", program=program)
    x = line.axes["x"]
    pid, folder = pid_of(line), os.path.dirname(line._backend._program._output)
    recording = line.record({"v": x.signal("velocity_rpm")})
    line.advance(0.1)
    line.close()
    line.close()
    assert line.closed and not is_alive(pid) and not os.path.exists(folder)
    assert recording.samples > 50
    for use in (
        lambda: line.advance(1),
        lambda: line.now,
        lambda: x.position,
        lambda: line.buses["can0"].link,
        lambda: x.enable(),
    ):
        with pytest.raises(servodrome.Closed):
            use()


def test_a_line_that_is_not_closed_is_collected(program):
    line = servodrome.Line(axes=axes(), clock="real", program=program)
    pid = pid_of(line)
    assert is_alive(pid)
    del line
    gc.collect()
    assert not is_alive(pid)


# ---- How the line is opened ----


def test_the_built_in_line(program):
    with servodrome.Line(clock="real", program=program) as line:
        assert list(line.axes) == ["ismc", "reference", "pronet", "ismk", "jmc"]
        links = line.buses["rs485"].links
        assert [link.partition(":")[0] for link in links] == ["pty", "tcp"]
        assert os.path.exists(links[0].partition(":")[2])


def test_two_lines_of_a_file_at_once(program):
    file = ROOT / "lines/eight-axes.toml"
    with servodrome.Line.from_file(file, clock="real", program=program) as one:
        with servodrome.Line.from_file(file, clock="real", program=program) as two:
            assert set(one.buses["can0"].links).isdisjoint(two.buses["can0"].links)
            one.axes[next(iter(one.axes))].power("off")
            assert all(axis.powered for axis in two.axes.values())


def test_relative_paths_of_a_text_start_at_the_folder_of_its_name(program, tmp_path, monkeypatch):
    (tmp_path / "elsewhere").mkdir()
    text = '[[bus]]\nname = "can0"\n[[axis]]\nname = "x"\nproduct = "ismc"\nstore = "x.bin"\n'
    with servodrome.Line.from_text(text, name=str(tmp_path / "cell.toml"), clock="real", program=program) as line:
        assert set(tmp_path.iterdir()) <= {tmp_path / "x.bin", tmp_path / "elsewhere"}
        line.axes["x"].objects["1010:01"] = 0x65766173  # "save"
        wait_until((tmp_path / "x.bin").exists, "the store")
    monkeypatch.chdir(tmp_path / "elsewhere")
    with servodrome.Line.from_text(text, clock="real", program=program) as line:
        assert line.now >= 0
    assert list((tmp_path / "elsewhere").iterdir()) == []
    with pytest.raises(servodrome.LineFileError) as caught:
        servodrome.Line.from_text("[[axis]]", clock="real", program=program)
    assert caught.value.file == "line.toml"


def test_links_of_the_caller(program, tmp_path):
    path = tmp_path / "can"
    with servodrome.Line(axes=axes(), clock="real", program=program, links={"can0": [f"slcan:{path}"]}) as line:
        assert line.buses["can0"].links == [f"slcan:{path}"]
        assert path.exists()
    with pytest.raises(servodrome.UnknownName, match="can0, ecat"):
        servodrome.Line(axes=axes(), clock="real", program=program, links={"can1": "slcan:x"})
    with pytest.raises(servodrome.ProgramError, match="--bus"):
        servodrome.Line(axes=axes(), clock="real", program=program, links={"can0": "nonsense:1"})


def test_a_wrong_line_file(program, tmp_path):
    file = tmp_path / "cell.toml"
    file.write_text("[[axis]]\nname = 3\n")
    with pytest.raises(servodrome.LineFileError) as caught:
        servodrome.Line.from_file(file, clock="real", program=program)
    assert (caught.value.file, caught.value.line) == (str(file), 1)


def test_a_missing_program(tmp_path, monkeypatch):
    with pytest.raises(servodrome.ProgramError, match="no program") as caught:
        servodrome.Line(clock="real", program=tmp_path / "none")
    assert "SERVODROME" in caught.value.hint
    monkeypatch.delenv("SERVODROME", raising=False)
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(servodrome.ProgramError, match="not installed"):
        servodrome.Line(clock="real")
    other = tmp_path / "servodrome"
    other.write_text("#!/bin/sh\necho this is another program\nexit 3\n")
    other.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:/bin:/usr/bin")
    with pytest.raises(servodrome.ProgramError, match="ended with 3.*this is another program"):
        servodrome.Line(clock="real")


# ---- The end of the program and of this process ----


def test_a_program_that_ends(program):
    with servodrome.Line(axes=axes(), clock="real", program=program) as line:
        os.kill(pid_of(line), signal.SIGKILL)
        with pytest.raises(servodrome.ProgramError):
            wait_until(lambda: line.now < 0, "the end")
        with pytest.raises(servodrome.ProgramError, match="ended with -9"):
            line.now
        with pytest.raises(servodrome.ProgramError):
            line.advance(0.01)


CHILD = """
import os, signal, sys, time
import servodrome
line = servodrome.Line(axes=[servodrome.Axis("x", "ismc")], clock="real", program=sys.argv[1])
print(line._backend._program._children[0].pid, flush=True)
how = sys.argv[2]
if how == "kill": os.kill(os.getpid(), signal.SIGKILL)
if how == "exit": os._exit(0)
if how == "raise": raise SystemExit(0)
if how == "forked":
    if os.fork() == 0:
        sys.stdout.close(); os.close(1)
        time.sleep(600)
    os.kill(os.getpid(), signal.SIGKILL)
if how == "thread":
    import threading
    thread = threading.Thread(target=lambda: sys.modules.update(other=servodrome.Line(clock="real", program=sys.argv[1])))
    thread.start(); thread.join()
    time.sleep(0.2)
    assert sys.modules["other"].now > 0, "it must not end with the thread"
"""


@pytest.mark.parametrize("how", ["end", "exit", "kill", "raise", "forked", "thread"])
def test_the_program_ends_with_this_process(program, how):
    environment = {"PYTHONPATH": str(pathlib.Path(servodrome.__path__[0]).parent), **os.environ}
    child = subprocess.Popen(
        [sys.executable, "-c", CHILD, program, how],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env=environment,
        start_new_session=True,
    )
    try:
        pid = int(child.stdout.readline())
        child.wait(PATIENCE_S)
        wait_until(lambda: not is_alive(pid), "the end of the program")
        if how in ("end", "thread", "raise"):
            assert child.returncode == 0, child.stderr.read()
    finally:
        try:
            os.killpg(child.pid, signal.SIGKILL)  # also a forked child
        except ProcessLookupError:
            pass
        child.stdout.close()
        child.stderr.close()


def test_a_forked_child_does_not_end_the_program(program):
    with servodrome.Line(axes=axes(), clock="real", program=program) as line:
        x = line.axes["x"]
        child = os.fork()
        if child == 0:
            status = 1
            try:
                for use in (lambda: line.now, lambda: line.advance(0), lambda: x.position, lambda: line.buses["can0"].link):
                    try:
                        use()
                    except servodrome.Forked:
                        continue
                    os._exit(2)
                line.close()
                assert line.closed
                del line, x
                gc.collect()
                status = 0
            finally:
                os._exit(status)
        assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
        assert x.position == pytest.approx(2 * COUNTS, abs=2)
        assert line.now > 0


def test_ctrl_c_ends_a_wait_and_not_the_line(shared, x):
    x.enable()
    job = x.velocity(10_000, acceleration=1000, wait=False)
    threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT)).start()
    with pytest.raises(KeyboardInterrupt):
        job.wait(300)
    wait_until(lambda: job.is_over, "the end of the job")
    assert job.state is servodrome.JobState.CANCELLED
    threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT)).start()
    with pytest.raises(KeyboardInterrupt):
        shared.advance(300)
    assert shared.now > 0


def test_threads_on_one_line(shared, x):
    errors = []
    target = x.signal("position_counts")

    def repeat(act):
        try:
            for _ in range(30):
                act()
        except BaseException as error:
            errors.append(error)

    acts = [lambda: shared.now, lambda: shared.read([target]), lambda: x.view(), lambda: x.objects[0x6041]]
    threads = [threading.Thread(target=repeat, args=(act,)) for act in acts]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert errors == []
