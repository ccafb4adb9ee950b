"""`servodrome studio FOLDER`: a project with a virtual line or with buses, in a folder that git can hold."""

import contextlib
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request

import pytest

try:
    import resource
except ImportError:
    resource = None

LINE = """
[[bus]]
name = "can0"
[[axis]]
name = "x"
product = "generic402"
bus = "can0"
node = 2
"""
LIMITED = """
import os, resource, signal, sys
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[1]),) * 2)
os.execv(sys.argv[2], sys.argv[2:])
"""
PATIENCE_S = 60  # timeout for events that never come, long enough for a slow machine


class Refusal(Exception):
    def __init__(self, status, body):
        super().__init__(f"{status}: {body}")
        self.status = status
        self.error = body["error"]


class Server:
    """`servodrome studio FOLDER` until stop() or kill()."""

    running = []

    def __init__(self, program, folder, *options, most_bytes=None, prefix=()):
        command = [program, "studio", folder, "--api", "127.0.0.1:0", "--json", *options]
        if most_bytes is not None:  # of each file; the signal of the limit is ignored, so that the write fails
            command = [sys.executable, "-c", LIMITED, str(most_bytes), *command]
        command = [*prefix, *command]
        self.folder = folder
        Server.running.append(self)
        self.process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        first = self.process.stdout.readline()
        assert first, self.process.communicate()[1]
        self.ready = json.loads(first)

    def ask(self, method, path, body=None):
        data = None if body is None else json.dumps(body).encode()
        request = urllib.request.Request(f"{self.ready['api']}/{path}", data, method=method)
        try:
            with urllib.request.urlopen(request, timeout=PATIENCE_S) as answer:
                text = answer.read()
        except urllib.error.HTTPError as error:
            raise Refusal(error.code, json.loads(error.read())) from None
        return json.loads(text) if text else None

    def get(self, path):
        return self.ask("GET", path)

    def keep(self, name, value):
        self.ask("PUT", f"project/state/{name}", {"value": value})

    def problem(self):
        return self.get("project")["project"]["problem"]

    def record(self, name):
        about = {"name": name, "note": "a note", "channels": [{"axis": "x", "signal": "velocity_rpm"}], "duration_ms": 20, "rate_hz": 1000}
        number = self.ask("POST", "recordings", about)["id"]
        wait_for(lambda: self.get(f"recordings/{number}")["state"] == "done")
        return number

    def stop(self, status=0):
        self.process.terminate()
        errors = self.process.communicate(timeout=PATIENCE_S)[1]
        assert self.process.returncode == status, errors
        return errors

    def kill(self):
        self.process.send_signal(signal.SIGKILL)
        self.process.communicate(timeout=PATIENCE_S)

    def files(self):
        return sorted(str(path.relative_to(self.folder)) for path in self.folder.rglob("*") if path.is_file())


def wait_for(condition):
    end = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)


@pytest.fixture(autouse=True)
def no_server_is_left():
    yield
    for server in Server.running:
        if server.process.returncode is None:
            server.kill()
    Server.running.clear()


@pytest.fixture
def folder(tmp_path):
    """A folder with a line that needs no fixed port."""
    folder = tmp_path / "machine"
    folder.mkdir()
    (folder / "line.toml").write_text(LINE)
    return folder


@pytest.fixture
def refusal(program):
    """Runs a command of the program that is refused; returns its message."""

    def run(*arguments):
        result = subprocess.run([program, *arguments], capture_output=True, text=True, timeout=PATIENCE_S, check=False)
        assert result.returncode == 2, result.stdout + result.stderr
        return result.stderr

    return run


def changes_of(folder):
    return [json.loads(line) for line in (folder / "changes.jsonl").read_text().splitlines()]


