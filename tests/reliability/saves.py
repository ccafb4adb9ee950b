"""Kills `servodrome up` with SIGKILL while a drive saves its parameters into a file (1010h).

Each run starts the line with the file of the previous run. It reads the parameters and checks them: all must be from
the same save, either the last one that the drive acknowledged or the one that was in progress when the process was
killed. The drive must have no memory fault. Then the program writes new parameters and saves them, several times, and
kills the process at a random moment during one of these saves.

Eight parameters, most of them in different places of the image, carry the number of the save, so the program detects a
mixture of two saves. SIGKILL ends the process, not the machine: data that the process has written stay in the page
cache. tests/dictionary/store_test.cpp tests a loss of power at every byte of the image.
"""

import pathlib
import random
import statistics
import sys
import tempfile
import time

import report
import sdo
import up

NODE = 1
SAVE = int.from_bytes(b"save", "little")
OBJECTS = ((0x6081, 0), (0x6083, 0), (0x6084, 0), (0x6085, 0), (0x6099, 1), (0x6099, 2), (0x609A, 0), (0x6065, 0))
FIRST_VALUE = 1000
MOST_SAVES_BEFORE = 3
LINE = """
[[bus]]
name = "can0"
links = ["socketcand:127.0.0.1:0/can0"]

[[axis]]
name = "x"
product = "{product}"
node = 1
store = "parameters"
"""


class Kills:
    """The runs on one file."""

    def __init__(self, given, out, folder):
        self.given = given
        self.report = out
        self.folder = folder
        self.draw = random.Random(given.seed)
        self.acknowledged = None  # number of the last save with an answer; None: nothing is saved
        self.under_way = None
        self.number = FIRST_VALUE
        self.save_s = [0.001]
        self.counts = {"old": 0, "new": 0, "after_the_answer": 0, "saves": 0}

    def fail(self, run, text):
        self.report.finding(f"run {run} of seed {self.given.seed}: {text}")

    def run(self, run):
        line = up.Up(self.folder, LINE.format(product=self.given.product))
        try:
            client = sdo.Client(line.link("can0"))
            self.check(run, client)
            for _ in range(self.draw.randrange(MOST_SAVES_BEFORE)):
                self.save(client)
            self.save_and_kill(run, line, client)
            client.close()
        finally:
            line.kill()

    def check(self, run, client):
        """Reads the parameters from the file."""
        values = [client.read(NODE, index, sub) for index, sub in OBJECTS]
        found = [value - place for place, value in enumerate(values)]
        code = client.read(NODE, 0x603F)
        if code:
            self.fail(run, f"603Fh is {code:04X}h; values {values}")
        if self.acknowledged is None:
            return
        if len(set(found)) != 1:
            self.fail(run, f"values of different saves: {found}; acknowledged {self.acknowledged}, under way {self.under_way}")
        elif found[0] == self.under_way:
            self.counts["new"] += 1
            self.acknowledged = self.under_way
        elif found[0] == self.acknowledged:
            self.counts["old" if self.under_way is not None else "after_the_answer"] += 1
        else:
            self.fail(run, f"save {found[0]}; acknowledged {self.acknowledged}, under way {self.under_way}")
        if found[0] in (self.acknowledged, self.under_way):
            self.acknowledged = found[0]
        self.under_way = None

    def write(self, client):
        self.number += 1
        for place, (index, sub) in enumerate(OBJECTS):
            client.write(NODE, index, sub, self.number + place, 4)

    def save(self, client):
        self.write(client)
        began = time.monotonic()
        client.write(NODE, 0x1010, 1, SAVE, 4)
        self.save_s = [*self.save_s[-50:], time.monotonic() - began]
        self.acknowledged = self.number
        self.counts["saves"] += 1

    def save_and_kill(self, run, line, client):
        self.write(client)
        self.under_way = self.number
        delay = self.draw.uniform(0.0, 1.2 * statistics.median(self.save_s))
        client.begin(NODE, sdo.write_request(0x1010, 1, SAVE, 4))
        end = time.monotonic() + delay
        while time.monotonic() < end:
            pass
        line.kill()
        try:
            answer = client.end(NODE)
        except sdo.Lost:
            return
        if answer[0] == 0x80:
            self.fail(run, "the drive refused to save")
            self.under_way = None
        else:
            self.acknowledged = self.number
            self.under_way = None


def main(arguments=None):
    parser = report.options("saves", __doc__)
    parser.add_argument("--runs", type=int, default=1000, help="number of kills (1000)")
    parser.add_argument("--product", default="generic402", choices=("generic402", "ismc"), help="(generic402)")
    parser.add_argument("--folder", type=pathlib.Path, help="where the parameter file is (a temporary folder)")
    given = parser.parse_args(arguments)
    out = report.Report("saves", given)
    interrupted = False
    done = 0
    with tempfile.TemporaryDirectory() as temporary:
        kills = Kills(given, out, given.folder or temporary)
        try:
            for run in range(given.runs):
                kills.run(run)
                done += 1
                out.progress(f"{done} of {given.runs} kills, {kills.counts}")
        except KeyboardInterrupt:
            interrupted = True
    out.figures["kills"] = done
    out.figures["kills_before_the_answer"] = kills.counts["old"] + kills.counts["new"]
    out.figures |= kills.counts
    out.figures["median_save_ms"] = round(1000 * statistics.median(kills.save_s), 3)
    return out.finish(interrupted)


if __name__ == "__main__":
    sys.exit(main())
