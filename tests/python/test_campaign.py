"""Campaigns: plans, rows that depend only on the plan, and folders that stay valid after kills."""

import os
import pathlib
import signal
import subprocess
import sys
import time

import pytest
import servodrome
from conftest import ROOT
from servodrome import campaign
from servodrome.campaign import distribute, report
from servodrome.campaign.plan import values_of

pytest.importorskip("pyarrow")
distributed = pytest.importorskip("distributed")

LINE = '[[bus]]\nname = "can0"\n[[axis]]\nname = "x"\nproduct = "generic402"\nnode = 1\n'
PROGRAM = '''
import random

def figures(line, parameters, seed):
    line.advance(0.01)
    draws = random.Random(seed)
    if parameters.get("fails") and seed % 3 == 0:
        raise RuntimeError("as asked")
    return {"sum": draws.random() + parameters.get("a", 0), "position": line.axes["x"].position}
'''
SCENARIO = 'title = "t"\nseed = 9\n[[rule]]\ndo = "show"\nobject = "6041"\nvalue = 0\n[[expect]]\nname = "never seen"\nwhen = { time_ms = 5 }\nalways = { powered = true }\n'


def written(folder, plan):
    (folder / "cell.toml").write_text(LINE)
    (folder / "program.py").write_text(PROGRAM)
    (folder / "s.toml").write_text(SCENARIO)
    path = folder / "plan.toml"
    path.write_text(plan)
    return str(path)


SMALL = 'line = "cell.toml"\nprogram = "program.py:figures"\nseeds = 5\n[parameters]\na = [1, 2]\n"axis.x.load.inertia_kgm2" = { from = 1e-5, to = 1e-3, count = 3, scale = "log" }\n'


def test_values_of_a_parameter_are_in_order():
    rows = [{"gain": gain, "outcome": "passed", "figure_x": 1.0} for gain in ["off", 100, 0.5, 1e-05, 10, 5]]
    assert [value for value, *_ in report.spread(rows, "gain", "figure_x")] == [1e-05, 0.5, 5, 10, 100, "off"]
    assert [value for value, *_ in report.rates(rows, "gain")] == [1e-05, 0.5, 5, 10, 100, "off"]


def test_runs_are_all_combinations(tmp_path):
    plan = campaign.load_plan(written(tmp_path, SMALL))
    assert plan.size == 30
    runs = [plan.run(number) for number in range(30)]
    assert len({(run.seed, *run.parameters.values()) for run in runs}) == 30
    assert runs[0].seed == 1 and runs[4].seed == 5 and runs[5].parameters["axis.x.load.inertia_kgm2"] == pytest.approx(1e-4)


def test_values():
    assert values_of("p", {"from": 0, "to": 1, "count": 3}, "") == [0, 0.5, 1]
    assert values_of("p", 3, "") == [3]
    for bad in ([], {"from": 0, "to": 1, "count": 1}, {"from": 0, "to": 1, "count": 3, "scale": "log"}, [[1]]):
        with pytest.raises(servodrome.BadValue, match="p: "):
            values_of("p", bad, "plan.toml")


