"""Runs the libFuzzer targets of fuzz/ until each has had a number of inputs, and frame targets a number of frames.

An input of a frame target is a dialogue: a device starts, receives the frames of the input, and must answer at the end.
The program therefore runs each target twice: first with inputs of the lengths that libFuzzer chooses, until the number
of inputs is reached; then with long inputs of up to 4096 bytes with many frames each, until the number of frames is
reached. The targets count the frames. Corpora stay in build/fuzz/corpus and grow from run to run; an input that causes
a failure is stored in build/fuzz/findings, and ends its target.

tools/fuzz builds the targets with the address and undefined-behaviour sanitizers; this program needs that build.
"""

import os
import pathlib
import random
import re
import resource
import subprocess
import sys
import time

import report

FRAME_TARGETS = ("canopen_node_fuzz", "ethercat_fuzz", "modbus_fuzz", "serial10_fuzz", "link_fuzz", "answers_fuzz")
TARGETS = (*FRAME_TARGETS, "script_fuzz", "sniff_fuzz", "files_fuzz", "api_fuzz")
KEPT = report.ROOT / "build/fuzz"
LONGEST = 4096
LONG_INPUTS = ("-len_control=0", f"-max_len={LONGEST}", "-keep_seed=1")
LONG_SEEDS = 16  # random bytes: libFuzzer makes its inputs from those that it has, and the corpus has short ones
CHUNK_S = 60  # of one process: between two processes it prints progress and handles Ctrl-C
FAILURE_S = 25  # an input that takes longer is a failure
# The stacks of allocations take a third of the time of some targets; a repeated failure shows them.
ENVIRONMENT = {"ASAN_OPTIONS": "malloc_context_size=1", **os.environ}


def number(text, name):
    """Returns a figure of libFuzzer's final statistics; 0: it is missing."""
    found = re.search(rf"^stat::{name}: *(\d+)", text, re.MULTILINE)
    return int(found.group(1)) if found else 0


class Target:
    """One program and its progress."""

    def __init__(self, name, seed, programs):
        self.name = name
        self.program = programs / name
        self.seed = seed
        self.figures = {"inputs": 0, "frames": 0, "seconds": 0.0, "processor_seconds": 0.0, "coverage": 0, "corpus": 0}
        self.corpus = KEPT / "corpus" / name
        self.findings = KEPT / "findings" / name
        self.corpus.mkdir(parents=True, exist_ok=True)
        self.findings.mkdir(parents=True, exist_ok=True)
        self.seeds = KEPT / "seeds" / name
        subprocess.run([sys.executable, str(report.ROOT / "fuzz/seeds.py"), name, str(self.seeds)], check=True)

    def long_seeds(self):
        folder = KEPT / "long" / self.name
        folder.mkdir(parents=True, exist_ok=True)
        draw = random.Random(self.seed)
        for place in range(LONG_SEEDS):
            (folder / str(place)).write_bytes(draw.randbytes(LONGEST))
        return folder

    def chunk(self, limit, extra):
        """Runs one process. Returns None, or a description of the failure."""
        self.seed += 1
        command = [self.program, f"-seed={self.seed}", f"-timeout={FAILURE_S}", "-print_final_stats=1", *limit, *extra]
        command += [f"-artifact_prefix={self.findings}/", self.corpus, self.seeds]
        if extra == LONG_INPUTS:
            command.append(self.long_seeds())
        began = time.monotonic()
        before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
        process = subprocess.run([str(word) for word in command], capture_output=True, text=True, errors="replace", check=False, env=ENVIRONMENT)
        self.figures["seconds"] += time.monotonic() - began
        self.figures["processor_seconds"] += resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before
        text = process.stderr
        inputs = number(text, "number_of_executed_units")
        self.figures["inputs"] += inputs
        self.figures["frames"] += number(text, "executed_frames")
        coverage = re.findall(r"cov: (\d+)", text)
        self.figures["coverage"] = int(coverage[-1]) if coverage else 0
        self.figures["corpus"] = sum(1 for _ in self.corpus.iterdir())
        if process.returncode == 0 and inputs > 0:
            return None
        lines = [line for line in text.splitlines() if "ERROR" in line or "SUMMARY" in line or "Test unit" in line]
        return f"{self.name} ended with {process.returncode}; the input is in {self.findings}: {lines or text[-400:]}"


def run(target, given, out):
    """Runs until the numbers are reached, the time is over, or a failure occurs."""
    end = time.monotonic() + given.minutes * 60
    goals = [("inputs", given.inputs, [f"-max_len={given.longest}"] if given.longest else ())]
    if target.name in FRAME_TARGETS:
        goals.append(("frames", given.frames, LONG_INPUTS))
    for figure, goal, extra in goals:
        while target.figures[figure] < goal:
            left = end - time.monotonic()
            if left < 1:
                return
            limit = [f"-max_total_time={max(1, int(min(left, given.chunk)))}"]
            if figure == "inputs":
                limit.append(f"-runs={goal - target.figures['inputs']}")
            failure = target.chunk(limit, extra)
            if failure:
                out.finding(failure)
                return
            out.progress(f"{target.name}: {target.figures['inputs']} inputs, {target.figures['frames']} frames")


def main(arguments=None):
    parser = report.options("fuzz", __doc__)
    parser.add_argument("targets", nargs="*", metavar="TARGET", help=f"of {', '.join(TARGETS)} (all)")
    parser.add_argument("--inputs", type=float, default=1e7, help="for each target (1e7)")
    parser.add_argument("--frames", type=float, default=1e8, help="for each target of frames (1e8)")
    parser.add_argument("--longest", type=int, default=0, help="bytes of an input at most (libFuzzer chooses); not for the frames")
    parser.add_argument("--minutes", type=float, default=600, help="for each target at most (600)")
    parser.add_argument("--chunk", type=int, default=CHUNK_S, help=f"seconds of a process ({CHUNK_S})")
    parser.add_argument("--build", metavar="FOLDER", default=str(report.ROOT / "build/asan-ubsan"), help="another build of the targets")
    given = parser.parse_args(arguments)
    programs = pathlib.Path(given.build).resolve() / "fuzz"
    given.inputs, given.frames = int(given.inputs), int(given.frames)
    names = given.targets or list(TARGETS)
    for name in names:
        if name not in TARGETS:
            parser.error(f"there is no target {name}: choose from {', '.join(TARGETS)}")
        if not (programs / name).exists():
            parser.error(f"{programs / name} does not exist: run tools/fuzz --build first")
    out = report.Report("fuzz", given)
    out.figures["sanitizers"] = "address, undefined"
    results = out.figures["targets"] = {}
    interrupted = False
    try:
        for name in names:
            target = Target(name, given.seed * 1_000_000, programs)
            results[name] = target.figures
            run(target, given, out)
    except KeyboardInterrupt:
        interrupted = True
    for figures in results.values():
        figures["seconds"] = round(figures["seconds"], 1)
        figures["processor_seconds"] = round(figures["processor_seconds"], 1)
    return out.finish(interrupted)


if __name__ == "__main__":
    sys.exit(main())
