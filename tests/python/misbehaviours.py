"""Common parts of the tests of misbehaviours: a case, and its run on a line in virtual time.

Each case has rules of a scenario, and a function that looks at the line with a third-party client. With the rules the
client observes `seen`; without them it observes something else. test_misbehaviours.py compares the rules of all cases
with the schema of scenario files.
"""

from typing import Any, Callable, NamedTuple

import servodrome
from servodrome.virtual_time import virtual_time


class Case(NamedTuple):
    """One misbehaviour and the client's observation of it."""

    rules: str
    """The keys of a rule in TOML; further rules begin with [[rule]]."""
    look: Callable[[Any], Any]
    seen: Any


def text_of(rules: str) -> str:
    """A scenario with these rules."""
    return f'title = "t"\n[[rule]]\n{rules}\n' if rules else 'title = "t"\n'


def observed(line_file, connect, rules, look):
    """Returns what the client of connect(line) observes under the rules, all of which have acted."""
    with servodrome.Line.from_file(line_file) as line, virtual_time(line), line.scenario(text=text_of(rules)) as scenario:
        with connect(line) as client:
            seen = look(client)
        states = scenario.rules.values()
        assert all(rule.acts for rule in states) and not any(rule.error for rule in states), states
        return seen


def check(line_file, connect, case):
    """The client observes the misbehaviour, and does not observe it on a line without the rules."""
    assert observed(line_file, connect, case.rules, case.look) == case.seen
    assert observed(line_file, connect, "", case.look) != case.seen
