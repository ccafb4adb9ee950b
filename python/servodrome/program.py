"""The program `servodrome` as a child process."""

from __future__ import annotations

import json
import os
import pathlib
import shutil
import signal
import subprocess
import sysconfig
import time
import weakref
from typing import Any, Dict, List, Optional, Sequence, Tuple, Union

from .errors import ProgramError

_READY_DEADLINE_S = 60.0  # for what never happens
_END_DEADLINE_S = 20.0
_POLL_S = 0.005

# Waits for the end of its standard input, which is the end of this process; then ends the program and deletes its folder.
# It does not use prctl(PR_SET_PDEATHSIG): that signal comes at the end of the thread that started the program.
_WATCHER = 'read -r ignored; kill -TERM "$1" 2>/dev/null; rm -rf -- "$2"'


def program_path(program: Optional["Union[str, os.PathLike[str]]"]) -> str:
    """The program: `program`, $SERVODROME, `servodrome` among the scripts of this Python environment, or in PATH.

    Raises ProgramError.
    """
    name = program if program is not None else os.environ.get("SERVODROME")
    if name is None:
        own = pathlib.Path(sysconfig.get_path("scripts")) / "servodrome"  # the environment may not be activated
        name = str(own) if own.exists() else shutil.which("servodrome")
    if name is None:
        hint = "give program=PATH, set SERVODROME, or put it into PATH"
        raise ProgramError("the program servodrome is not installed", "PATH", hint)
    found = shutil.which(os.fspath(name))
    if found is None:
        raise ProgramError("there is no program of this name", os.fspath(name), "give program=PATH, or set SERVODROME")
    return found


class Program:
    """`servodrome up`, until end(), the end of this process, or the collection of this object."""

    ready: Dict[str, Any]
    """What it wrote into its ready file."""

    def __init__(self, program: str, arguments: Sequence[str], folder: str) -> None:
        """`folder` is for its files, and is deleted at the end. Raises ProgramError if it does not become ready."""
        self._output = os.path.join(folder, "output")
        ready_file = os.path.join(folder, "ready.json")
        command = [program, "up", *arguments, "--api", "127.0.0.1:0", "--ready-file", ready_file, "--json"]
        children: List["subprocess.Popen[bytes]"] = []
        self._children = children
        self._end: Optional[Tuple[str, str]] = None  # of a program that has ended by itself: what, and what it printed
        self._finalizer = weakref.finalize(self, _end, children, folder, os.getpid())
        try:
            children.append(_start(command, self._output))
            children.append(_watch(children[0].pid, folder))
            self.ready = self._wait_until_ready(ready_file)
        except BaseException:
            self._finalizer()
            raise

    def _wait_until_ready(self, ready_file: str) -> Dict[str, Any]:
        end = time.monotonic() + _READY_DEADLINE_S
        while True:
            try:
                with open(ready_file, encoding="utf-8") as file:  # the program renames the complete file
                    ready: Dict[str, Any] = json.load(file)
                    return ready
            except FileNotFoundError:
                pass
            self.check()
            if time.monotonic() > end:
                raise ProgramError(f"servodrome is not ready after {_READY_DEADLINE_S:g} s", "program", self.said())
            time.sleep(_POLL_S)

    def said(self) -> str:
        """What it wrote to standard output and error."""
        with open(self._output, encoding="utf-8", errors="replace") as file:
            return file.read().strip()

    def check(self) -> None:
        """Raises ProgramError if it has ended."""
        status = self._children[0].poll() if self._children else None
        if status is not None:
            self._end = f"servodrome has ended with {status}", self.said() or "it printed nothing"
            self._finalizer()
        if self._end is not None:
            raise ProgramError(self._end[0], "program", self._end[1])

    def end(self) -> None:
        """Ends it, as Ctrl-C does; once more does nothing."""
        self._finalizer()

    def forget(self) -> None:
        """In a forked child: the program and its folder are the parent's, and stay."""
        self._finalizer.detach()
        for child in self._children:
            child.returncode = 0  # subprocess must not wait for a process that is not a child of this one
            if child.stdin is not None:
                child.stdin.close()  # otherwise the program would live as long as this process
        self._children.clear()


def _start(command: List[str], output: str) -> "subprocess.Popen[bytes]":
    try:
        with open(output, "wb") as file:
            # In a session of its own: Ctrl-C of the terminal is for the Python program, which ends the line as it ends.
            return subprocess.Popen(
                command, stdin=subprocess.DEVNULL, stdout=file, stderr=subprocess.STDOUT, start_new_session=True
            )
    except OSError as error:
        raise ProgramError(f"cannot be started: {error.strerror}", command[0], "give the program servodrome") from error


def _watch(pid: int, folder: str) -> "subprocess.Popen[bytes]":
    return subprocess.Popen(
        ["/bin/sh", "-c", _WATCHER, "servodrome-watcher", str(pid), folder],
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )


def _end(children: List["subprocess.Popen[bytes]"], folder: str, owner: int) -> None:
    """Ends the watcher first, so that it never sends a signal to another process that has got the number."""
    if os.getpid() != owner:
        return
    for watcher in children[1:]:
        watcher.kill()
        watcher.wait()
        if watcher.stdin is not None:
            watcher.stdin.close()
    for process in children[:1]:
        if process.poll() is None:
            process.send_signal(signal.SIGTERM)
        try:
            process.wait(_END_DEADLINE_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
    children.clear()
    shutil.rmtree(folder, ignore_errors=True)
