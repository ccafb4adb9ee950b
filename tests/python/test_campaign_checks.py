"""Campaigns: mistakes in plans are found before anything runs, and damaged or foreign folders of results are refused."""

import json
import os
import pathlib
import random
import re
import signal
import subprocess
import sys
import time

import pytest
import servodrome
from servodrome import campaign
from servodrome.campaign import distribute, report

pytest.importorskip("pyarrow")
distributed = pytest.importorskip("distributed")

LINE = '[[bus]]\nname = "can0"\n[[axis]]\nname = "x"\nproduct = "generic402"\nnode = 1\n'
PROGRAM = "def run(line, parameters, seed):\n    line.advance(0.01)\n    return {'a': seed}\n"
SCENARIO = 'title = "t"\n[[rule]]\ndo = "show"\nobject = "6041"\nvalue = 0\n'
PLAN = 'line = "cell.toml"\nprogram = "program.py:run"\nseeds = 3\n'


@pytest.fixture
def plan(tmp_path):
    """Writes the files of a plan, and returns its path."""

    def write(plan=PLAN, program=PROGRAM, line=LINE, scenario=SCENARIO, folder="plan"):
        (tmp_path / folder / "scenarios").mkdir(parents=True, exist_ok=True)
        for name, text in {"plan.toml": plan, "program.py": program, "cell.toml": line, "scenarios/s.toml": scenario}.items():
            (tmp_path / folder / name).write_bytes(text if isinstance(text, bytes) else text.encode())
        return str(tmp_path / folder / "plan.toml")

    return write


def command(*words, cwd=None):
    environment = {**os.environ, "PYTHONPATH": str(pathlib.Path(servodrome.__file__).parents[1])}
    return subprocess.run([sys.executable, "-m", "servodrome", "campaign", *words], env=environment, capture_output=True, text=True, timeout=120, cwd=cwd)


# ---- Plans ----

WITH_SCENARIO = PLAN + 'scenarios = ["scenarios/s.toml"]\n'
MISTAKES = [
    ({"plan": PLAN.replace("program.py", "nowhere.py")}, "plan.toml:2:1: the program .*nowhere.py:run cannot be loaded: FileNotFoundError"),
    ({"plan": PLAN.replace("program.py:run", "no_such_module:run")}, "plan.toml:2:1: .* cannot be loaded: ModuleNotFoundError"),
    ({"plan": PLAN.replace(":run", ":walk")}, "plan.toml:2:1: .*program.py has no function walk"),
    ({"program": "run = 5\n"}, "plan.toml:2:1: .*program.py has no function run"),
    ({"program": "\ndef run(:\n"}, "program.py:2:9: .* SyntaxError"),
    ({"program": "\n\nraise RuntimeError('at import')\n"}, "program.py:3: .* RuntimeError: at import"),
    ({"program": "import sys\nsys.exit(0)\n"}, "program.py:2: .* SystemExit: 0"),
    ({"plan": PLAN + '[parameters]\n"axis.x.lode.inertia" = 1\n'}, "plan.toml:5:2: axis.x.lode.inertia = 1: unknown key `lode`"),
    ({"plan": PLAN + '[parameters]\n"axis.x.node.z" = 1\n'}, "plan.toml:5:2: axis.x.node.z: node of the line file is no table"),
    ({"plan": PLAN + '[parameters]\n"axis.x.node" = [1, 200]\n'}, "plan.toml:5:2: axis.x.node = 200: .* out of range"),
    ({"line": LINE + "nod = 3\n"}, "cell.toml:7:1: .*unknown key `nod`"),
    ({"line": "[[axis]\n"}, "cell.toml:1:[78]: "),
    ({"plan": WITH_SCENARIO, "scenario": SCENARIO + "tims = 1\n"}, "s.toml:6:1: .*unknown key `tims`"),
    ({"plan": WITH_SCENARIO, "scenario": "seed = 4\n" + SCENARIO + 'axis = "nobody"\n'}, "s.toml"),
    ({"plan": WITH_SCENARIO, "scenario": b'title = "\xe9"\n'}, "s.toml: the file is not UTF-8: byte 9"),
    ({"plan": PLAN + f"first_seed = {2**63 - 2}\n"}, "plan.toml:4:1: first_seed: seeds from .* are not from 0 to"),
    ({"plan": PLAN + "first_seed = -1\n"}, "plan.toml:4:1: first_seed: "),
]


