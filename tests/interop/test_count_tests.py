"""The report of ./test about second tries: runs tools/count-tests with two artificial reports."""

import pathlib
import subprocess

import pytest

pytestmark = pytest.mark.once
TOOL = pathlib.Path(__file__).resolve().parents[2] / "tools" / "count-tests"


def pause(ms):
    return f'<properties><property name="longest_pause_ms" value="{ms}"/></properties>'


FIRST = f"""<testsuites>
<testsuite name="a" tests="4" failures="2" skipped="1">
<testcase classname="Folder" name="steady"/>
<testcase classname="Folder" name="flickers"><failure message="x"/></testcase>
<testcase classname="Folder" name="is broken"><failure message="x"/></testcase>
<testcase classname="left_out" name="left_out"><skipped/></testcase>
</testsuite>
<testsuite name="b" tests="3" failures="2" errors="1">
<testcase name="stood"><failure message="x"/>{pause(20)}{pause(50)}</testcase>
<testcase name="hardly stood"><failure message="x"/>{pause(49)}</testcase>
<testcase name="in error"><error message="x"/></testcase>
</testsuite>
</testsuites>"""

AGAIN = f"""<testsuites><testsuite name="again" tests="6" failures="1">
<testcase classname="Folder" name="flickers">{pause(900)}</testcase>
<testcase classname="Folder" name="is broken"><failure message="x"/></testcase>
<testcase classname="left_out" name="left_out"/>
<testcase name="stood"/>
<testcase name="hardly stood"/>
<testcase name="in error"/>
<testcase name="of another step"/>
</testsuite></testsuites>"""


def count_tests(*arguments):
    return subprocess.run([TOOL, *arguments], capture_output=True, text=True)


def reports(folder):
    (folder / "first.xml").write_text(FIRST)
    (folder / "again.xml").write_text(AGAIN)
    return folder / "first.xml", folder / "again.xml"


def test_names_what_passed_at_the_second_try(tmp_path):
    """Lists tests that failed first and then passed, with the pause of the first run if it was long."""
    answer = count_tests("--second-try", *reports(tmp_path))
    assert answer.returncode == 0
    assert answer.stdout.splitlines() == [
        "Folder flickers",
        "hardly stood",
        "in error",
        "left_out",
        "stood\t50",
    ]


def test_counts_what_was_skipped_as_failed(tmp_path):
    first, again = reports(tmp_path)
    assert count_tests(first).stdout == "7 6\n"
    assert count_tests(again).stdout == "6 1\n"


def test_says_how_it_is_called(tmp_path):
    first, _ = reports(tmp_path)
    for wrong in ([], ["--second-try", first], [first, first], ["--unknown"]):
        answer = count_tests(*wrong)
        assert answer.returncode == 2 and "count-tests REPORT.xml" in answer.stderr, wrong
