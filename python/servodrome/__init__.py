"""Software servo drives on real field buses, in Python.

    import servodrome

    with servodrome.Line() as line:                 # the built-in line, in virtual time
        x = line.axes["reference"]
        x.enable()
        x.move(by=3, velocity=5, units="revolutions")
        print(line.now, x.position, x.state)

Units are in the names, or in the docstrings; times are seconds. Every exception derives from `Error`.
"""

from __future__ import annotations

from ._library import version as library_version
from .axis import LiveAxis
from .bench import Fault, Injectable, Inputs, Lamp, Plant
from .bus import Disturbance, Frame, LiveBus, Traffic, TrafficRecording
from .errors import (
    BadValue,
    Closed,
    Diagnostic,
    Error,
    Forked,
    JobFailed,
    JobTimeout,
    LibraryError,
    LineFileError,
    MissingPackage,
    NotInRealTime,
    NotInVirtualTime,
    ObjectError,
    ProgramError,
    Refused,
    Timeout,
    UnknownName,
    UnknownObject,
    WrongType,
)
from .ethercat import EthercatPort
from .jobs import Job, JobResult, JobState
from .line import Line
from .objects import ObjectInfo, ObjectKey, Objects, ObjectValue
from .recording import Recording
from .scenario import Outcome, RuleState, Scenario, Verdict
from .signals import Signal
from .states import AlState, Mode, NmtState, PowerState
from .tables import Axis, Bus
from .virtual_time import VirtualDeadlock, VirtualTimeEnded, real_time, virtual_time

__all__ = [
    "AlState",
    "Axis",
    "BadValue",
    "Bus",
    "Closed",
    "Diagnostic",
    "Disturbance",
    "Error",
    "EthercatPort",
    "Fault",
    "Forked",
    "Frame",
    "Injectable",
    "Inputs",
    "Job",
    "JobFailed",
    "JobResult",
    "JobState",
    "JobTimeout",
    "Lamp",
    "LibraryError",
    "Line",
    "LineFileError",
    "LiveAxis",
    "LiveBus",
    "MissingPackage",
    "Mode",
    "NmtState",
    "NotInRealTime",
    "NotInVirtualTime",
    "ObjectError",
    "ObjectInfo",
    "ObjectKey",
    "ObjectValue",
    "Objects",
    "Outcome",
    "Plant",
    "PowerState",
    "ProgramError",
    "Recording",
    "Refused",
    "RuleState",
    "Scenario",
    "Signal",
    "Timeout",
    "Traffic",
    "TrafficRecording",
    "UnknownName",
    "UnknownObject",
    "Verdict",
    "VirtualDeadlock",
    "VirtualTimeEnded",
    "WrongType",
    "library_version",
    "real_time",
    "virtual_time",
]
