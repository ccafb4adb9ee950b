"""pysoem's master; its cycle runs in a separate thread."""

import threading
import time

import pysoem
from line import PATIENCE

# These tests do not judge response times, so the timeout is long enough for a busy machine.
pysoem.settings.timeouts.ret = 50_000
pysoem.settings.timeouts.safe = 1_000_000
pysoem.settings.timeouts.eeprom = 1_000_000
pysoem.settings.timeouts.tx_mailbox = 5_000_000
pysoem.settings.timeouts.rx_mailbox = 10_000_000
pysoem.settings.timeouts.state = 10_000_000
pysoem.settings.always_release_gil = True

INIT, PREOP, BOOT, SAFEOP, OP = 1, 2, 3, 4, 8
ERROR = 0x10


def set_watchdog(slave, ms):
    """pysoem waits for these registers for a few ms, whatever its timeouts are: this repeats until it succeeds."""
    deadline = time.monotonic() + PATIENCE
    while True:
        try:
            return slave.set_watchdog("processdata", ms)
        except pysoem.WkcError:
            if time.monotonic() > deadline:
                raise


class Master:
    def __init__(self, interface, second=None):
        self.soem = pysoem.Master()
        self.soem.sdo_read_timeout = self.soem.sdo_write_timeout = 30_000_000
        if second:
            self.soem.open(interface, second)
        else:
            self.soem.open(interface)
        self.cycles = 0
        self.working_counter = 0
        self.each_cycle = []  # called with the number of the cycle, before its frame goes out
        self._thread = None
        self._ends = threading.Event()
        self._cycled = threading.Condition()
        self._failure = None

    def close(self):
        self.stop_cycle()
        if self.soem:
            self.soem.close()
        self.soem = None

    @property
    def slaves(self):
        return self.soem.slaves

    def scan(self):
        """Finds the slaves, which then are in Pre-Operational. Returns their number; -1 if there is none."""
        return self.soem.config_init()

    def map(self, dc_cycle_ns=None, watchdog_ms=5000):
        """Configures the process data and requests Safe-Operational. If a cycle is given, it starts SYNC0 before. The
        slaves' watchdogs get a time that a busy machine does not exceed; 0 leaves them unchanged."""

        def prepare(slave):  # pysoem also calls it when a slave returns (reconfig)
            if watchdog_ms:
                set_watchdog(slave, watchdog_ms)
            if dc_cycle_ns:
                slave.dc_sync(True, dc_cycle_ns)

        if dc_cycle_ns:
            assert self.soem.config_dc()
        for slave in self.slaves:
            slave.setup_func = prepare
        self.soem.config_map()
        assert self.soem.state_check(SAFEOP, int(PATIENCE * 1e6)) == SAFEOP, self.states()

    def states(self):
        """Returns (state, AL status code) of each slave."""
        self.soem.read_state()
        return [(slave.state, slave.al_status) for slave in self.slaves]

    def start_cycle(self, period_s=0.002):
        self._ends.clear()
        self._thread = threading.Thread(target=self._cycle, args=(period_s,), daemon=True)
        self._thread.start()
        self.pass_cycles(1)

    def stop_cycle(self):
        if self._thread:
            self._ends.set()
            self._thread.join()
            self._thread = None

    def _cycle(self, period_s):
        try:
            due = time.monotonic()
            while not self._ends.is_set():
                for step in list(self.each_cycle):
                    step(self.cycles)
                self.soem.send_processdata()
                self.working_counter = self.soem.receive_processdata(200_000)
                with self._cycled:
                    self.cycles += 1
                    self._cycled.notify_all()
                due = max(due + period_s, time.monotonic())
                time.sleep(max(0.0, due - time.monotonic()))
        except BaseException as failure:
            self._failure = failure
            raise

    def pass_cycles(self, count):
        end = self.cycles + count
        with self._cycled:
            assert self._cycled.wait_for(lambda: self.cycles >= end or self._failure, PATIENCE), "no cycles"
        assert not self._failure, self._failure

    def wait(self, condition, what, seconds=PATIENCE):
        """Checks condition() after every cycle and returns its first true value."""
        deadline = time.monotonic() + seconds
        while True:
            if value := condition():
                return value
            assert time.monotonic() < deadline, f"waited for {what() if callable(what) else what}"
            self.pass_cycles(1)

    def request(self, state):
        self.soem.state = state
        self.soem.write_state()

    def wait_states(self, state):
        self.wait(lambda: all(found == state for found, _ in self.states()), lambda: f"{state}, are {self.states()}")

    def go_operational(self):
        """Changes from Safe-Operational to Operational while the cycle runs."""
        if not self._thread:
            self.start_cycle()
        self.request(OP)
        self.wait_states(OP)
        self.wait(
            lambda: self.working_counter == self.soem.expected_wkc,
            lambda: f"working counter {self.soem.expected_wkc}, is {self.working_counter}",
        )

    def mend(self):
        """Does what pysoem's examples do in every cycle for slaves that are not operational. True if all are."""
        self.soem.read_state()
        for slave in self.slaves:
            if slave.state == OP:
                continue
            if slave.state == SAFEOP | ERROR:
                slave.state = SAFEOP | ERROR  # acknowledges
                slave.write_state()
            elif slave.state == SAFEOP:
                slave.state = OP
                slave.write_state()
            elif slave.state > 0:
                if slave.reconfig(1_000_000):
                    slave.is_lost = False
            elif not slave.is_lost:
                slave.is_lost = True
            if slave.is_lost and (slave.state or slave.recover(1_000_000)):
                slave.is_lost = False
        return all(slave.state == OP for slave in self.slaves)

    def run(self, **options):
        self.map(**options)
        self.go_operational()
