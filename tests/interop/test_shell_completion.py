"""The descriptions of commands for shells and for man: in bash, zsh and fish, and with mandoc, if they are
installed."""

import re
import shutil
import subprocess

import pytest
from line import PROGRAM, servodrome

pytestmark = pytest.mark.once


def completed(words, tmp_path):
    """Returns the completions of bash for the last word."""
    script = tmp_path / "completion.bash"
    script.write_text(servodrome("completion", "bash"))
    quoted = " ".join(f"'{word}'" for word in words)
    shown = subprocess.run(
        ["bash", "-c", f"source {script}; COMP_WORDS=({quoted}); COMP_CWORD={len(words) - 1}; _servodrome; "
         'printf "%s\\n" "${COMPREPLY[@]}"'], capture_output=True, text=True, check=True, cwd=tmp_path)
    assert not shown.stderr, shown.stderr
    return shown.stdout.split()


def test_bash_completes(tmp_path):
    assert "conform" in completed(["servodrome", ""], tmp_path)
    assert completed(["servodrome", "conf"], tmp_path) == ["conform"]
    assert set(completed(["servodrome", "params", ""], tmp_path)) >= {"save", "load", "diff"}
    assert completed(["servodrome", "params", "load", "--st"], tmp_path) == ["--store"]
    assert completed(["servodrome", "probe", "--edge", ""], tmp_path) == ["positive", "negative", "both"]
    assert completed(["servodrome", "get", "--product", "pro"], tmp_path) == ["pronet"]
    assert completed(["servodrome", "move", "--to", ""], tmp_path) == []
    (tmp_path / "my.eds").write_text("")
    assert completed(["servodrome", "get", "--eds", "my"], tmp_path) == ["my.eds"]
    assert {"esi", "jmc_ec"} <= set(completed(["servodrome", "export", ""], tmp_path))


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_every_shell_takes_its_script(shell, tmp_path):
    script = tmp_path / shell
    script.write_text(servodrome("completion", shell))
    assert "--reset-fault" in script.read_text() or "reset-fault" in script.read_text()
    assert shutil.which(shell), f"there is no {shell}: tools/install-dependencies --tests installs it"
    checked = subprocess.run([shell, "-n", script], capture_output=True, text=True, check=False)
    assert checked.returncode == 0 and not checked.stderr, checked.stderr
    if shell == "fish":
        offered = subprocess.run(["fish", "-c", f"source {script}; complete -C 'servodrome params '"],
                                 capture_output=True, text=True, check=True)
        assert {line.split("\t")[0] for line in offered.stdout.splitlines()} >= {"save", "load", "diff"}
    assert "tcsh" in servodrome("completion", "tcsh", status=2)


def test_the_manual_page_is_clean(tmp_path):
    page = tmp_path / "servodrome.1"
    page.write_text(servodrome("manual"))
    shown = subprocess.run(["groff", "-man", "-ww", "-Tascii", page], capture_output=True, text=True, check=True)
    assert not shown.stderr, shown.stderr
    plain = re.sub(".\x08", "", shown.stdout)  # bold letters are printed twice, underlined ones over an underscore
    for word in ("params save", "--reset-fault", "EXIT STATUS"):
        assert word in plain, word
    assert re.search(r"^ +--json +Print JSON\.$", plain, re.MULTILINE), "a switch has no value"


def test_help_fits_a_terminal():
    commands = subprocess.run(["bash", "-c", f"source <({PROGRAM} completion bash); COMP_WORDS=(servodrome ''); COMP_CWORD=1; "
                               '_servodrome; echo "${COMPREPLY[@]}"'], capture_output=True, text=True, check=True).stdout.split()
    for command in [word for word in commands if not word.startswith("-")]:
        said = servodrome(command, "--help")
        assert max(map(len, said.splitlines())) <= 100, (command, said)


def test_a_switch_has_no_value(tmp_path):
    said = servodrome("get", "--help")
    assert re.search(r"^  --json +Print JSON$", said, re.MULTILINE), said
    assert re.search(r"^  -h, --help +Print", said, re.MULTILINE), said
    assert "--node NUMBER" in said and "--bus TEXT" in said
    assert "--bus" in completed(["servodrome", "get", "--json", "--b"], tmp_path)
    assert not re.search(r"-l json -[xr]", servodrome("completion", "fish"))


def test_an_empty_value_is_none():
    assert "value is missing" in servodrome("move", "--by", "1", "--velocity", "", status=2)


def test_help_that_cannot_be_written_is_a_failure():
    with open("/dev/full", "wb") as full:
        told = subprocess.run([PROGRAM, "--help"], stdout=full, stderr=subprocess.PIPE, check=False)
    assert told.returncode == 1 and b"output" in told.stderr
