"""`python -m servodrome campaign ...` and `python -m servodrome trial ...`: the commands of the package that the program servodrome does not have."""

from __future__ import annotations

import argparse
import contextlib
import json
import math
import os
import signal
import sys
import time
from types import FrameType
from typing import Any, Callable, Dict, Iterator, List, Optional

from ._outputs import check_file, make_folder
from .errors import BadValue, Error, MissingPackage
from .trial import Children, Trial, files_of, html_of, junit_of, run_trials


def _at_least(least: int) -> Callable[[str], int]:
    """The type of an option: an integer."""

    def number(text: str) -> int:
        with contextlib.suppress(ValueError):
            if int(text) >= least:
                return int(text)
        raise argparse.ArgumentTypeError(f"{text} is not a number of at least {least}")

    return number


def _seconds(text: str) -> float:
    with contextlib.suppress(ValueError):
        if 0 <= float(text) < math.inf:
            return float(text)
    raise argparse.ArgumentTypeError(f"{text} is not a time in seconds")


@contextlib.contextmanager
def _stops(act: Callable[[], None]) -> Iterator[List[int]]:
    """Ctrl-C and SIGTERM call `act` in place of an exception. The value has their numbers."""
    caught: List[int] = []

    def stop(number: int, _frame: Optional[FrameType]) -> None:
        caught.append(number)
        act()

    before = {number: signal.signal(number, stop) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield caught
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


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
    from .campaign import Store, check_plan, load_plan
    from .campaign.distribute import run_here, run_on_dask

    plan = load_plan(options.plan)
    check_plan(options.plan, plan)
    store = Store(options.out, plan)
    progress = None if options.quiet else _progress()
    try:
        if options.workers == 0 and not options.scheduler:
            run_here(plan, store, progress)  # type: ignore[arg-type]
        else:
            run_on_dask(plan, store, options.workers or 2, options.scheduler, progress)  # type: ignore[arg-type]
        print(store.merge())
    except MissingPackage:
        raise
    except Exception as error:  # noqa: BLE001 (of the store, or of a task: the runs are incomplete)
        print(f"servodrome: {type(error).__name__}: {error}; the same command goes on with the missing runs", file=sys.stderr)
        return 1
    return 0


def _report(options: argparse.Namespace) -> int:
    from .campaign import Store
    from .campaign.report import html_of as campaign_html_of
    from .campaign.report import text_of

    if options.html:
        check_file(options.html, "--html")
    store = Store(options.folder)
    print(text_of(store), end="")
    if options.html:
        with open(options.html, "w", encoding="utf-8") as file:
            file.write(campaign_html_of(store))
    return 0


def _print_trial(view: Dict[str, Any], done: int, of: int) -> None:
    print(f"{done:>4}/{of} {view['outcome']:<12} {view['scenario']}", flush=True)
    if view["outcome"] == "passed":
        return
    if view["reason"]:
        print(f"              {view['reason']}")
    for verdict in view["expectations"]:
        if verdict["outcome"] == "failed":
            print(f"              {verdict['name']}: at {verdict['at_s']:.3f} s {verdict['found']}")


def _trial(options: argparse.Namespace) -> int:
    scenarios = files_of(options.scenarios, options.only)
    if options.list:
        print("\n".join(scenarios))
        return 0
    if not os.path.exists(options.master):
        raise BadValue("there is no such file", options.master, "give the file of the master, a program in Python")
    for path, option in ((options.junit, "--junit"), (options.html, "--html")):
        if path:
            check_file(path, option)
    if options.keep:
        make_folder(options.keep, "--keep")
    trial = Trial(options.master, options.arguments, options.after, options.keep)
    reports = []
    children = Children()
    with _stops(children.stop) as signals:
        for report in run_trials(trial, scenarios, options.jobs, children):
            reports.append(report)
            if not options.json:
                _print_trial(report.view, len(reports), len(scenarios))
    name = " ".join([options.master, *options.arguments])
    for path, text_of in ((options.junit, junit_of), (options.html, html_of)):
        if path:
            with open(path, "w", encoding="utf-8") as file:
                file.write(text_of(reports, name))
    outcomes = [report.view["outcome"] for report in reports]
    if options.json:
        print(json.dumps([report.view for report in reports], indent=2))
    else:
        words = {"passed": "passed", "failed": "failed", "not reached": "not reached", "error": "errors"}
        print(", ".join(f"{outcomes.count(outcome)} {word}" for outcome, word in words.items()))
    if signals:
        print(f"interrupted: {len(reports)} of {len(scenarios)} trials done", file=sys.stderr)
        return 128 + signals[0]
    return 1 if "failed" in outcomes or "error" in outcomes else 0


def main(arguments: Optional[List[str]] = None) -> int:
    """Carries out a command. Returns its exit status: 0, 1 (it did not work), 2 (wrong use)."""
    parser = argparse.ArgumentParser(prog="python -m servodrome", description=__doc__)
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    campaign = commands.add_parser("campaign", help="many runs of a program over scenarios, seeds and parameters")
    verbs = campaign.add_subparsers(required=True, metavar="VERB")
    run = verbs.add_parser("run", help="carry out the runs of a plan that are missing in a folder")
    run.add_argument("plan", help="the plan (TOML)")
    run.add_argument("--out", required=True, help="folder of the results; an interrupted campaign goes on there")
    run.add_argument(
        "--workers", type=_at_least(0), default=os.cpu_count() or 2, help="processes of the local cluster; 0: this process"
    )
    run.add_argument("--scheduler", default="", help="tcp://HOST:PORT of a Dask scheduler in place of a local cluster")
    run.add_argument("--quiet", action="store_true", help="no progress")
    run.set_defaults(act=_run)
    report = verbs.add_parser("report", help="pass rates, worst cases, dependence on parameters")
    report.add_argument("folder", help="the folder of `campaign run --out`")
    report.add_argument("--html", default="", help="write a page with plots to this file")
    report.set_defaults(act=_report)
    trial = commands.add_parser(
        "trial",
        help="a master in Python through scenarios, in virtual time",
        description="Runs a master in Python through scenarios, each in a process of its own, in virtual time. A trial ends the master "
        "after `duration_s` of its scenario, in line time. A trial is an error if it takes more wall time than ten times the sum of "
        "`duration_s`, 2 s and --after, plus 60 s. Exit status: 0; 1: a trial failed or is an error; 2: wrong use; 130: Ctrl-C; 143: "
        "SIGTERM.",
    )
    trial.add_argument("master", help="the file of the program; it opens the buses of the line by python-can and the like")
    trial.add_argument("arguments", nargs="*", help="its arguments; {link}, {host}, {port}, {scenario} and {job} are replaced")
    trial.add_argument("--scenarios", action="append", required=True, help="folders with scenario files, or scenario files")
    trial.add_argument("--only", default="", help="only scenarios whose path contains this text")
    trial.add_argument("--jobs", type=_at_least(1), default=os.cpu_count() or 1, help="so many trials at once")
    trial.add_argument("--after", type=_seconds, default=3.0, help="the line runs on so many seconds after the master has ended")
    trial.add_argument("--junit", default="", help="write the outcomes to this file, as JUnit XML")
    trial.add_argument("--html", default="", help="write a page with all outcomes, the motion and the traffic")
    trial.add_argument("--keep", default="", help="keep the traffic of each trial as captures in this folder")
    trial.add_argument("--json", action="store_true", help="print JSON")
    trial.add_argument("--list", action="store_true", help="list the scenarios and run nothing")
    trial.set_defaults(act=_trial)
    options = parser.parse_args(arguments)
    try:
        return int(options.act(options))
    except Error as error:
        print(f"servodrome: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        rest = "; the same command goes on with the missing runs" if options.act is _run else ""
        print(f"\nservodrome: interrupted{rest}", file=sys.stderr)
        return 130


if __name__ == "__main__":
    sys.exit(main())
