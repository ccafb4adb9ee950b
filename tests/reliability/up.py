"""`servodrome up` as a child process on free ports, for tests that kill it or connect to its ports."""

import json
import os
import pathlib
import signal
import subprocess
import time

PATIENCE_S = 60.0  # timeout for events that never come
POLL_S = 0.002


class Up:
    """A line in real time, until stop() or kill()."""

    def __init__(self, folder, text, arguments=()):
        """`text`: the line file, in which links have port 0. Raises RuntimeError if the line does not become ready."""
        self.folder = pathlib.Path(folder)
        file = self.folder / "line.toml"
        file.write_text(text, encoding="utf-8")
        ready = self.folder / "ready.json"
        ready.unlink(missing_ok=True)
        program = os.environ["SERVODROME"]
        command = [program, "up", str(file), "--api", "127.0.0.1:0", "--ready-file", str(ready), "--json", *arguments]
        with open(self.folder / "output", "ab") as output:
            self.process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=output, stderr=output)
        end = time.monotonic() + PATIENCE_S
        while not ready.exists():
            if self.process.poll() is not None or time.monotonic() > end:
                self.kill()
                raise RuntimeError(f"servodrome up ended or is not ready: {(self.folder / 'output').read_text()[-400:]}")
            time.sleep(POLL_S)
        self.ready = json.loads(ready.read_text(encoding="utf-8"))

    def link(self, bus, number=0):
        """The link of a bus: "socketcand:127.0.0.1:40123/can0"."""
        found = next(entry for entry in self.ready["buses"] if entry["name"] == bus)
        return found["links"][number]

    def kill(self):
        """SIGKILL, at once."""
        self.process.kill()
        self.process.wait()

    def stop(self):
        """Ctrl-C; its exit status."""
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
        try:
            return self.process.wait(PATIENCE_S)
        except subprocess.TimeoutExpired:
            self.kill()
            return None