def contents(folder):
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_a_project_is_made_only_on_request(program, refusal, tmp_path):
    new = tmp_path / "new"
    assert "there is no project here" in refusal("studio", new)
    assert not new.exists()
    process = subprocess.Popen([program, "studio", new, "--new", "--api", "127.0.0.1:0"], stdout=subprocess.PIPE, text=True)
    try:
        made, project = process.stdout.readline(), process.stdout.readline()
    finally:
        process.terminate()
        process.communicate(timeout=PATIENCE_S)
    assert made.split() == ["made", ".", "line.toml", "project.toml"]
    assert project.split() == ["project", "new", "in", str(new)]
    assert (new / "project.toml").read_text() == 'name = "new"\nschema = 1\n'
    assert "[[axis]]" in (new / "line.toml").read_text()
    before = contents(new)
    assert "exists already" in refusal("studio", new, "--new")
    assert contents(new) == before


def test_a_new_project_is_made_only_if_it_can_be_used(refusal, tmp_path):
    folder = tmp_path / "machine"
    folder.mkdir()
    (folder / "line.toml").write_text("[[bus]]\nname = 3\n")
    assert "line.toml:2:" in refusal("studio", folder, "--new")
    assert "is not a drive number" in refusal("studio", tmp_path / "buses", "--new", "--bus", "socketcan:none=a")
    assert [path.name for path in tmp_path.rglob("*")] == ["machine", "line.toml"]
    assert "is a file and no folder" in refusal("studio", folder / "line.toml", "--new")
    assert "give --bus LINK, or the folder" in refusal("studio")
    assert "give the folder" in refusal("studio", "--new")


def test_everything_is_there_again(program, folder):
    server = Server(program, folder, "--new")
    assert server.ready["project"] == {"name": "machine", "folder": str(folder)}
    server.keep("boards", [{"widgets": [], "name": "one"}])
    before = server.get("axes/x/objects/6083/0")["value"]
    server.ask("PUT", "axes/x/objects/6083/0", {"value": 4321})
    number = server.record("first")
    assert server.stop() == ""
    assert server.files() == ["changes.jsonl", "line.toml", "project.toml", f"recordings/{number}.csv", f"recordings/{number}.json", "state/boards.json"]
    assert (folder / "state/boards.json").read_text() == '[\n  {\n    "name": "one",\n    "widgets": []\n  }\n]\n'
    [change] = changes_of(folder)
    assert (change["number"], change["object"], change["before"], change["after"]) == (1, "6083:00", before, 4321)
    assert list(change) == sorted(change)

    moved = folder.rename(folder.parent / "moved")  # the folder contains no absolute paths
    again = Server(program, moved)
    assert again.get("project/state")["state"] == {"boards": [{"name": "one", "widgets": []}]}
    [recording] = again.get("recordings")["recordings"]
    assert (recording["name"], recording["note"], recording["samples"]) == ("first", "a note", 20)
    assert again.get("project/changes?axis=x")["changes"] == [change]
    assert again.get("axes/x/objects/6083/0")["value"] == before  # a virtual drive loses values that are not stored
    again.ask("PUT", "axes/x/objects/6081/0", {"value": 1234})
    assert again.record("second") == number + 1
    again.ask("DELETE", f"recordings/{number}")
    again.stop()
    assert [(each["number"], each["object"]) for each in changes_of(moved)] == [(1, "6083:00"), (2, "6081:00")]
    assert [name for name in again.files() if name.startswith("recordings/")] == [f"recordings/{number + 1}.csv", f"recordings/{number + 1}.json"]


@pytest.mark.skipif(shutil.which("git") is None, reason="git is not installed")
def test_a_git_diff_is_small(program, folder):
    def git(*words):
        return subprocess.run(["git", "-C", folder, "-c", "user.name=x", "-c", "user.email=x@y", *words], capture_output=True, text=True, check=True).stdout

    def commit():
        git("add", "-A")
        git("commit", "-q", "-m", "state")

    def boards(text):
        return [{"name": name, "widgets": [{"kind": "note", "text": text if name == "c" else "", "span": 4}]} for name in "fedcba"]

    server = Server(program, folder, "--new")
    server.keep("boards", boards("old"))
    server.ask("PUT", "axes/x/objects/6083/0", {"value": 4321})
    number = server.record("first")
    server.stop()
    git("init", "-q")
    commit()
    Server(program, folder).stop()
    assert git("status", "--porcelain") == ""  # a run that changes nothing changes no file
    server = Server(program, folder)
    server.keep("boards", boards("new"))
    server.ask("PUT", f"recordings/{number}", {"note": "another note"})
    server.ask("PUT", "axes/x/objects/6081/0", {"value": 4321})
    server.stop()
    assert git("diff", "--numstat").splitlines() == ["1\t0\tchanges.jsonl", f"1\t1\trecordings/{number}.json", "1\t1\tstate/boards.json"]


