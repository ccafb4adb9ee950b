"""Writes the first inputs of a libFuzzer target: seeds.py TARGET FOLDER.

They are files of this repository and examples of its documentation, so that the inputs that libFuzzer makes of them get
further than the first word of a file. A target with several parsers takes the first byte of an input as the number of
its parser. Targets that are not in the table begin with nothing.
"""

import hashlib
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parents[1]
LONGEST = 1500  # bytes: long inputs take most of the time, and find little

WHOLE = r"\A.*\Z"
BODY = r"-d '(\{[^']*\})'"
PARAMETERS = b"# servodrome parameters 1\nproduct: generic402\n6083:00 u32 4711\n2011:01 u16 49\nend\n"
RECORDING = b'tick,time_s,"x current_a [A]","x 6064:00 Position actual value [pos]"\r\n16,0.001,1.5,7\r\n32,0.002,,8\r\n'
STREAM = b'{"subscribe":[{"axis":"x","signal":"position"}],"rate_hz":1}\nP {"channels":[{"axis":"y","object":"6064:00"}]}\n'

# Target, number of the parser, and files with the pattern of an example; or the text itself.
SEEDS = (
    ("files_fuzz", 0, "tests/data/described/*.xml", WHOLE),
    ("files_fuzz", 1, "tests/data/described/*.[ed][dc][sf]", WHOLE),
    ("files_fuzz", 3, "scenarios/*/*.toml", WHOLE),
    ("files_fuzz", 5, "lines/*.toml", WHOLE),
    ("files_fuzz", 6, PARAMETERS, WHOLE),
    ("files_fuzz", 9, RECORDING, WHOLE),
    ("api_fuzz", 0, "docs/bench-api.md", BODY),
    ("api_fuzz", 1, STREAM, WHOLE),
    ("api_fuzz", 4, "docs/bench-api.md", BODY),
)


def examples(source, pattern):
    texts = [source] if isinstance(source, bytes) else [path.read_bytes() for path in sorted(ROOT.glob(source))]
    for text in texts:
        for found in re.finditer(pattern.encode(), text, re.DOTALL):
            yield found.group(found.lastindex or 0)


def write(target, folder):
    """Returns the number of inputs."""
    folder = pathlib.Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    inputs = {
        bytes([number]) + text
        for name, number, source, pattern in SEEDS
        if name == target
        for text in examples(source, pattern)
        if len(text) <= LONGEST
    }
    for content in inputs:
        (folder / hashlib.sha1(content).hexdigest()).write_bytes(content)
    return len(inputs)


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    write(*sys.argv[1:])
