"""A small machine program on the library `canopen`: one axis moves three revolutions and back, several times.

    servodrome trial --scenarios scenarios/canopen -- python3 examples/masters/canopen_master.py {host} {port}

A user of the library writes such a program. Exit status 0: the drive has reported all motions as done. A third argument multiplies
its time-outs, for a busy computer.
"""

import sys
import time

import canopen
from canopen.nmt import NmtError
from canopen.sdo.exceptions import SdoError

NODE = 1
VENDOR, PRODUCT = 0x53455256, 0x34303252
BOOT_TIME = 10  # seconds in which the drive must answer
REVOLUTION = 131072  # counts
MOVES = 4
DISTANCE = 3 * REVOLUTION
VELOCITY = 10 * REVOLUTION  # counts/s
ACCELERATION = 100 * REVOLUTION
PATIENCE = float(sys.argv[3]) if len(sys.argv) > 3 else 1.0  # factor of all time-outs


class MachineError(Exception):
    """The program cannot continue."""


class Axis:
    """A CiA 402 drive over SDO; monitors its heartbeat and its emergencies."""

    def __init__(self, node):
        self.node = node
        self.emergency = None
        self.heard_at = time.monotonic()
        node.emcy.add_callback(self._emergency)
        node.nmt.add_heartbeat_callback(self._heartbeat)
        self.nmt_state = None

    def _emergency(self, error):
        if error.code != 0:
            self.emergency = error

    def _heartbeat(self, state):
        self.heard_at = time.monotonic()
        self.nmt_state = state

    def check(self):
        if self.emergency is not None:
            raise MachineError(f"the drive reports emergency {self.emergency.code:04X}h")
        if time.monotonic() - self.heard_at > 0.5 * PATIENCE:
            raise MachineError("the heartbeat is missing")
        if self.nmt_state == 0:
            raise MachineError("the drive has restarted")

    def write(self, index, value, size, sub=0, signed=False):
        self.node.sdo.download(index, sub, value.to_bytes(size, "little", signed=signed))

    def read(self, index, sub=0, signed=False):
        return int.from_bytes(self.node.sdo.upload(index, sub), "little", signed=signed)

    def statusword(self):
        return self.read(0x6041)

    def wait(self, what, mask, value, timeout):
        end = time.monotonic() + timeout * PATIENCE
        while True:
            self.check()
            status = self.statusword()
            if status & 0x4F == 0x08:
                raise MachineError(f"fault {self.read(0x603F):04X}h while waiting for {what}")
            if status & mask == value:
                return
            if time.monotonic() > end:
                raise MachineError(f"{what} does not come: statusword {status:04X}h")
            time.sleep(0.01)

    def enable(self):
        if self.statusword() & 0x4F == 0x08:
            self.write(0x6040, 0x80, 2)
            self.write(0x6040, 0x00, 2)
        for word, mask, value, name in (
            (0x06, 0x6F, 0x21, "ready to switch on"),
            (0x07, 0x6F, 0x23, "switched on"),
            (0x0F, 0x6F, 0x27, "operation enabled"),
        ):
            self.write(0x6040, word, 2)
            self.wait(name, mask, value, 2)

    def move_by(self, distance):
        begin = self.read(0x6064, signed=True)
        self.write(0x607A, distance, 4, signed=True)
        self.write(0x6040, 0x5F, 2)
        self.wait("the set-point acknowledge", 0x1000, 0x1000, 1)
        self.write(0x6040, 0x4F, 2)
        self.wait("target reached", 0x0400, 0x0400, 5)
        end = self.read(0x6064, signed=True)
        if abs(end - begin - distance) > REVOLUTION // 100:
            raise MachineError(f"the axis is {end - begin - distance} counts beside its target")

    def disable(self):
        self.write(0x6040, 0x00, 2)


def await_boot(axis):
    end = time.monotonic() + BOOT_TIME
    while True:
        try:
            return axis.read(0x1000)
        except SdoError:
            if time.monotonic() > end:
                raise MachineError("the drive does not answer") from None
            time.sleep(0.2)


def run(network):
    node = network.add_node(NODE, canopen.ObjectDictionary())
    node.sdo.RESPONSE_TIMEOUT = 0.3 * PATIENCE
    axis = Axis(node)
    await_boot(axis)
    identity = axis.read(0x1018, 1), axis.read(0x1018, 2)
    if identity != (VENDOR, PRODUCT):
        raise MachineError("another device: vendor {:08X}h, product {:08X}h".format(*identity))
    print("device", node.sdo.upload(0x1008, 0).decode(errors="replace"))
    with node.sdo.open(0x1021, 0, "rb", block_transfer=True) as sheet:
        if b"[FileInfo]" not in sheet.read():
            raise MachineError("the drive's data sheet is damaged")
    axis.write(0x1017, 100, 2)
    axis.heard_at = time.monotonic()
    node.nmt.state = "OPERATIONAL"
    node.nmt.wait_for_heartbeat(PATIENCE)
    axis.write(0x6060, 1, 1)
    if axis.read(0x6061) != 1:
        raise MachineError("the mode of operation is not taken over")
    axis.write(0x6081, VELOCITY, 4)
    axis.write(0x6083, ACCELERATION, 4)
    axis.write(0x6084, ACCELERATION, 4)
    try:
        axis.enable()
        for move in range(MOVES):
            axis.move_by(DISTANCE if move % 2 == 0 else -DISTANCE)
            time.sleep(0.3)
    finally:
        axis.disable()


def main():
    network = canopen.Network()
    network.connect(interface="socketcand", host=sys.argv[1], port=int(sys.argv[2]), channel="can0")
    try:
        run(network)
    except (MachineError, SdoError, NmtError) as error:
        print(f"failed: {error}")
        return 1
    finally:
        network.disconnect()
    print("done")
    return 0


if __name__ == "__main__":
    sys.exit(main())
