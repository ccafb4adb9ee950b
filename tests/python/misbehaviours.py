"""What the tests of misbehaviours share: a case, and its run on a line in virtual time.

Each case has rules of a scenario and a look of another project's client at the line. A client that looks at a line with these rules sees
`seen`; without them it sees something else. test_misbehaviours.py compares the rules of all cases with the schema of scenario files.
"""

from typing import Any, Callable, NamedTuple

import servodrome
from servodrome.virtual_time import virtual_time


class Case(NamedTuple):
    """One misbehaviour and what a client sees of it."""

    rules: str
    """The keys of a rule in TOML; further rules begin with [[rule]]."""
    look: Callable[[Any], Any]
    seen: Any


def text_of(rules: str) -> str:
    """A scenario with these rules."""
    return f'title = "t"\n[[rule]]\n{rules}\n' if rules else 'title = "t"\n'


def observed(line_file, connect, rules, look):
    """What the client of connect(line) sees under the rules, which have all acted."""
    with servodrome.Line.from_file(line_file) as line, virtual_time(line), line.scenario(text=text_of(rules)) as scenario:
        with connect(line) as client:
            seen = look(client)
        states = scenario.rules.values()
        assert all(rule.acts for rule in states) and not any(rule.error for rule in states), states
        return seen


def check(line_file, connect, case):
    """The client sees the misbehaviour, and does not see it on a line without the rules."""
    assert observed(line_file, connect, case.rules, case.look) == case.seen
    assert observed(line_file, connect, "", case.look) != case.seen
