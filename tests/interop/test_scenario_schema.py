"""`trial --schema`: editors complete and check scenario files with the keys that the parser accepts."""

import json
import os
import pathlib
import subprocess
import tomllib

import jsonschema
import pytest

ROOT = pathlib.Path(__file__).parents[2]
PROGRAM = os.environ["SERVODROME"]

pytestmark = pytest.mark.once

RULE = {"on": {"message": "sdo_answer"}, "do": "delay", "ms": 5}


@pytest.fixture(scope="module")
def validator():
    schema = json.loads(subprocess.run([PROGRAM, "trial", "--schema"], capture_output=True, text=True, check=True).stdout)
    jsonschema.Draft7Validator.check_schema(schema)
    return jsonschema.Draft7Validator(schema)


def test_every_scenario_of_the_library_is_valid(validator):
    files = [file for file in (ROOT / "scenarios").rglob("*.toml") if file.parent.name != "lines"]
    assert len(files) >= 317
    for file in files:
        errors = [error.message for error in validator.iter_errors(tomllib.loads(file.read_text()))]
        assert not errors, f"{file}: {errors[:3]}"


@pytest.mark.parametrize(
    "change",
    [
        {"titel": "x"},
        {"seed": "one"},
        {"master": "maybe"},
        {"rule": [{**RULE, "do": "dealy"}]},
        {"rule": [{**RULE, "frequency": 3}]},
        {"rule": [{**RULE, "wire": "DI0"}]},  # a key of another action
        {"rule": [{**RULE, "times": 0}]},
        {"rule": [{**RULE, "on": {"message": "sdo_anwser"}}]},
        {"rule": [{**RULE, "when": {"state": "enabled"}}]},
        {"rule": [{"ms": 5}]},
        {"expect": [{"always": {"at_rest": "yes"}}]},
        {"waive": {"end": "x"}},
    ],
)
def test_mistakes_are_found(validator, change):
    assert validator.is_valid({"title": "t", "rule": [RULE]})
    assert not validator.is_valid({"title": "t", "rule": [RULE], **change})


def test_completion_offers_the_keys_and_words_of_the_parser(validator):
    rule = validator.schema["definitions"]["rule"]["properties"]
    assert {"withhold", "delay", "show", "al_refuse"} <= set(rule["do"]["enum"])
    assert {"when", "until", "on", "times", "object", "jitter_ms", "late_us"} <= set(rule)
    condition = validator.schema["definitions"]["condition"]["properties"]
    assert "operation_enabled" in condition["state"]["enum"] and "set_point_jumped" in condition
    assert set(validator.schema["definitions"]["waive"]["properties"]) == {"rests", "ends", "fault_resets", "set_point", "repeats"}
