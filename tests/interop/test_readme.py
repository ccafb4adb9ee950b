"""The README's Python runs as it is printed, on the built-in line."""

import os
import pathlib
import re
import subprocess
import sys

import pytest
from line import Line

README = pathlib.Path(__file__).parents[2] / "README.md"
BLOCKS = re.findall(r"```python\n(.*?)```", README.read_text(), re.DOTALL)
SAYS = ["4300100092010200\n", "moved by "]


@pytest.mark.once
@pytest.mark.parametrize("number", range(len(SAYS)))
def test_a_snippet_of_the_readme(tmp_path, eds, number):
    assert len(BLOCKS) == len(SAYS)
    text = (README.parent / "lines/default.toml").read_text()
    line = Line(tmp_path, text, ["can0=socketcand:127.0.0.1:0/can0"])
    try:
        port = re.search(r":(\d+)/can0", line.links["can0"][0]).group(1)
        assert "29536" in BLOCKS[number], "the port of the built-in line"
        os.symlink(eds("generic402"), tmp_path / "generic402.eds")
        result = subprocess.run(
            [sys.executable, "-c", BLOCKS[number].replace("29536", port)],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            timeout=120,
            check=False,
        )
        assert result.returncode == 0, result.stderr
        assert result.stdout.startswith(SAYS[number]), result.stdout
        if number == 1:
            assert abs(int(result.stdout.rpartition(" ")[2]) - 3 * 131072) <= 3
    finally:
        line.stop()
