"""A CiA 402 drive of another make: a simple power state machine and shaft on two third-party CANopen stacks.

It has only the features that CiA 301 and 402 guarantee to a master, to check that our commands need no more. One
position unit is a thousandth of a revolution; the drive has no ramps.
"""

import time

import canopen
import durand
from canopen.objectdictionary import ODArray, ODRecord, ODVariable, datatypes
from canopen.objectdictionary.eds import export_eds
from canopen.sdo import SdoAbortedError
from durand import DatatypeEnum
from durand.services.nmt import StateEnum

VENDOR, PRODUCT, REVISION, SERIAL = 0x7FFF0001, 0x402, 0x10002, 77
UNITS = 1000

# index, sub, name, type, access, value
OBJECTS = [
    (0x1000, 0, "Device type", "u32", "ro", 0x20192),
    (0x1001, 0, "Error register", "u8", "ro", 0),
    (0x1008, 0, "Manufacturer device name", "string", "const", b"Plain servo"),
    (0x1017, 0, "Producer heartbeat time", "u16", "rw", 0),
    (0x1018, 1, "Vendor-ID", "u32", "ro", VENDOR),
    (0x1018, 2, "Product code", "u32", "ro", PRODUCT),
    (0x1018, 3, "Revision number", "u32", "ro", REVISION),
    (0x1018, 4, "Serial number", "u32", "ro", SERIAL),
    (0x2000, 0, "Note", "string", "rw", b"a note that takes several segments"),
    (0x603F, 0, "Error code", "u16", "ro", 0),
    (0x6040, 0, "Controlword", "u16", "rw", 0),
    (0x6041, 0, "Statusword", "u16", "ro", 0),
    (0x6060, 0, "Modes of operation", "i8", "rw", 0),
    (0x6061, 0, "Modes of operation display", "i8", "ro", 0),
    (0x6064, 0, "Position actual value", "i32", "ro", 0),
    (0x606C, 0, "Velocity actual value", "i32", "ro", 0),
    (0x6077, 0, "Torque actual value", "i16", "ro", 0),
    (0x607A, 0, "Target position", "i32", "rw", 0),
    (0x607C, 0, "Home offset", "i32", "rw", 0),
    (0x6081, 0, "Profile velocity", "u32", "rw", 5 * UNITS),
    (0x6083, 0, "Profile acceleration", "u32", "rw", 50 * UNITS),
    (0x6084, 0, "Profile deceleration", "u32", "rw", 50 * UNITS),
    (0x6092, 1, "Feed", "u32", "rw", UNITS),
    (0x6092, 2, "Shaft revolutions", "u32", "rw", 1),
    (0x6098, 0, "Homing method", "i8", "rw", 37),
    (0x6099, 1, "Speed during search for switch", "u32", "rw", UNITS),
    (0x6099, 2, "Speed during search for zero", "u32", "rw", UNITS),
    (0x609A, 0, "Homing acceleration", "u32", "rw", 50 * UNITS),
    (0x60FF, 0, "Target velocity", "i32", "rw", 0),
    (0x6502, 0, "Supported drive modes", "u32", "ro", 1 | 4 | 32),
]
FAULT = 0x08
STATEWORD = {"disabled": 0x40, "ready": 0x21, "on": 0x23, "enabled": 0x27, "fault": FAULT}
COMMANDS = [(0x82, 0x00, "disabled"), (0x86, 0x02, "disabled"), (0x87, 0x06, "ready"), (0x8F, 0x07, "on"), (0x8F, 0x0F, "enabled")]
FROM = {"ready": ("disabled", "ready", "on", "enabled"), "on": ("ready", "on", "enabled"), "enabled": ("on", "enabled")}


class Shaft402:
    """The state of the objects: read(index, sub) returns present values; write(...) receives the values of a master."""

    def __init__(self):
        self.values = {(index, sub): value for index, sub, _, _, _, value in OBJECTS}
        self.state = "disabled"
        self.control = 0
        self.place = 0.0
        self.speed = 0.0
        self.goal = None
        self.taken = False  # set-point acknowledge, or homing attained
        self.then = time.monotonic()

    def trip(self, code):
        self.pass_time()
        self.state, self.speed, self.goal = "fault", 0.0, None
        self.values[0x603F, 0] = code

    def pass_time(self):
        now = time.monotonic()
        step = self.speed * (now - self.then)
        self.then = now
        if self.goal is not None and abs(step) >= abs(self.goal - self.place):
            self.place, self.speed, self.goal = self.goal, 0.0, None
        else:
            self.place += step

    def read(self, index, sub):
        self.pass_time()
        if index == 0x6041:
            word = STATEWORD[self.state] | 0x10 | 0x200
            mode = self.values[0x6060, 0]
            rests = self.goal is None and (mode != 3 or self.control & 0x100 or self.speed == self.values[0x60FF, 0])
            if self.state == "enabled":
                word |= (0x400 if rests else 0) | (0x1000 if self.taken else 0)
            return word
        live = {
            0x1001: 1 if self.state == "fault" else 0,
            0x6061: self.values[0x6060, 0],
            0x6064: round(self.place),
            0x606C: round(self.speed),
        }
        return live.get(index, self.values.get((index, sub)))

    def write(self, index, sub, value):
        self.pass_time()
        self.values[index, sub] = value.encode() if isinstance(value, str) else value
        if index == 0x6040:
            before, self.control = self.control, value
            self.command(value, value & ~before)
        if index == 0x60FF and self.values[0x6060, 0] == 3 and self.state == "enabled" and not self.control & 0x100:
            self.speed = float(value)

    def command(self, word, rising):
        if self.state == "fault":
            if rising & 0x80:
                self.state, self.values[0x603F, 0] = "disabled", 0
            return
        for mask, bits, to in COMMANDS:
            if word & mask == bits and self.state in FROM.get(to, (self.state,)):
                self.state = to
        if self.state != "enabled" or word & 0x100:
            self.speed, self.goal = 0.0, None
            return
        mode = self.values[0x6060, 0]
        if mode == 1:
            if rising & 0x10:
                self.goal = self.values[0x607A, 0] + (self.place if word & 0x40 else 0)
                self.speed = self.values[0x6081, 0] * (1.0 if self.goal > self.place else -1.0)
            self.taken = bool(word & 0x10)
        if mode == 3:
            self.speed = float(self.values[0x60FF, 0])
        if mode == 6:
            if rising & 0x10:
                self.place = float(self.values[0x607C, 0])
            self.taken = bool(word & 0x10)


