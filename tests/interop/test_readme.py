"""Runs the README's Python code on the built-in line."""

import os
import pathlib
import re
import subprocess
import sys

import pytest
from line import Line

README = pathlib.Path(__file__).parents[2] / "README.md"
BLOCKS = re.findall(r"```python\n(.*?)```", README.read_text(), re.DOTALL)
SAYS = ["4300100092010200\n", "moved by ", "["]
# The links of the built-in line, each on a free port.
LINKS = {"can0": "socketcand:127.0.0.1:29536/can0", "rs485": "tcp:127.0.0.1:1502", "ecat": "udp:127.0.0.1:34980"}
PORT = r":(\d+)(?=/|$)"


def port(link):
    return re.search(PORT, link).group(1)


@pytest.mark.once
@pytest.mark.parametrize("number", range(len(SAYS)))
def test_a_snippet_of_the_readme(tmp_path, eds, number):
    assert len(BLOCKS) == len(SAYS)
    text = (README.parent / "lines/default.toml").read_text()
    line = Line(tmp_path, text, [f"{bus}={re.sub(PORT, ':0', link)}" for bus, link in LINKS.items()])
    try:
        snippet = BLOCKS[number]
        for bus, link in LINKS.items():
            assert link in text
            snippet = snippet.replace(port(link), port(line.links[bus][0]))
        assert snippet != BLOCKS[number], "it uses a port of the built-in line"
        os.symlink(eds("generic402"), tmp_path / "generic402.eds")
        result = subprocess.run(
            [sys.executable, "-c", snippet],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            timeout=120,
            check=False,
        )
        assert result.returncode == 0, result.stderr
        assert result.stdout.startswith(SAYS[number]), result.stdout
        if number == 1:
            assert abs(int(result.stdout.rpartition(" ")[2]) - 3 * 131072) <= 8
    finally:
        line.stop()
