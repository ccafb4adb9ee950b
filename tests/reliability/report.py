"""Common parts of the programs of this folder: options, progress, findings, the report."""

import argparse
import json
import os
import pathlib
import signal
import subprocess
import sys
import time

ROOT = pathlib.Path(__file__).parents[2]
sys.path.append(str(ROOT / "python"))
os.environ.setdefault("SERVODROME_LIBRARY", str(ROOT / "build/release/src/capi/libservodrome.so"))
os.environ.setdefault("SERVODROME", str(ROOT / "build/release/src/app/servodrome"))

_PROGRESS_S = 30.0
_MOST_PRINTED = 20


def options(name, description):
    """A parser with the options that all programs have."""
    parser = argparse.ArgumentParser(
        prog=f"tools/reliability {name}", description=description, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seed", type=int, default=1, help="of all random choices (1)")
    parser.add_argument("--json", action="store_true", help="print the report as JSON")
    parser.add_argument("--quiet", action="store_true", help="no progress on standard error")
    return parser


def resident_kib():
    """Returns the memory of this process, in KiB."""
    with open("/proc/self/statm", encoding="ascii") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE") // 1024


def commit():
    """The commit of the working tree, with "+" if it has changes; "" outside of a repository."""
    command = ["git", "-C", str(ROOT), "describe", "--always", "--abbrev=10", "--dirty=+"]
    try:
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return ""


def _interrupt(_number, _frame):
    raise KeyboardInterrupt


class Report:
    """Figures and findings of a run. `finish` prints them; its result is the exit status."""

    def __init__(self, name, given):
        self.name = name
        self.given = given
        self.figures = {}
        self.findings = []
        self.finding_count = 0
        self._began = time.monotonic()
        self._told = self._began
        # A shell starts background jobs with SIGINT ignored. SIGTERM therefore ends a run early like Ctrl-C, with its
        # report.
        signal.signal(signal.SIGTERM, _interrupt)

    def finding(self, text):
        """Counts an event that must not happen. Keeps the first findings and counts all."""
        self.finding_count += 1
        if len(self.findings) < _MOST_PRINTED:
            self.findings.append(text)
            print(f"{self.name}: FINDING: {text}", file=sys.stderr, flush=True)

    def progress(self, text):
        """Prints the text if the last one was some time ago."""
        now = time.monotonic()
        if self.given.quiet or now - self._told < _PROGRESS_S:
            return
        self._told = now
        print(f"{self.name}: {now - self._began:.0f} s: {text}", file=sys.stderr, flush=True)

    def finish(self, interrupted=False):
        """Prints the report. Returns 0, or 1 if there was a finding."""
        result = {
            "name": self.name,
            "commit": commit(),
            "options": {key: value for key, value in vars(self.given).items() if key not in ("json", "quiet")},
            "interrupted": interrupted,
            "seconds": round(time.monotonic() - self._began, 1),
            "processor_seconds": round(time.process_time(), 1),
            **self.figures,
            "finding_count": self.finding_count,
            "findings": self.findings,
        }
        if self.given.json:
            print(json.dumps(result, indent=1))
        else:
            for key, value in result.items():
                print(f"{key:24} {value}")
        return 1 if self.finding_count else 0
