"""States and modes of a drive."""

from __future__ import annotations

import enum
from typing import Union


class _Number(enum.IntEnum):
    """A number that prints as its name, in every version of Python."""

    def __str__(self) -> str:
        return self.name

    def __format__(self, spec: str) -> str:
        return format(int(self), spec) if spec else self.name


class PowerState(_Number):
    """CiA 402 power states. The numbers are those of the signal "state"."""

    NO_POWER = -1
    """The drive is switched off; not a state of CiA 402."""
    NOT_READY_TO_SWITCH_ON = 0
    SWITCH_ON_DISABLED = 1
    READY_TO_SWITCH_ON = 2
    SWITCHED_ON = 3
    OPERATION_ENABLED = 4
    QUICK_STOP_ACTIVE = 5
    FAULT_REACTION_ACTIVE = 6
    FAULT = 7

    @property
    def text(self) -> str:
        """The state in the words of the bench API: "operation enabled"."""
        return self.name.lower().replace("_", " ")


class Mode(_Number):
    """Modes of operation (6060h, 6061h). A maker's mode that is not in this list is a plain int."""

    PULSE = -4
    IMMEDIATE_VELOCITY = -3
    NONE = 0
    PROFILE_POSITION = 1
    VELOCITY = 2
    PROFILE_VELOCITY = 3
    PROFILE_TORQUE = 4
    HOMING = 6
    INTERPOLATED_POSITION = 7
    CYCLIC_SYNC_POSITION = 8
    CYCLIC_SYNC_VELOCITY = 9
    CYCLIC_SYNC_TORQUE = 10


def mode_of(number: int) -> Union[Mode, int]:
    """The mode with this number, or the number if there is no name for it."""
    try:
        return Mode(number)
    except ValueError:
        return number


class NmtState(_Number):
    """NMT states of a node on CAN, with the numbers of its heartbeat (CiA 301 7.2.8.3.2.2)."""

    INITIALISING = 0
    STOPPED = 4
    OPERATIONAL = 5
    PRE_OPERATIONAL = 127


class AlState(_Number):
    """States of a slave on EtherCAT, with the numbers of its AL status (ETG.1000.6)."""

    INIT = 1
    PRE_OPERATIONAL = 2
    BOOTSTRAP = 3
    SAFE_OPERATIONAL = 4
    OPERATIONAL = 8


def power_state_of(text: str) -> PowerState:
    """The state with this text of the bench API."""
    return PowerState[text.upper().replace(" ", "_")]


def nmt_state_of(text: str) -> NmtState:
    """The state with this text of the bench API."""
    return NmtState[text.upper()]


def al_state_of(text: str) -> AlState:
    """The state with this text of the bench API."""
    return AlState[text.upper().replace("-", "_")]