def test_a_bad_file_is_named_with_its_place_and_stays(program, refusal, folder):
    Server(program, folder, "--new").stop()
    good = contents(folder)
    for name, text, place in (
        ("project.toml", 'name = "x"\nschema = \n', "project.toml:2:"),
        ("project.toml", 'name = "x"\nschema = 2\n', "project.toml:2:10: schema: this program reads projects of schema 1; use a newer version"),
        ("line.toml", "[[bus]]\nname = 3\n", "line.toml:2:"),
        ("state/boards.json", '{\n "a": }\n', "boards.json:2:7: is not JSON here"),
        ("changes.jsonl", '{"axis": "x", "number": 1}\n<<<<<<< HEAD\n{"axis": "x", "number": 2}\n', "changes.jsonl:2:1: is not JSON here"),
        ("recordings/1.json", "{\n", "1.json:2:1: is not JSON here"),
    ):
        file = folder / name
        file.parent.mkdir(exist_ok=True)
        file.write_text(text)
        before = contents(folder)
        assert place in refusal("studio", folder, "--api", "127.0.0.1:0")
        assert contents(folder) == before
        file.unlink()
        if name in good:
            file.write_bytes(good[name])
    Server(program, folder).stop()


def test_one_server_at_a_time(program, refusal, folder):
    first = Server(program, folder, "--new")
    first.keep("boards", 1)
    assert "another server has this project open" in refusal("studio", folder, "--api", "127.0.0.1:0")
    link = folder.parent / "link"
    link.symlink_to(folder)
    assert "another server has this project open" in refusal("studio", link, "--api", "127.0.0.1:0")
    first.kill()  # the lock of a killed server ends with it
    Server(program, folder).stop()


KILLS = 25
MOST_RECORDINGS = 500


def test_a_kill_during_saves_leaves_whole_files(program, folder):
    """Kills the program at random moments while all kinds of files are written, then compares the files with the sent
    data."""
    Server(program, folder, "--new").stop()
    draw = random.Random(1)
    kept = 0  # the greatest number that is certainly in the file
    for _ in range(KILLS):
        server = Server(program, folder)
        found = server.get("project/state")["state"].get("boards", {"number": 0})
        assert found["number"] >= kept
        sent = [found["number"]]
        stopped = threading.Event()

        def send(server=server, sent=sent, stopped=stopped):
            with contextlib.suppress(OSError, Refusal):
                while not stopped.is_set():
                    server.keep("boards", {"number": sent[-1] + 1, "much": ["x" * 100] * 500})
                    sent.append(sent[-1] + 1)
                    server.ask("PUT", "axes/x/objects/6083/0", {"value": 1000 + sent[-1]})
                    # The last server can load all of them: the memory holds 512 recordings.
                    if sent[-1] % 5 == 0 and sent[-1] - sent[0] <= 5 * MOST_RECORDINGS // KILLS:
                        server.ask("POST", "recordings", {"channels": [{"axis": "x", "signal": "velocity_rpm"}], "duration_ms": 5})

        sender = threading.Thread(target=send)
        sender.start()
        time.sleep(draw.uniform(0.1, 0.6))
        server.kill()
        stopped.set()
        sender.join()
        file = folder / "state/boards.json"
        if file.exists():
            value = json.loads(file.read_text())
            assert kept <= value["number"] <= sent[-1] + 1
            assert value["much"] == ["x" * 100] * 500
            kept = value["number"]
        if (folder / "changes.jsonl").exists():
            numbers = [change["number"] for change in changes_of(folder)]
            assert numbers == list(range(1, len(numbers) + 1))
    assert kept > 25
    last = Server(program, folder)  # reads all files, recordings too
    assert last.get("project/state")["state"]["boards"]["number"] == kept
    loaded = [recording["id"] for recording in last.get("recordings")["recordings"]]
    assert sorted(loaded) == sorted(int(file.stem) for file in (folder / "recordings").glob("*.json"))
    for number in loaded:
        last.ask("DELETE", f"recordings/{number}")
    assert last.get("recordings")["recordings"] == []
    last.stop()
    assert [name for name in last.files() if name.endswith((".part", ".json"))] == ["state/boards.json"]