@pytest.mark.parametrize(
    ("plan", "error"),
    [
        ("seeds = 2\n", "`line` is missing"),
        ('line = "cell.toml"\nseedz = 1\n', "unknown key seedz"),
        ('line = "nowhere.toml"\n', "cannot be read"),
        ('line = "cell.toml"\nseeds = 0\n', "seeds: 0"),
        ('line = "cell.toml"\n\n  seeds = "3"\n', "plan.toml:3:3: seeds: '3' is not an integer"),
        ('line = "cell.toml"\nseeds = true\n', "seeds: True is not an integer"),
        ('line = "cell.toml"\nfirst_seed = 1.5\n', "plan.toml:2:1: first_seed: 1.5"),
        ("line = 3\n", "plan.toml:1:1: line: 3 is not a string"),
        ('line = "cell.toml"\nscenarios = "s.toml"\n', "scenarios: 's.toml' is not a list of strings"),
        ('line = "cell.toml"\nparameters = [1]\n', "parameters: .* is not a table"),
        ('line = "cell.toml"\n[parameters]\nb = 1\n"a.b" = [1, "x"]\n', "plan.toml:4:2: a.b: .* has no values"),
        ('line = "cell.toml"\n[parameters]\na = { from = 1, to = 2, count = 3, scael = "log" }\n', "plan.toml:3:1: a: a range has no key scael"),
        ('line = "cell.toml"\n[parameters]\na = { from = 1, to = 2, cuont = 3 }\n', "plan.toml:3:1: a: a range has no key cuont"),
        ('line = "cell.toml"\n[parameters]\na = { from = "1", to = 2, count = 3 }\n', "a: .* is no range"),
        ('line = "cell.toml"\n[parameters]\nseed = [1]\n', "plan.toml:3:1: seed is the name of a column"),
        ('line = "cell.toml"\n[parameters]\nfigure_a = 1\n', "figure_a is the name of a column"),
        ('line = "cell.toml"\nscenarios = ["*.none"]\n', "there is no file"),
        ('line = "cell.toml"\n[parameters]\n"axis.q.node" = [1]\n', "the line has no axis 'q'"),
        ('line = "cell.toml"\nseeds = 100000000\n[parameters]\na = [1, 2]\n', "runs"),
    ],
)
def test_errors_of_plans(tmp_path, plan, error):
    with pytest.raises(servodrome.BadValue, match=error):
        campaign.load_plan(written(tmp_path, plan))


def test_rows_have_outcomes(tmp_path):
    plan = campaign.load_plan(
        written(tmp_path, 'line = "cell.toml"\nprogram = "program.py:figures"\nseeds = 3\nscenarios = ["s.toml"]\n[parameters]\nfails = true\n')
    )
    rows = [campaign.execute(plan, number) for number in range(3)]
    assert [row["outcome"] for row in rows] == ["passed", "passed", "passed"], "the scenario's expectations decide"
    assert rows[2]["error"] == "RuntimeError: as asked" and rows[0]["acts"] == 1
    bad = plan._replace(scenarios=[], parameters={"axis.x.product": ["unknown"]})
    assert campaign.execute(bad, 0)["outcome"] == "error"
    alone = plan._replace(scenarios=[])
    assert [campaign.execute(alone, number)["outcome"] for number in range(3)] == ["passed", "passed", "failed"]
    store = campaign.Store(str(tmp_path / "out"), alone)
    distribute.run_here(alone, store)
    assert "1 times: RuntimeError: as asked" in report.text_of(store)


def executed(folder, program, scenario=""):
    """The row of a program on the line, with a scenario or without."""
    path = written(folder, 'line = "cell.toml"\nprogram = "program.py:figures"\n' + ('scenarios = ["s.toml"]\n' if scenario else ""))
    (folder / "program.py").write_text(program)
    (folder / "s.toml").write_text('title = "t"\n' + scenario)
    return campaign.execute(campaign.load_plan(path), 0)


def test_an_exit_is_an_outcome(tmp_path):
    row = executed(tmp_path, "import sys\ndef figures(line, parameters, seed):\n    sys.exit(0)\n")
    assert (row["outcome"], row["error"]) == ("failed", "SystemExit: 0")


SHOWS = '[[rule]]\ndo = "show"\nobject = "6041"\nvalue = 0\n'
NEVER_ACTS = '[[rule]]\non = { message = "lss_request" }\ndo = "withhold"\n'
MOVES = """
def figures(line, parameters, seed):
    axis = line.axes["x"]
    axis.enable()
    axis.velocity(5, acceleration=2000, units="revolutions", wait=False)
    return {}
"""
WAITS = "def figures(line, parameters, seed):\n    line.advance(2)\n    return {}\n"
RAISES = "def figures(line, parameters, seed):\n    raise RuntimeError('as asked')\n"


