import pytest
import servodrome.can_bus  # noqa: F401  python-can gets the interface "servodrome"
from machine import Gantry
from servodrome.virtual_time import virtual_time


@pytest.fixture
def left(servodrome_line):
    return servodrome_line.axes["left"]


@pytest.fixture
def right(servodrome_line):
    return servodrome_line.axes["right"]


@pytest.fixture
def gantry(servodrome_line, left):
    """The machine's own program, in virtual time of the line."""
    left.inputs["DI3"] = True  # the door is closed
    with virtual_time(servodrome_line):
        servodrome_line.advance(1)  # the drives boot
        machine = Gantry("servodrome", "can0")
        yield machine
        machine.close()


@pytest.fixture
def ready(gantry):
    """The machine after homing."""
    gantry.start()
    gantry.home()
    return gantry
