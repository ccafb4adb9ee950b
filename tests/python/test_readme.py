"""Runs the examples of python/README.md."""

import os
import pathlib
import re
import subprocess
import sys

import pytest
import servodrome

README = pathlib.Path(__file__).parents[2] / "python/README.md"
EXAMPLES = re.findall(r"```python\n(.*?)```", README.read_text(encoding="utf-8"), flags=re.DOTALL)


@pytest.mark.parametrize("code", EXAMPLES, ids=range(len(EXAMPLES)))
def test_an_example(code, program):
    environment = {**os.environ, "PYTHONPATH": str(pathlib.Path(servodrome.__path__[0]).parent), "SERVODROME": program}
    result = subprocess.run(
        [sys.executable, "-W", "error", "-c", code], capture_output=True, text=True, env=environment, timeout=120, check=False
    )
    assert (result.returncode, result.stderr) == (0, ""), result.stdout
    assert result.stdout


def test_the_table_has_every_error():
    text = README.read_text(encoding="utf-8")
    errors = text.partition("## Errors")[2].partition("Lines are usable")[0]
    named = set(re.findall(r"`([A-Z]\w+)`", errors))
    ours = {name for name in servodrome.__all__ if isinstance(getattr(servodrome, name), type)}
    ours = {name for name in ours if issubclass(getattr(servodrome, name), servodrome.Error)} - {"Error"}
    assert ours <= named
