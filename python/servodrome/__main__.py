"""`python -m servodrome campaign ...`: the commands of the package that the program servodrome does not have."""

from __future__ import annotations

import argparse
import os
import sys
import time
from typing import List, Optional

from .campaign import Store, load_plan
from .campaign.distribute import run_here, run_on_dask
from .campaign.report import html_of, text_of
from .errors import Error


def _progress() -> "object":
    begin = time.monotonic()
    first: List[int] = []

    def show(done: int, of: int, failed: int) -> None:
        if not first:
            first.append(done)
        seconds = time.monotonic() - begin
        rate = (done - first[0]) / seconds if seconds > 0 else 0.0
        bar = "#" * (30 * done // of)
        end = "\n" if done == of else ""
        print(f"\r[{bar:<30}] {done}/{of} runs, {failed} failed, {rate:.0f}/s ", end=end, file=sys.stderr, flush=True)

    return show


def _run(options: argparse.Namespace) -> int:
    plan = load_plan(options.plan)
    store = Store(options.out, plan)
    progress = None if options.quiet else _progress()
    if options.workers == 0 and not options.scheduler:
        run_here(plan, store, progress)  # type: ignore[arg-type]
    else:
        run_on_dask(plan, store, options.workers or 2, options.scheduler, progress)  # type: ignore[arg-type]
    print(store.merge())
    return 0


def _report(options: argparse.Namespace) -> int:
    store = Store(options.folder)
    print(text_of(store), end="")
    if options.html:
        with open(options.html, "w", encoding="utf-8") as file:
            file.write(html_of(store))
    return 0


def main(arguments: Optional[List[str]] = None) -> int:
    """Carries out a command. Returns its exit status: 0, 1 (it did not work), 2 (wrong use)."""
    parser = argparse.ArgumentParser(prog="python -m servodrome", description=__doc__)
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    campaign = commands.add_parser("campaign", help="many runs of a program over scenarios, seeds and parameters")
    verbs = campaign.add_subparsers(required=True, metavar="VERB")
    run = verbs.add_parser("run", help="carry out the runs of a plan that are missing in a folder")
    run.add_argument("plan", help="the plan (TOML)")
    run.add_argument("--out", required=True, help="folder of the results; an interrupted campaign goes on there")
    run.add_argument("--workers", type=int, default=os.cpu_count() or 2, help="processes of the local cluster; 0: this process")
    run.add_argument("--scheduler", default="", help="tcp://HOST:PORT of a Dask scheduler in place of a local cluster")
    run.add_argument("--quiet", action="store_true", help="no progress")
    run.set_defaults(act=_run)
    report = verbs.add_parser("report", help="pass rates, worst cases, dependence on parameters")
    report.add_argument("folder", help="the folder of `campaign run --out`")
    report.add_argument("--html", default="", help="write a page with plots to this file")
    report.set_defaults(act=_report)
    options = parser.parse_args(arguments)
    try:
        return int(options.act(options))
    except Error as error:
        print(f"servodrome: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("\nservodrome: interrupted; the same command goes on with the missing runs", file=sys.stderr)
        return 130


if __name__ == "__main__":
    sys.exit(main())