@pytest.mark.parametrize(("files", "error"), MISTAKES)
def test_plans_are_checked(plan, files, error):
    path = plan(**files)
    with pytest.raises(servodrome.Error, match=error):
        campaign.check_plan(path, campaign.load_plan(path))


def test_the_greatest_seed_is_possible(plan):
    path = plan(PLAN + f"first_seed = {2**63 - 3}\n" + 'scenarios = ["scenarios"]\n')
    loaded = campaign.load_plan(path)
    campaign.check_plan(path, loaded)
    assert campaign.execute(loaded, 2)["seed"] == 2**63 - 1 and campaign.execute(loaded, 2)["outcome"] != "error"


def test_the_command_checks_before_it_makes_anything(plan, tmp_path):
    out = ["--out", str(tmp_path / "out")]
    for program, options, error in (
        ("def run(:\n", out, "SyntaxError"),
        (PROGRAM, [*out, "--workers", "-1"], "argument --workers: -1 is not a number of at least 0"),
        (PROGRAM, ["--out", __file__], "cannot be made"),
    ):
        done = command("run", plan(program=program), *options)
        assert done.returncode == 2 and error in done.stderr and "Traceback" not in done.stderr, done.stderr
        assert not (tmp_path / "out").exists()


def test_a_folder_of_scenarios_is_all_of_its_files(plan, tmp_path):
    path = plan(PLAN + 'scenarios = ["scenarios"]\n')
    (tmp_path / "plan/scenarios/lines").mkdir()
    (tmp_path / "plan/scenarios/lines/cell.toml").write_text(LINE)
    (tmp_path / "plan/scenarios/deep").mkdir()
    (tmp_path / "plan/scenarios/deep/s2.toml").write_text(SCENARIO)
    assert [os.path.basename(name) for name in campaign.load_plan(path).scenarios] == ["s2.toml", "s.toml"]
    with pytest.raises(servodrome.BadValue, match="plan.toml:4:1: scenarios: there is no file scenarios/lines"):
        campaign.load_plan(plan(PLAN + 'scenarios = ["scenarios/lines"]\n'))


def test_the_seed_of_the_run_replaces_that_of_any_scenario(plan):
    """Also if a text of several lines looks like a seed."""
    scenario = 'title = "t"\n"seed" = 5\nclause = """\nseed = 6\n"""\n' + SCENARIO.partition("\n")[2]
    loaded = campaign.load_plan(plan(WITH_SCENARIO, scenario=scenario))
    row = campaign.execute(loaded, 0)
    assert row["outcome"] != "error" and row["acts"] == 1, row


# ---- Rows depend only on the plan ----


def test_the_generators_of_the_process_have_the_seed_of_the_run(plan):
    numpy = pytest.importorskip("numpy")
    program = "import random, numpy\ndef run(line, parameters, seed):\n    return {'a': random.random(), 'b': numpy.random.random()}\n"
    loaded = campaign.load_plan(plan(program=program))
    rows = [campaign.execute(loaded, number) for number in (0, 1, 0)]
    assert rows[0] == rows[2] != rows[1]
    generator = random.Random(2)
    assert rows[1]["figure_a"] == generator.random() and rows[1]["figure_b"] == numpy.random.RandomState(2).random_sample()


# ---- Folders of results ----


@pytest.fixture
def results(plan, tmp_path):
    """A folder with three files of one run each, and its plan."""
    loaded = campaign.load_plan(plan())
    store = campaign.Store(str(tmp_path / "out"), loaded)
    distribute.run_here(loaded, store, batch=1)
    return tmp_path / "out", loaded