def test_files_that_are_edited_while_the_server_runs(program, folder):
    server = Server(program, folder, "--new")
    server.keep("boards", 1)
    wait_for(lambda: not server.get("project")["project"]["unsaved"])
    # The line file is read at the next start.
    edited = LINE.replace('"x"', '"y"')
    (folder / "line.toml").write_text(edited)
    server.keep("guide.x", {"product": "generic402"})
    # A state is not overwritten, and the page receives an event.
    (folder / "state/boards.json").write_text("<<<<<<< HEAD\n")
    server.keep("boards", 2)
    wait_for(server.problem)
    assert server.problem()["where"] == str(folder / "state/boards.json")
    assert (folder / "state/boards.json").read_text() == "<<<<<<< HEAD\n"
    (folder / "state/boards.json").unlink()
    wait_for(lambda: server.problem() is None)
    server.record("of x")
    server.stop()
    assert (folder / "state/boards.json").read_text() == "2\n"
    assert (folder / "line.toml").read_text() == edited
    # The axis has another name: data of the old name stay in the project.
    again = Server(program, folder)
    assert [axis["name"] for axis in again.ready["axes"]] == ["y"]
    assert again.get("project/state/guide.x") == {"value": {"product": "generic402"}}
    assert [each["channels"][0]["axis"] for each in again.get("recordings")["recordings"]] == ["x"]
    assert again.get("project/changes?axis=y") == {"changes": [], "most": 1000}
    again.stop()


def enables(server):
    """The drives still execute commands."""
    job = server.ask("POST", "axes/x/jobs", {"do": "enable"})
    wait_for(lambda: server.get(f"jobs/{job['id']}")["state"] != "running")
    return server.get(f"jobs/{job['id']}")["state"] == "done"


def test_a_folder_that_moves_away_stops_no_drive(program, folder):
    """The page receives an event, and everything is written when the folder is available again."""
    server = Server(program, folder, "--new")
    away = folder.rename(folder.parent / "away")
    server.keep("boards", 1)
    number = server.record("first")
    wait_for(server.problem)
    assert "No such file or directory" in server.problem()["what"]
    assert enables(server)
    assert server.get("project/state")["state"] == {"boards": 1}
    assert not folder.exists()
    away.rename(folder)
    wait_for(lambda: server.problem() is None)
    assert (folder / "state/boards.json").read_text() == "1\n"
    assert (folder / f"recordings/{number}.csv").exists()
    server.stop()


# Root may write everywhere with this capability only.
AS_USER = ["setpriv", "--bounding-set", "-dac_override"] if os.geteuid() == 0 else []


def test_a_folder_that_is_read_only_can_be_opened(program, folder):
    Server(program, folder, "--new").stop()
    folder.chmod(0o555)
    try:
        server = Server(program, folder, prefix=AS_USER)
        server.keep("boards", 1)
        wait_for(server.problem)
        assert "Permission denied" in server.problem()["what"]
        assert enables(server)
    finally:
        folder.chmod(0o755)
    server.stop()
    assert (folder / "state/boards.json").read_text() == "1\n"