@pytest.mark.parametrize(
    ("program", "scenario", "outcome", "failed"),
    [
        (WAITS, SHOWS, "passed", ""),
        (WAITS, NEVER_ACTS, "not reached", ""),
        (MOVES, SHOWS, "failed", "x rests after the master has ended"),
        (MOVES, NEVER_ACTS, "failed", "x rests after the master has ended"),
        (WAITS, "duration_s = 1\n" + SHOWS, "failed", "the master ends by itself"),
        (RAISES, 'master = "success"\n' + SHOWS, "failed", ""),
        (RAISES, 'master = "failure"\n' + SHOWS, "passed", ""),
        (WAITS, 'master = "failure"\n' + SHOWS, "failed", ""),
    ],
)
def test_a_run_with_a_scenario_is_a_trial(tmp_path, program, scenario, outcome, failed):
    row = executed(tmp_path, program, scenario)
    assert (row["outcome"], row["failed"]) == (outcome, failed), row


def test_a_changed_program_is_loaded_again(tmp_path):
    rows = [executed(tmp_path, f"def figures(line, parameters, seed):\n    return {{'a': {number}}}\n") for number in (1, 2)]
    assert [row["figure_a"] for row in rows] == [1, 2]


@pytest.mark.parametrize("name", ["program.py", "s.toml"])
def test_another_file_than_that_of_the_command_is_refused(tmp_path, name):
    plan = campaign.load_plan(written(tmp_path, 'line = "cell.toml"\nprogram = "program.py:figures"\nscenarios = ["s.toml"]\n'))
    with open(tmp_path / name, "a") as file:
        file.write("# changed\n")
    with pytest.raises(servodrome.BadValue, match="differs from the file of the command"):
        campaign.execute(plan, 0)


def test_one_command_at_a_time_writes_to_a_folder(tmp_path):
    plan = campaign.load_plan(written(tmp_path, SMALL))
    store = campaign.Store(str(tmp_path / "out"), plan)
    with pytest.raises(servodrome.BadValue, match="another command"):
        campaign.Store(str(tmp_path / "out"), plan)
    distribute.run_here(plan, store)
    store.add([{**store.table().to_pylist()[3]}])  # of a command on another machine
    assert store.table().column("run").to_pylist() == list(range(30))


@pytest.fixture
def scheduler():
    with distributed.LocalCluster(n_workers=1, threads_per_worker=1, processes=False, protocol="tcp", host="127.0.0.1", dashboard_address="127.0.0.1:0") as cluster:
        yield cluster.scheduler_address


def test_a_full_disk_ends_the_command(tmp_path, scheduler, monkeypatch):
    """Also on a cluster: it is no lost scheduler."""
    plan = campaign.load_plan(written(tmp_path, SMALL))
    store = campaign.Store(str(tmp_path / "out"), plan)

    def full(rows):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(store, "add", full)
    with pytest.raises(OSError, match="No space"):
        distribute.run_on_dask(plan, store, scheduler=scheduler)


def test_an_error_of_the_task_ends_the_command(tmp_path, scheduler):
    plan = campaign.load_plan(written(tmp_path, SMALL))
    (tmp_path / "program.py").unlink()
    with pytest.raises(servodrome.BadValue, match="cannot be loaded"):
        distribute.run_on_dask(plan, campaign.Store(str(tmp_path / "out"), plan), scheduler=scheduler)


def test_a_run_that_kills_its_process_is_an_error(tmp_path):
    plan = written(tmp_path, 'line = "cell.toml"\nprogram = "program.py:figures"\nseeds = 4\n')
    (tmp_path / "program.py").write_text(
        "import os, signal\ndef figures(line, parameters, seed):\n    if seed == 3: os.kill(os.getpid(), signal.SIGKILL)\n    return {}\n"
    )
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "python"), "DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "1"}
    command = [sys.executable, "-m", "servodrome", "campaign", "run", plan, "--out", str(tmp_path / "out"), "--workers", "1", "--quiet"]
    subprocess.run(command, env=environment, check=True, capture_output=True)
    rows = campaign.Store(str(tmp_path / "out")).table().to_pylist()
    assert [row["outcome"] for row in rows] == ["passed", "passed", "error", "passed"]
    assert "died" in rows[2]["error"]


