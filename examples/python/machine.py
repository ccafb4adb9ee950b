"""The program of a gantry: two drives (CiA 402) on CAN move the two ends of a bridge. It does not depend on a
simulation."""

import time

import canopen

COUNTS_PER_REVOLUTION = 131072
ACCELERATION = 20  # revolutions per second squared
MASTER_NODE = 100
HEARTBEAT_MS = 50
HEARTBEAT_TIMEOUT_S = 0.2
POLL_S = 0.005
DOOR = 1 << 19  # of 60FDh in the left drive: its input DI3, high while the door is closed
FAULT, TARGET_REACHED, ATTAINED = 1 << 3, 1 << 10, 1 << 12
LIMIT_SWITCHES = 0b11  # of 60FDh
ENABLE, NEW_SETPOINT, HOME, QUICK_STOP, RESET = 0x0F, 0x3F, 0x1F, 0x02, 0x80  # controlwords


class Stopped(Exception):
    """The gantry has stopped; the text is the reason."""


class Drive:
    """A drive of the gantry."""

    def __init__(self, network, name, node):
        self.name = name
        self.node = network.add_node(node, canopen.ObjectDictionary())
        self.node.sdo.RESPONSE_TIMEOUT = 0.1
        self.heard = time.monotonic()
        self.node.nmt.add_heartbeat_callback(self._on_heartbeat)

    def _on_heartbeat(self, _state):
        self.heard = time.monotonic()

    def read(self, index, sub=0, signed=False):
        return int.from_bytes(self.node.sdo.upload(index, sub), "little", signed=signed)

    def write(self, index, value, size, sub=0):
        self.node.sdo.download(index, sub, value.to_bytes(size, "little", signed=value < 0))

    @property
    def statusword(self):
        return self.read(0x6041)

    @property
    def position(self):
        """Returns the position in revolutions from home."""
        return self.read(0x6064, signed=True) / COUNTS_PER_REVOLUTION

    def set_up(self):
        self.write(0x1017, HEARTBEAT_MS, 2)
        self.write(0x1016, MASTER_NODE << 16 | int(HEARTBEAT_TIMEOUT_S * 1000), 4, sub=1)  # the drive needs the master
        self.write(0x1400, 1, 1, sub=2)  # a controlword acts at SYNC, so both drives start together
        for index in (0x6083, 0x6084):
            self.write(index, ACCELERATION * COUNTS_PER_REVOLUTION, 4)
        self.write(0x6065, COUNTS_PER_REVOLUTION // 4, 4)  # following error: a quarter of a revolution
        self.write(0x6066, 10, 2)  # for 10 ms
        self.heard = time.monotonic()


class Gantry:
    """The machine. Positions are revolutions from home, speeds revolutions per second."""

    def __init__(self, interface, channel):
        self.network = canopen.Network()
        self.network.connect(interface=interface, channel=channel)
        self.heartbeat = self.network.send_periodic(0x700 + MASTER_NODE, b"\x05", HEARTBEAT_MS / 1000)
        self.drives = [Drive(self.network, "left", 1), Drive(self.network, "right", 2)]
        self.homed = False

    def close(self):
        self.heartbeat.stop()
        self.network.disconnect()

    # ---- What an operator does ----

    def start(self):
        """Configures and enables the drives. Afterwards the gantry must be homed."""
        self.homed = False
        self._check_door()
        for drive in self.drives:
            drive.set_up()
        self.network.nmt.send_command(1)  # all nodes: operational
        self._reset()
        for word, state in ((0x06, 0x21), (0x07, 0x23), (ENABLE, 0x27)):
            self._command(word)
            self._wait(lambda drive, wanted=state: drive.statusword & 0x6F == wanted, 2, "switch on")

    def home(self):
        """Moves each drive to the upper edge of its home switch, which becomes position 0."""
        for drive in self.drives:
            drive.write(0x6098, 21, 1)
            drive.write(0x6099, 2 * COUNTS_PER_REVOLUTION, 4, sub=1)
            drive.write(0x6099, COUNTS_PER_REVOLUTION // 10, 4, sub=2)
            drive.write(0x6060, 6, 1)
        self._command(ENABLE)
        self._command(HOME)
        self._wait(lambda drive: drive.statusword & (ATTAINED | TARGET_REACHED) == ATTAINED | TARGET_REACHED, 20, "home")
        self._command(ENABLE)
        self.homed = True

    def move(self, to, speed=4):
        """Moves the bridge. Raises Stopped, with both ends at rest or without power, if the move cannot be
        completed."""
        if not self.homed:
            raise Stopped("the gantry is not homed")
        self._check_door()
        for drive in self.drives:
            drive.write(0x6060, 1, 1)
            drive.write(0x607A, round(to * COUNTS_PER_REVOLUTION), 4)
            drive.write(0x6081, round(speed * COUNTS_PER_REVOLUTION), 4)
        self._command(ENABLE)
        self._command(NEW_SETPOINT)
        self._wait(lambda drive: drive.statusword & ATTAINED, 1, "accept the target")  # the bit means "acknowledged" here
        self._command(ENABLE)
        self._wait(lambda drive: not drive.statusword & ATTAINED and drive.statusword & TARGET_REACHED, 20, "move")

    def limit_torque(self, permille):
        """Limits the torque of both drives, in 1/1000 of the rated torque."""
        for drive in self.drives:
            drive.write(0x6072, permille, 2)

    # ---- Internal ----

    def _command(self, controlword):
        """Sends the controlword to both drives. It acts at the SYNC, in both at the same time."""
        for drive in self.drives:
            self.network.send_message(0x200 + drive.node.id, controlword.to_bytes(2, "little"))
        self.network.sync.transmit()
        time.sleep(POLL_S)

    def _reset(self):
        for drive in self.drives:
            if drive.statusword & FAULT:
                self._command(0)
                self._command(RESET)
                if drive.statusword & FAULT:
                    raise Stopped(f"{drive.name}: fault {drive.read(0x603F):04X}h stays")

    def _check_door(self):
        if not self.drives[0].read(0x60FD) & DOOR:
            raise Stopped("the door is open")

    def _wait(self, done, timeout, what):
        """Monitors the drives until both are done. If an error occurs, it stops the gantry."""
        end = time.monotonic() + timeout
        try:
            while True:
                self._watch()
                if all([done(drive) for drive in self.drives]):
                    return
                if time.monotonic() > end:
                    raise Stopped(f"{what}: not done after {timeout} s")
                time.sleep(POLL_S)
        except (Stopped, canopen.SdoCommunicationError) as error:
            self._command(QUICK_STOP)  # without it a drive stops by its heartbeat timeout, or has no power
            time.sleep(0.5)
            self.homed = False
            lost = [drive.name for drive in self.drives if time.monotonic() - drive.heard > HEARTBEAT_TIMEOUT_S]
            raise Stopped(f"{' and '.join(lost)}: no heartbeat" if lost else str(error)) from error

    def _watch(self):
        for drive in self.drives:
            status = drive.statusword
            if status & FAULT:
                raise Stopped(f"{drive.name}: fault {drive.read(0x603F):04X}h")
            if drive.read(0x60FD) & LIMIT_SWITCHES:
                raise Stopped(f"{drive.name}: at a limit switch")
        self._check_door()
