"""`servodrome studio` for the buses of a line in another process."""

import json
import subprocess
import time

from line import PROGRAM, ApiError, Bench, wait_for


def patiently(test):
    """Repeats the action if a slave's watchdog (100 ms) expired or its master gave up, because a busy machine may delay
    the cycles."""
    for _ in range(8):
        try:
            return test()
        except (ApiError, AssertionError) as error:
            if not any(word in str(error) for word in ("watchdog", "SAFEOP", "do not come back", "not exchanged", "lost")):
                raise
            last = error
            time.sleep(2)
    raise last


class Studio:
    """Runs `servodrome studio` on buses, until stop()."""

    def __init__(self, *buses, options=()):
        command = [PROGRAM, "studio", "--api", "127.0.0.1:0", "--json", "--timeout", "2", *options]
        for bus in buses:
            command += ["--bus", bus]
        self.process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True)
        self.ready = json.loads(self.process.stdout.readline())
        self.bench = Bench(self.ready["api"])

    @classmethod
    def at(cls, api):
        """A studio that already runs; this object does not end it."""
        studio = cls.__new__(cls)
        studio.bench = Bench(api)
        return studio

    def stop(self):
        self.process.terminate()
        assert self.process.wait(60) == 0

    def job(self, axis, **order):
        """Begins a job and returns it."""
        return self.bench.post(f"axes/{axis}/jobs", order)

    def over(self, job):
        """Returns the job when it is over."""

        def look():
            now = self.bench.get(f"jobs/{job['id']}")
            return now if now["state"] != "running" else None

        return wait_for(look, f"job {job}")

    def does(self, axis, **order):
        job = self.over(self.job(axis, **order))
        assert job["state"] == "done", json.dumps(job)
        return job
