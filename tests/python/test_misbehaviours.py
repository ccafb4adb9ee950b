"""Each misbehaviour has a case in which a third-party program observes it.

The list of misbehaviours comes from the schema of scenario files, which the parser generates; the tested ones come from
the rules of the cases. A new action, a new key of an action, a new word of such a key or a new kind of message fails
here until a client observes it.
"""

import json
import subprocess
import tomllib

import pytest
import test_misbehaviours_can as can
import test_misbehaviours_ethercat as ethercat
import test_misbehaviours_serial as serial

TABLES = (can.CASES, ethercat.CASES, serial.RTU, serial.RTU_CHARACTERS, serial.SERIAL10, serial.TCP)


@pytest.fixture(scope="module")
def definitions(program):
    text = subprocess.run([program, "trial", "--schema"], capture_output=True, text=True, check=True).stdout
    return json.loads(text)["definitions"]


@pytest.fixture(scope="module")
def rules():
    """The rules of all cases, as tables."""
    texts = [case.rules for table in TABLES for case in table.values()]
    return [rule for text in texts for rule in tomllib.loads(f"[[rule]]\n{text}")["rule"]]


def words(types):
    """Returns the words that a key may have."""
    return {word for one in types.get("anyOf", [types]) for word in one.get("enum", [])}


def test_each_action_key_and_word_is_seen(definitions, rules):
    actions = {one["if"]["properties"]["do"]["const"]: one["then"]["properties"] for one in definitions["rule"]["allOf"]}
    assert len(actions) >= 35
    wanted = {(action, key) for action, keys in actions.items() for key in keys if not is_of_all(key, actions)}
    wanted |= {(action, "do") for action in actions}
    wanted |= {
        (action, key, word)
        for action, keys in actions.items()
        for key, types in keys.items()
        if not is_of_all(key, actions)
        for word in words(types)
    }
    seen = {(rule["do"], key) for rule in rules for key in rule}
    seen |= {(rule["do"], key, word) for rule in rules for key, word in rule.items() if isinstance(word, str)}
    assert sorted(wanted - seen) == []


def test_each_key_of_all_rules_is_seen(definitions, rules):
    actions = [one["then"]["properties"] for one in definitions["rule"]["allOf"]]
    common = set.intersection(*(set(keys) for keys in actions))
    assert sorted(common - {key for rule in rules for key in rule}) == []


def test_each_kind_of_message_is_seen(definitions, rules):
    kinds = set(definitions["message"]["properties"]["message"]["enum"])
    assert sorted(kinds - {rule["on"]["message"] for rule in rules if isinstance(rule.get("on"), dict)}) == []


def is_of_all(key, actions):
    return all(key in keys for keys in actions.values())
