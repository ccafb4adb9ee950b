"""The GitHub Action and the GitLab job of packaging/: runs their steps in a shell, as those systems do."""

import json
import os
import pathlib
import re
import shutil
import socket
import subprocess
import tarfile

import pytest
import yaml
from line import PROGRAM, TWO_DRIVES

pytestmark = pytest.mark.once
PACKAGING = pathlib.Path(__file__).resolve().parents[2] / "packaging"
SCRIPT = PACKAGING / "ci" / "servodrome-ci"


@pytest.fixture
def archive(tmp_path):
    """A tarball like that of tools/package, with the program of this build."""
    path = tmp_path / "servodrome-0-linux-x86_64.tar.gz"
    with tarfile.open(path, "w:gz", compresslevel=1) as packed:
        packed.add(PROGRAM, "servodrome-0-linux-x86_64/bin/servodrome")
    return path


@pytest.fixture
def line_file(tmp_path):
    path = tmp_path / "my line.toml"  # with a space, as in a user's folder
    path.write_text('[api]\naddress = "127.0.0.1:0"\n' + TWO_DRIVES.replace('type = "can"', 'links = ["socketcand:127.0.0.1:0/can0"]'))
    return path


def shell(script, environment, folder, status=0):
    """Runs a step with the shell options of both systems. Its environment contains only the PATH of this machine."""
    environment = {"PATH": "/usr/local/bin:/usr/bin:/bin"} | environment
    done = subprocess.run(["bash", "--noprofile", "--norc", "-eo", "pipefail", "-c", script], env=environment, cwd=folder,
                          capture_output=True, text=True, timeout=120, check=False, stdin=subprocess.DEVNULL)
    assert done.returncode == status, f"{script}\n{done.stdout}{done.stderr}"
    return done.stdout if status == 0 else done.stderr


def assert_reachable(ready_file):
    ready = json.loads(pathlib.Path(ready_file).read_text())
    assert [axis["name"] for axis in ready["axes"]] == ["ismc", "reference"]
    (link,) = ready["buses"][0]["links"]
    host, port = re.fullmatch(r"socketcand:(.*):(\d+)/can0", link).groups()
    with socket.create_connection((host, int(port)), timeout=10) as connection:
        assert connection.recv(8) == b"< hi >"[:8]


def stop(folder):
    if (pathlib.Path(folder) / "process").exists():
        return shell(f'"{SCRIPT}" stop "{folder}"', {}, "/")
    return ""


def steps_of_action(inputs):
    """Returns the steps of the composite action with their environment, as the runner computes it."""
    action = yaml.safe_load((PACKAGING / "github-action" / "action.yml").read_text())
    assert action["runs"]["using"] == "composite"
    values = {name: of["default"] for name, of in action["inputs"].items() if "default" in of} | inputs
    assert set(values) == set(action["inputs"])
    for step in action["runs"]["steps"]:
        assert step["shell"] == "bash"
        # An expression inside a script would execute an input as code.
        assert "${{" not in step["run"]
        yield step["run"], {
            name: re.sub(r"\$\{\{ inputs\.(\w+) \}\}", lambda match: values[match.group(1)], text) for name, text in step["env"].items()}


def test_github_action(archive, line_file, tmp_path):
    files = {name: tmp_path / name.lower() for name in ("GITHUB_PATH", "GITHUB_ENV", "GITHUB_OUTPUT")}
    for file in files.values():
        file.touch()
    runner = {name: str(file) for name, file in files.items()} | {
        "GITHUB_ACTION_PATH": str(PACKAGING / "github-action"), "RUNNER_TEMP": str(tmp_path / "runner temp")}
    try:
        for script, environment in steps_of_action({"archive": str(archive), "line": str(line_file)}):
            path = ":".join([*files["GITHUB_PATH"].read_text().split("\n")[::-1], "/usr/bin:/bin"]).strip(":")
            assert shell(script, runner | environment | {"PATH": path}, tmp_path) == ""
        outputs = dict(row.split("=", 1) for row in files["GITHUB_OUTPUT"].read_text().splitlines())
        assert files["GITHUB_ENV"].read_text() == files["GITHUB_OUTPUT"].read_text()
        assert outputs["SERVODROME_API"].startswith("http://127.0.0.1:") and outputs["SERVODROME_TOKEN"]
        assert_reachable(outputs["SERVODROME_READY"])
        # The outputs of the action are those that its step wrote.
        action = yaml.safe_load((PACKAGING / "github-action" / "action.yml").read_text())
        for output in action["outputs"].values():
            assert re.fullmatch(r"\$\{\{ steps\.start\.outputs\.(\w+) \}\}", output["value"]).group(1) in outputs
    finally:
        printed = stop(tmp_path / "runner temp" / "servodrome-line")
    assert "ready, real time" in printed


def test_gitlab_job(archive, line_file, tmp_path):
    job = yaml.safe_load((PACKAGING / "gitlab" / "servodrome.gitlab-ci.yml").read_text())[".servodrome"]
    project = tmp_path / "a project"
    shutil.copytree(PACKAGING, project / "packaging")
    environment = job["variables"] | {
        "CI_PROJECT_DIR": str(project), "SERVODROME_ARCHIVE": str(archive), "SERVODROME_LINE": str(line_file)}
    try:
        script = ['servodrome --version', 'echo "READY=$(bash -c \'echo $SERVODROME_READY\')"']
        printed = shell("\n".join(job["before_script"] + script), environment, project)
        assert re.match(r"servodrome \d", printed)
        assert_reachable(re.search(r"(?m)^READY=(.*)$", printed).group(1))
        assert "ready, real time" in shell("\n".join(job["after_script"]), environment, project)
        assert not (project / ".servodrome-line" / "ready.json").exists(), "the line was not ended"
    finally:
        stop(project / ".servodrome-line")


def test_what_goes_wrong_is_said(archive, tmp_path):
    path = {"PATH": f"{pathlib.Path(PROGRAM).parent}:{os.environ['PATH']}"}
    wrong = "0" * 64
    assert "has another checksum" in shell(f'"{SCRIPT}" install "{archive}" "{tmp_path}/a" {wrong}', {}, tmp_path, 1)
    assert not (tmp_path / "a" / "bin").exists()
    assert "there is no archive" in shell(f'"{SCRIPT}" install "" "{tmp_path}/b"', {}, tmp_path, 1)
    assert "cannot be unpacked" in shell(f'"{SCRIPT}" install "{SCRIPT}" "{tmp_path}/c"', {}, tmp_path, 1)
    (tmp_path / "bad.toml").write_text("[[buss]]\n")
    said = shell(f'"{SCRIPT}" start "{tmp_path}/d" bad.toml', path, tmp_path, 1)
    assert "buss" in said and "the line did not start" in said
    assert "no line was started" in shell(f'"{SCRIPT}" stop "{tmp_path}/e"', {}, tmp_path, 1)
