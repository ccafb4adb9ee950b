"""Runs a campaign on a Dask cluster of two workers; one of them is killed during the run, and its scheduler is
restarted.

  python tests/python/campaign_chaos.py PLAN OUT      prints runs per second, and compares with a loop in one process

Exit status 0: every run exists once, and all rows equal those of the loop.
"""

import os
import pathlib
import socket
import subprocess
import sys
import threading
import time

PACKAGE = pathlib.Path(__file__).parents[2] / "python"
sys.path.append(str(PACKAGE))
from servodrome import campaign  # noqa: E402
from servodrome.campaign import distribute  # noqa: E402


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


class Cluster:
    """A scheduler and two workers, each a process that is restarted when it ends."""

    def __init__(self):
        self.port = free_port()
        self.address = f"tcp://127.0.0.1:{self.port}"
        scheduler = ["distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", str(self.port), "--no-dashboard"]
        worker = ["distributed.cli.dask_worker", self.address, "--nthreads", "1", "--no-nanny", "--no-dashboard"]
        self.commands = [scheduler, worker, worker]
        self.processes = [None] * 3
        self.closed = False
        self.keeper = threading.Thread(target=self.keep)
        self.keeper.start()

    def keep(self):
        while not self.closed:
            for place, process in enumerate(self.processes):
                if process is None or process.poll() is not None:
                    module, *options = self.commands[place]
                    self.processes[place] = subprocess.Popen(
                        [sys.executable, "-m", module, *options],
                        env={**os.environ, "PYTHONPATH": str(PACKAGE)},
                        stdout=subprocess.DEVNULL,
                        stderr=subprocess.DEVNULL,
                    )
            time.sleep(0.2)

    def close(self):
        self.closed = True
        self.keeper.join()
        for process in self.processes:
            process.kill()
            process.wait()


def main(plan_path, out):
    plan = campaign.load_plan(plan_path)
    loop = campaign.Store(str(pathlib.Path(out) / "loop"), plan)
    begin = time.monotonic()
    distribute.run_here(plan, loop)
    print(f"loop: {plan.size / (time.monotonic() - begin):.0f} runs/s")

    store = campaign.Store(str(pathlib.Path(out) / "cluster"), plan)
    cluster = Cluster()
    killed = []

    def disturb(done, of, _failed):
        if len(killed) == 0 and done > of // 4:
            killed.append("worker")
            cluster.processes[1].kill()
        if len(killed) == 1 and done > of // 2:
            killed.append("scheduler")
            cluster.processes[0].kill()

    try:
        begin = time.monotonic()
        distribute.run_on_dask(plan, store, scheduler=cluster.address, progress=disturb)
        print(f"cluster, with both killed: {plan.size / (time.monotonic() - begin):.0f} runs/s")
    finally:
        cluster.close()
    table = store.table()
    once = table.column("run").to_pylist() == list(range(plan.size))
    equal = table.equals(loop.table())
    print(f"killed: {', '.join(killed)}; every run once: {once}; equal to the loop: {equal}")
    return 0 if once and equal and killed == ["worker", "scheduler"] else 1


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
