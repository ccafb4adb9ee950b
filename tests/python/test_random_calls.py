"""Random calls, some of them invalid, must not crash: a part of fuzz/python_calls.py."""

import os
import pathlib
import subprocess
import sys

ROOT = pathlib.Path(__file__).parents[2]


def test_random_calls_raise_only_what_is_documented():
    script = str(ROOT / "fuzz/python_calls.py")
    result = subprocess.run([sys.executable, script, "--sequences", "300"], capture_output=True, text=True, env=os.environ)
    assert result.returncode == 0, result.stdout + result.stderr
    assert result.stdout.endswith(": 0 findings\n")