@pytest.mark.parametrize("size", [0, 100, -1])
def test_a_damaged_file_is_set_aside(results, capsys, size):
    folder, loaded = results
    expected = campaign.Store(str(folder)).table()
    file = sorted((folder / "parts").iterdir())[1]
    content = file.read_bytes()
    file.write_bytes(content[:size])
    with pytest.raises(servodrome.BadValue, match=f"{file}: the file is damaged: .*; the same `campaign run` computes"):
        report.text_of(campaign.Store(str(folder)))
    store = campaign.Store(str(folder), loaded)
    distribute.run_here(loaded, store)
    assert store.table().equals(expected)
    assert pathlib.Path(f"{file}.damaged").exists() and f"it is {file}.damaged now, and its runs run again" in capsys.readouterr().err


def test_a_damaged_description_is_explained(results):
    folder, loaded = results
    about = folder / "campaign.json"
    whole = about.read_text()
    for text in ("", "{}", "[]", "5", whole[:100]):
        about.write_text(text)
        for arguments in ((), (loaded,)):
            with pytest.raises(servodrome.BadValue, match="campaign.json: the file is damaged: .* is missing; delete it"):
                campaign.Store(str(folder), *arguments)
    about.unlink()
    assert len(campaign.Store(str(folder), loaded).done()) == 3 and about.read_text() == whole
    for file in (folder / "parts").iterdir():
        file.unlink()
    (folder / "parts").rmdir()
    with pytest.raises(servodrome.BadValue, match="parts: the folder of the results cannot be read"):
        report.text_of(campaign.Store(str(folder)))


def test_results_of_another_version_are_refused(results):
    folder, loaded = results
    with pytest.raises(servodrome.BadValue, match=f"results of Servodrome {re.escape(loaded.version)}, and this is 9.9.9; go on with that version"):
        campaign.Store(str(folder), loaded._replace(version="9.9.9"))
    with pytest.raises(servodrome.BadValue, match="this worker has Servodrome .*, and the command has 9.9.9"):
        distribute.execute_batch(loaded._replace(version="9.9.9"), [0])


def test_the_difference_to_another_plan_is_named(results, plan):
    folder, _ = results
    for files, keys in (
        ({"plan": PLAN.replace("3", "4") + "[parameters]\na = 1\n"}, "seeds, parameters"),
        ({"line": LINE + "\n", "program": PROGRAM + "#\n"}, "program"),
        ({"line": LINE.replace("1", "2")}, "line"),
        ({"plan": WITH_SCENARIO}, "scenarios"),
    ):
        with pytest.raises(servodrome.BadValue, match=f"results of another plan: {keys} changed"):
            campaign.Store(str(folder), campaign.load_plan(plan(**files)))


def test_the_title_and_the_folder_make_no_other_plan(results, plan):
    folder, _ = results
    moved = campaign.load_plan(plan('title = "new"\n' + PLAN, folder="moved"))
    assert campaign.Store(str(folder), moved).done() == {0, 1, 2}
    assert json.loads((folder / "campaign.json").read_text())["title"] == "new"


def test_a_page_that_cannot_be_written_is_wrong_use(results):
    folder, _ = results
    done = command("report", str(folder), "--html", str(folder / "nowhere" / "page.html"))
    assert done.returncode == 2 and "--html: there is no folder" in done.stderr and done.stdout == ""


# ---- Ctrl-C ----


@pytest.mark.parametrize("workers", ["0", "1"])
def test_an_interrupted_command_says_so_in_a_line(plan, tmp_path, workers):
    program = f"import time\ndef run(line, parameters, seed):\n    open({str(tmp_path / 'begun')!r}, 'w')\n    time.sleep(0.2)\n    return {{}}\n"
    environment = {**os.environ, "PYTHONPATH": str(pathlib.Path(servodrome.__file__).parents[1])}
    words = [sys.executable, "-m", "servodrome", "campaign", "run", plan(PLAN.replace("3", "1000"), program), "--out", str(tmp_path / "out")]
    # Ctrl-C goes to the whole group of a terminal.
    process = subprocess.Popen(
        [*words, "--workers", workers, "--quiet"], env=environment, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    while not (tmp_path / "begun").exists():
        assert process.poll() is None
        time.sleep(0.01)
    os.killpg(process.pid, signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 130
    assert errors.strip() == "servodrome: interrupted; the same command goes on with the missing runs"