class CanopenDrive:
    """Uses the slave side of the PyPI package canopen."""

    TYPES = {"u8": datatypes.UNSIGNED8, "u16": datatypes.UNSIGNED16, "u32": datatypes.UNSIGNED32,
             "i8": datatypes.INTEGER8, "i16": datatypes.INTEGER16, "i32": datatypes.INTEGER32,
             "string": datatypes.VISIBLE_STRING}
    blocks = False

    def __init__(self, bus, node_id):
        self.shaft = Shaft402()
        self.network = canopen.Network(bus)
        self.network.connect()
        od = self.dictionary = canopen.ObjectDictionary()
        for index, sub, name, type_, access, value in OBJECTS:
            variable = ODVariable(name, index, sub)
            variable.data_type, variable.access_type = self.TYPES[type_], access
            variable.default = value.decode() if type_ == "string" else value
            if sub == 0:
                od.add_object(variable)
            else:
                if index not in od:
                    record = ODRecord(name.split(" ")[0], index)
                    count = ODVariable("Highest sub-index supported", index, 0)
                    count.data_type, count.access_type, count.default = datatypes.UNSIGNED8, "const", 0
                    record.add_member(count)
                    od.add_object(record)
                od[index].add_member(variable)
                od[index][0].default = sub
        self.node = canopen.LocalNode(node_id, od)
        self.network.add_node(self.node)
        self.node.add_read_callback(lambda index, subindex, od: self.shaft.read(index, subindex))
        self.node.add_write_callback(self.written)
        self.node.nmt.state = "INITIALISING"
        self.node.nmt.state = "PRE-OPERATIONAL"

    def written(self, index, subindex, od, data):
        if not od.writable:
            raise SdoAbortedError(0x06010002)
        self.shaft.write(index, subindex, od.decode_raw(data))

    def is_stopped(self):
        return self.node.nmt.state == "STOPPED"

    def emergency(self, code):
        self.node.emcy.send(code, 1)

    def eds(self, path):
        with open(path, "w", encoding="utf-8") as file:
            export_eds(self.dictionary, file)

    def close(self):
        self.node.nmt.stop_heartbeat()
        self.network.disconnect()


class DurandDrive:
    """Uses the PyPI package durand: block transfer, LSS and its own EDS."""

    TYPES = {"u8": DatatypeEnum.UNSIGNED8, "u16": DatatypeEnum.UNSIGNED16, "u32": DatatypeEnum.UNSIGNED32,
             "i8": DatatypeEnum.INTEGER8, "i16": DatatypeEnum.INTEGER16, "i32": DatatypeEnum.INTEGER32,
             "string": DatatypeEnum.VISIBLE_STRING}
    blocks = True

    def __init__(self, bus, node_id):
        self.shaft = Shaft402()
        self.network = durand.CANBusNetwork(bus)
        self.node = durand.MinimalNode(self.network, node_id)
        od = self.node.object_dictionary
        for index, sub, name, type_, access, value in OBJECTS:
            if index == 0x1017:
                continue  # the stack has its own object
            variable = durand.Variable(self.TYPES[type_], access, value, name=name)
            if sub == 0:
                od[index] = variable
            else:
                if index not in od:
                    od[index] = durand.Record(name=name.split(" ")[0])
                od[index][sub] = variable
            if index < 0x1010:
                continue
            od.set_read_callback(index, sub, lambda index=index, sub=sub: self.shaft.read(index, sub))
            od.download_callbacks[index, sub].add(lambda value, index=index, sub=sub: self.shaft.write(index, sub, value))

    def is_stopped(self):
        return self.node.nmt.state == StateEnum.STOPPED

    def emergency(self, code):
        self.node.emcy.set(code, 1)

    def eds(self, path):
        with open(path, "w", encoding="utf-8") as file:
            file.write(self.node.eds.content)

    def close(self):
        self.network.stop()
        self.network._bus.shutdown()