def test_a_folder_belongs_to_one_plan(tmp_path):
    plan = campaign.load_plan(written(tmp_path, SMALL))
    campaign.Store(str(tmp_path / "out"), plan)
    with pytest.raises(servodrome.BadValue, match="another plan"):
        campaign.Store(str(tmp_path / "out"), plan._replace(seeds=6))
    with pytest.raises(servodrome.BadValue, match="no campaign.json"):
        campaign.Store(str(tmp_path / "none"))


def test_a_cluster_gives_the_rows_of_a_loop(tmp_path):
    plan = campaign.load_plan(written(tmp_path, SMALL))
    here, there = campaign.Store(str(tmp_path / "a"), plan), campaign.Store(str(tmp_path / "b"), plan)
    distribute.run_here(plan, here)
    seen = []
    distribute.run_on_dask(plan, there, workers=2, progress=lambda *numbers: seen.append(numbers), batch=4)
    assert here.table().equals(there.table())
    assert seen[-1] == (30, 30, 0) and [done for done, _, _ in seen] == sorted(done for done, _, _ in seen)


def test_it_goes_on_after_a_kill(tmp_path):
    plan = campaign.load_plan(written(tmp_path, SMALL.replace("seeds = 5", "seeds = 500")))
    command = [sys.executable, "-m", "servodrome", "campaign", "run", str(tmp_path / "plan.toml"), "--out", str(tmp_path / "out")]
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "python")}
    process = subprocess.Popen([*command, "--workers", "0", "--quiet"], env=environment)
    parts = tmp_path / "out/parts"
    while not (parts.exists() and len(list(parts.glob("*.parquet"))) > 3):
        time.sleep(0.01)
    process.send_signal(signal.SIGKILL)
    process.wait()
    store = campaign.Store(str(tmp_path / "out"), plan)
    before = len(store.done())
    assert 0 < before < plan.size
    files = store.files()
    distribute.run_here(plan, store)
    assert store.table().column("run").to_pylist() == list(range(plan.size)), "each run once"
    assert store.files()[: len(files)] != [] and set(files) <= set(store.files()), "nothing is computed again"


def test_reports(tmp_path):
    plan = campaign.load_plan(written(tmp_path, SMALL))
    store = campaign.Store(str(tmp_path / "out"), plan)
    distribute.run_here(plan, store)
    text = report.text_of(store)
    assert "30 of 30 runs" in text and "passed             30  100.00 %" in text and "sum, greatest amounts" in text
    page = report.html_of(store)
    assert page.count("<svg") == 4
    import pyarrow.parquet

    columns = pyarrow.parquet.read_schema(store.merge()).metadata[b"servodrome.columns"].decode()
    assert '"figure_sum": "figure of the program"' in columns and '"a": "parameter"' in columns


def test_the_step_of_the_library(tmp_path):
    path = written(tmp_path, 'line = "cell.toml"\n[parameters]\n"axis.x.load.inertia_kgm2" = [1e-5, 4e-4]\nstep_rev_s = 5\n')
    plan = campaign.load_plan(path)
    light, heavy = (campaign.execute(plan, number) for number in range(2))
    assert light["outcome"] == heavy["outcome"] == "passed", (light, heavy)
    assert abs(light["figure_error_rpm"]) < 5 and light["figure_settling_ms"] < 100
    assert heavy["figure_overshoot_percent"] > light["figure_overshoot_percent"]


def test_the_command_explains_wrong_use(tmp_path):
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "python")}
    command = [sys.executable, "-m", "servodrome", "campaign", "report", str(tmp_path)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True)
    assert done.returncode == 2 and "has no campaign.json" in done.stderr
    assert pathlib.Path(ROOT / "docs/campaign.md").exists()
