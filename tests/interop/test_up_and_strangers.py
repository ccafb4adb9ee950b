"""`up` and commands that read files, while another user of the machine attacks them, or another line runs."""

import resource
import signal
import stat
import subprocess

import pytest

from line import PATIENCE, PROGRAM, wait_for

AXIS = '[[axis]]\nname = "x"\nproduct = "ismc"\nbus = "can0"\n'


@pytest.fixture
def up(tmp_path):
    """Starts `up` with a line of one axis; ends the remaining processes afterwards."""
    running = []

    def start(ready, links="[]"):
        file = tmp_path / "line.toml"
        file.write_text(f'[[bus]]\nname = "can0"\nlinks = {links}\n{AXIS}')
        command = [PROGRAM, "up", file, "--api", "127.0.0.1:0", "--ready-file", ready]
        running.append(subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True))
        return running[-1]

    yield start
    for process in running:
        process.kill()
        process.wait()
        process.stderr.close()


def test_the_ready_file_follows_no_planted_link(up, tmp_path):
    victim = tmp_path / "victim"
    victim.write_text("precious")
    folder = tmp_path / "shared"
    folder.mkdir()
    ready = folder / "ready.json"
    (folder / "ready.json.part").symlink_to(victim)
    ready.symlink_to(victim)
    up(ready)
    wait_for(lambda: ready.is_file() and not ready.is_symlink(), "the ready file")
    assert victim.read_text() == "precious"
    assert stat.S_IMODE(ready.stat().st_mode) == 0o600


def test_a_ready_file_of_others_gets_our_permissions(up, tmp_path):
    ready = tmp_path / "ready.json"
    part = tmp_path / "ready.json.part"
    for file in (ready, part):
        file.write_text("theirs")
        file.chmod(0o666)
    up(ready)
    wait_for(lambda: "token" in ready.read_text(), "the ready file")
    assert stat.S_IMODE(ready.stat().st_mode) == 0o600
    assert part.read_text() == "theirs"


def test_a_ready_file_that_cannot_be_written_leaves_nothing(up, tmp_path):
    folder = tmp_path / "shared"
    (folder / "ready.json" / "full").mkdir(parents=True)
    process = up(folder / "ready.json")
    assert process.wait(PATIENCE) == 1
    assert "cannot write" in process.stderr.read()
    assert [file.name for file in folder.iterdir()] == ["ready.json"]


def test_a_line_that_cannot_print_leaves_no_ready_file(tmp_path):
    file, ready = tmp_path / "line.toml", tmp_path / "ready.json"
    axes = "".join(f'[[axis]]\nname = "x{node}"\nproduct = "ismc"\nbus = "can0"\nnode = {node}\n' for node in range(1, 101))
    file.write_text(f'[[bus]]\nname = "can0"\nlinks = []\n{axes}')
    command = [PROGRAM, "up", file, "--api", "127.0.0.1:0", "--ready-file", ready, "--json"]
    with open("/dev/full", "w", encoding="utf-8") as full:
        ended = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, timeout=PATIENCE, check=False)
    assert ended.returncode != 0
    assert not ready.exists()


def test_a_terminal_that_goes_away_ends_it_as_ctrl_c_does(up, tmp_path):
    ready, port = tmp_path / "ready.json", tmp_path / "can0"
    process = up(ready, f'["slcan:{port}"]')
    wait_for(ready.is_file, "the ready file")
    assert port.is_symlink()
    process.send_signal(signal.SIGHUP)
    assert process.wait(PATIENCE) == 0
    assert not port.is_symlink() and not ready.exists()


def test_a_second_line_leaves_a_port_that_is_used(up, tmp_path):
    port = tmp_path / "can0"
    first = tmp_path / "first.json"
    up(first, f'["slcan:{port}"]')
    wait_for(first.is_file, "the ready file")
    device = port.readlink()
    second = up(tmp_path / "second.json", f'["slcan:{port}"]')
    assert second.wait(PATIENCE) == 2
    assert "another line has this path" in second.stderr.read()
    assert port.readlink() == device


@pytest.mark.parametrize(
    "command", [("run", "--check"), ("params", "diff", "/dev/zero"), ("up",), ("up", "--eds"), ("sniff",)]
)
def test_a_file_without_end_is_refused_before_it_fills_the_memory(command):
    complaint = subprocess.run(
        [PROGRAM, *command, "/dev/zero"],
        capture_output=True,
        text=True,
        check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (512 << 20, 512 << 20)),
    )
    assert complaint.returncode in (1, 2)
    assert "/dev/zero" in complaint.stderr