@pytest.mark.skipif(resource is None, reason="this system has no limit of file sizes")
def test_a_full_disk_is_told_and_stops_no_drive(program, folder):
    """A size limit for files simulates a full disk: a part of the text is written, then the write fails."""
    server = Server(program, folder, "--new", most_bytes=50_000)
    server.keep("boards", 1)
    wait_for(lambda: not server.get("project")["project"]["unsaved"])
    server.keep("boards", ["x" * 1000] * 100)
    server.ask("PUT", "axes/x/objects/6083/0", {"value": 4321})
    wait_for(server.problem)
    assert server.problem()["where"] == str(folder / "state/boards.json")
    assert "File too large" in server.problem()["what"]
    assert enables(server)
    errors = server.stop(status=1)
    assert "the project is not complete" in errors and "boards.json" in errors
    assert server.files() == ["changes.jsonl", "line.toml", "project.toml", "state/boards.json"]
    assert (folder / "state/boards.json").read_text() == "1\n"
    (folder / "changes.jsonl").write_text("".join(f'{{"axis": "x", "number": {i}, "after": 12345678}}\n' for i in range(1, 1200)))
    before = (folder / "changes.jsonl").read_bytes()
    again = Server(program, folder, most_bytes=len(before) + 20)
    again.ask("PUT", "axes/x/objects/6083/0", {"value": 4321})
    wait_for(again.problem)
    again.stop(status=1)
    assert (folder / "changes.jsonl").read_bytes() == before  # no part of a line


def test_names_and_sizes_are_checked(program, folder):
    server = Server(program, folder, "--new")
    for name in ("..%2Fx", ".git", "a%2Fb", "x" * 65):
        with pytest.raises(Refusal) as refused:
            server.keep(name, 1)
        assert refused.value.status == 422
    with pytest.raises(Refusal) as refused:
        server.keep("boards", "x" * 300_000)
    assert refused.value.status == 413
    server.stop()
    assert server.files() == ["line.toml", "project.toml"]


def test_a_project_with_buses(program, refusal, tmp_path):
    (tmp_path / "line.toml").write_text(LINE)
    up = subprocess.Popen([program, "up", tmp_path / "line.toml", "--bus", "can0=socketcand:127.0.0.1:0/can0", "--json"], stdout=subprocess.PIPE, text=True)
    folder = tmp_path / "plant"
    try:
        link = json.loads(up.stdout.readline())["buses"][0]["links"][0]
        server = Server(program, folder, "--new", "--bus", f"{link}=2")
        assert (folder / "project.toml").read_text() == f'name = "plant"\nschema = 1\n\n[[bus]]\nlink = "{link}"\ndrives = [2]\n'
        wait_for(lambda: server.get("axes/generic402-2")["powered"])
        server.ask("PUT", "axes/generic402-2/objects/6083/0", {"value": 4321})
        server.keep("boards", 1)
        server.stop()
        [change] = changes_of(folder)
        assert (change["axis"], change["object"], change["after"]) == ("generic402-2", "6083:00", 4321)
        again = Server(program, folder)
        assert [axis["name"] for axis in again.ready["axes"]] == ["generic402-2"]
        assert again.get("project/state")["state"] == {"boards": 1}
        assert again.get("project/changes")["changes"] == [change]
        again.stop()
        assert "a project has its own buses" in refusal("studio", folder, "--bus", link)
    finally:
        up.terminate()
        up.communicate(timeout=PATIENCE_S)


def test_without_a_project_the_server_says_how_to_get_one(program, folder):
    up = subprocess.Popen([program, "up", folder / "line.toml", "--api", "127.0.0.1:0", "--json"], stdout=subprocess.PIPE, text=True)
    try:
        server = Server.__new__(Server)
        server.ready = json.loads(up.stdout.readline())
        assert server.get("project") == {"project": None}
        with pytest.raises(Refusal) as refused:
            server.keep("boards", 1)
        assert refused.value.status == 409
        assert "servodrome studio FOLDER" in refused.value.error["hint"]
    finally:
        up.terminate()
        up.communicate(timeout=PATIENCE_S)
