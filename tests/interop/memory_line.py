"""A line in this process, in virtual time, with the interface that the tests use of a line in a separate process."""

import json
import os
import pathlib
import sys

from line import ApiError, Bench

PYTHON = pathlib.Path(__file__).parents[2] / "python"
sys.path.append(str(PYTHON))
if not (PYTHON / "servodrome/_lib").exists():
    built = pathlib.Path(__file__).parents[2] / "build/release/src/capi/libservodrome.so"
    os.environ.setdefault("SERVODROME_LIBRARY", str(built))

import servodrome  # noqa: E402
import servodrome.can_bus  # noqa: E402, F401
from servodrome.virtual_time import virtual_time  # noqa: E402


class MemoryBench(Bench):
    """The bench API without HTTP."""

    def __init__(self, line):
        super().__init__("memory:")
        self.backend = line._backend

    def call(self, method, path, body=None):
        data = b"" if body is None else json.dumps(body).encode()
        answer = self.backend.request(method, f"/api/v1/{path}", data)
        content = json.loads(answer.body) if answer.body else None
        if answer.status >= 400:
            raise ApiError(answer.status, content)
        return content


class MemoryLine:
    """Puts the calling thread, and threads that it starts, into the line's virtual time until stop()."""

    def __init__(self, folder, text, log=None):
        self.folder = folder
        self.line = servodrome.Line.from_text(text, name=str(folder / "line.toml"))
        self.bench = MemoryBench(self.line)
        self.links = {name: [f"memory:{name}"] for name, bus in self.line.buses.items() if bus.type == "can"}
        self.log = log
        if log:
            for name in self.links:
                self.line.buses[name].record()
        self.line.advance(1.0)  # the drives boot first, as they have done before a master connects to the program
        self.time = virtual_time(self.line)
        self.time.__enter__()

    def stop(self):
        self.time.__exit__(None, None, None)
        if self.log:
            file = pathlib.Path(self.log)
            for name in self.links:
                file.with_suffix(f".{name}.pcap").write_bytes(self.line.buses[name].capture())
        self.line.close()
