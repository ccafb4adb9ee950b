"""python-can and canopen, unchanged, on a CAN bus of a line in this process."""

import asyncio
import logging
import queue
import random
import threading
import time

import pytest
import servodrome

can = pytest.importorskip("can")
canopen = pytest.importorskip("canopen")

import servodrome.can_bus  # noqa: E402
from servodrome._scheduler import Scheduler  # noqa: E402
from servodrome.virtual_time import real_time, virtual_time  # noqa: E402

IDENTITY = bytes.fromhex("4000100000000000")  # reads 1000h
ANSWER = bytes.fromhex("4300100092010200")


def two_drives():
    return servodrome.Line(axes=[servodrome.Axis("x", "generic402", node=2), servodrome.Axis("y", "ismc", node=1)])


@pytest.fixture
def plain():
    """A line outside of virtual_time, after the boot of its drives."""
    with two_drives() as opened:
        opened.advance(1)
        yield opened


@pytest.fixture
def line(plain):
    with virtual_time(plain):
        yield plain


@pytest.fixture
def bus(line):
    with can.Bus(interface="servodrome", channel="can0", line=line) as opened:
        yield opened


def message(identifier, data=b"", **keys):
    return can.Message(arbitration_id=identifier, data=data, is_extended_id=identifier > 0x7FF, **keys)


# ---- The interface ----


def test_a_request_and_its_answer(line, bus):
    assert (bus.channel, bus.channel_info, bus.fileno()) == ("can0", "servodrome can0", -1)
    assert bus.state is can.BusState.ACTIVE and bus.protocol is can.CanProtocol.CAN_20
    bus.send(message(0x602, IDENTITY))
    answer = bus.recv()
    assert (answer.arbitration_id, bytes(answer.data), answer.dlc) == (0x582, ANSWER, 8)
    assert not (answer.is_extended_id or answer.is_remote_frame or answer.is_error_frame or answer.is_fd) and answer.is_rx
    assert answer.channel == "can0"
    assert answer.timestamp == line.now and 1.0002 < line.now < 1.001, "the end of the frame, in line time"


def test_timeouts_are_line_time(line, bus):
    for timeout in (0.5, 0.125, 3):
        begin = line.now
        assert bus.recv(timeout) is None
        assert line.now == pytest.approx(begin + timeout, abs=2e-6)
    begin = line.now
    assert bus.recv(0) is None and line.now == begin


def test_outside_of_virtual_time_recv_lets_time_pass(plain):
    with can.Bus(interface="servodrome", channel="can0", line=plain) as bus:
        bus.send(message(0x602, IDENTITY))
        assert bus.recv(0) is None and plain.now == 1
        assert bytes(bus.recv(1).data) == ANSWER
        begin = plain.now
        assert bus.recv(2.5) is None
        assert plain.now == pytest.approx(begin + 2.5)
        bus.send(message(0x602, IDENTITY))
        assert bytes(bus.recv().data) == ANSWER


def test_remote_and_extended_frames(line, bus):
    bus.send(message(0x702, is_remote_frame=True, dlc=1))  # node guarding
    guarded = bus.recv(1)
    assert (guarded.arbitration_id, bytes(guarded.data)) == (0x702, b"\x7f")
    with can.Bus(interface="servodrome", channel="can0", line=line) as other:
        bus.send(message(0x1ABCDEF0, b"\1\2\3"))
        bus.send(message(0x123, is_remote_frame=True, dlc=5))
        extended, remote = other.recv(1), other.recv(1)
    assert (extended.arbitration_id, extended.is_extended_id, bytes(extended.data)) == (0x1ABCDEF0, True, b"\1\2\3")
    assert (remote.arbitration_id, remote.is_remote_frame, remote.dlc, bytes(remote.data)) == (0x123, True, 5, b"")
    assert bus.recv(0.1) is None, "a port does not receive its own frames"


def test_filters(line, bus):
    bus.set_filters([{"can_id": 0x581, "can_mask": 0x7FF, "extended": False}])
    for node in (1, 2):
        bus.send(message(0x600 + node, IDENTITY))
    assert [frame.arbitration_id for frame in iter(lambda: bus.recv(0.1), None)] == [0x581]
    with can.Bus("can0", interface="servodrome", line=line, can_filters=[{"can_id": 0x582, "can_mask": 0x7FF}]) as filtered:
        for node in (1, 2):
            bus.send(message(0x600 + node, IDENTITY))
        assert [frame.arbitration_id for frame in iter(lambda: filtered.recv(0.1), None)] == [0x582]


def test_a_full_queue(line, bus):
    frame = message(0x7F0, bytes(8))
    assert bus.state is can.BusState.ACTIVE
    with pytest.raises(can.CanOperationError, match="no more frames"):
        for _ in range(100_000):
            bus.send(frame)
    begin = line.now
    bus.send(frame, timeout=1)
    assert begin < line.now < begin + 0.01
    with can.Bus(interface="servodrome", channel="can0", line=line):
        line.buses["can0"].disturb(cut=True)
        for _ in range(3):
            try:
                while True:
                    bus.send(frame)
            except can.CanOperationError:
                begin = line.now
            with pytest.raises(can.CanOperationError):
                bus.send(frame, timeout=0.05)
            assert line.now == pytest.approx(begin + 0.05)
        assert bus.state is can.BusState.PASSIVE, "no node acknowledges"


def test_frames_that_were_not_read_in_time_are_logged(line, bus, caplog):
    with can.Bus(interface="servodrome", channel="can0", line=line) as sender:
        for _ in range(6):
            for number in range(4000):
                sender.send(message(0x100, number.to_bytes(2, "little")))
            time.sleep(2)
    with caplog.at_level(logging.WARNING, "can.servodrome"):
        frames = list(iter(lambda: bus.recv(0), None))
    assert len(frames) == 16384
    assert [record.message for record in caplog.records if "lost" in record.message] != []


@pytest.mark.parametrize(
    "keys, text",
    [
        ({"channel": "no"}, "no"),
        ({"channel": "can0", "fd": True}, "classic CAN"),
        ({"channel": "can0", "bitrate": 125_000}, "1000000, not 125000"),
        ({"channel": "ecat"}, "ecat"),
    ],
)
def test_what_cannot_be_opened(line, keys, text):
    with pytest.raises(can.CanInitializationError, match=text):
        can.Bus(interface="servodrome", line=line, **keys)
    can.Bus(interface="servodrome", channel="can0", bitrate=1_000_000, fd=False, line=line).shutdown()


def test_what_cannot_be_sent(bus):
    with pytest.raises(can.CanOperationError, match="classic CAN"):
        bus.send(message(1, bytes(12), is_fd=True))
    with pytest.raises(can.CanOperationError, match="error frame"):
        bus.send(message(0, is_error_frame=True))


def test_after_shutdown(line):
    bus = can.Bus(interface="servodrome", channel="can0", line=line)
    reader = queue.Queue()

    def reads():
        try:
            bus.recv(100)
        except can.CanError as error:
            reader.put(error)

    thread = threading.Thread(target=reads)
    thread.start()
    time.sleep(1)
    bus.shutdown()
    bus.shutdown()
    assert "closed" in str(reader.get()) and line.now == 2
    for use in (lambda: bus.recv(1), lambda: bus.send(message(1))):
        with pytest.raises(can.CanOperationError, match="closed"):
            use()
    thread.join()


def test_the_line_by_default():
    with two_drives() as first:
        with virtual_time(first), can.Bus(interface="servodrome", channel="can0") as bus:
            assert bus._port.line is first, "that of virtual_time"
        with can.Bus(interface="servodrome", channel="can0") as bus:
            assert bus._port.line is first, "the only one with this bus"
        found = [one for one in can.detect_available_configs("servodrome") if one["line"] is first]
        assert [one["channel"] for one in found] == ["can0"]
        with two_drives() as second:
            with pytest.raises(can.CanInitializationError, match="2 open lines"):
                can.Bus(interface="servodrome", channel="can0")
            with virtual_time(second), pytest.raises(can.CanOperationError, match="another line"):
                with can.Bus(interface="servodrome", channel="can0", line=first) as bus:
                    bus.recv(1)
    with pytest.raises(can.CanInitializationError, match="no open line"):
        can.Bus(interface="servodrome", channel="can0")


def test_a_thread_from_before_virtual_time_cannot_receive_in_it(plain):
    go, errors = threading.Event(), queue.Queue()
    bus = can.Bus(interface="servodrome", channel="can0", line=plain)

    def reads():
        assert go.wait(60)
        try:
            bus.recv(1)
        except can.CanOperationError as error:
            errors.put(str(error))

    thread = threading.Thread(target=reads)
    thread.start()
    with virtual_time(plain):
        go.set()
        with real_time():
            text = errors.get(timeout=60)
        bus.send(message(0x602, IDENTITY))
        assert bytes(bus.recv(1).data) == ANSWER
    thread.join()
    bus.shutdown()
    assert "does not participate" in text


# ---- Services of python-can ----


def test_notifier_and_buffered_reader(line, bus):
    reader, seen = can.BufferedReader(), []
    notifier = can.Notifier(bus, [reader, seen.append])
    bus.send(message(0x602, IDENTITY))
    assert bytes(reader.get_message(timeout=10).data) == ANSWER
    begin = line.now
    assert reader.get_message(timeout=2) is None and line.now == pytest.approx(begin + 2)
    notifier.stop()
    assert len(seen) == 1 and not any("Notifier" in thread.name for thread in threading.enumerate())


def test_an_asyncio_notifier(line, bus):
    async def main():
        reader = can.AsyncBufferedReader()
        notifier = can.Notifier(bus, [reader], loop=asyncio.get_running_loop())
        for _ in range(3):
            bus.send(message(0x602, IDENTITY))
            assert bytes((await asyncio.wait_for(reader.get_message(), 10)).data) == ANSWER
            await asyncio.sleep(1)
        notifier.stop()

    asyncio.run(main())
    assert 4 < line.now < 6.1


def test_periodic_messages_keep_their_period(line, bus):
    with can.Bus(interface="servodrome", channel="can0", line=line) as listener:
        begin = line.now
        task = bus.send_periodic(message(0x100, b"\1"), 0.01, duration=0.1)
        bus.send_periodic(message(0x200, b"\2"), 0.03)
        time.sleep(0.055)
        task.modify_data(message(0x100, b"\3"))
        time.sleep(0.1)
        bus.stop_all_periodic_tasks()
        frames = list(iter(lambda: listener.recv(0), None))
    fast = [frame for frame in frames if frame.arbitration_id == 0x100]
    assert [bytes(frame.data) for frame in fast] == [b"\1"] * 6 + [b"\3"] * 4
    assert [frame.timestamp - begin for frame in fast] == pytest.approx([0.01 * n for n in range(10)], abs=2e-4)
    slow = [frame.timestamp - begin for frame in frames if frame.arbitration_id == 0x200]
    assert slow == pytest.approx([0.03 * n for n in range(6)], abs=2e-4)


def test_a_thread_safe_bus(line):
    with can.ThreadSafeBus(interface="servodrome", channel="can0", line=line) as bus:
        counted = []

        def reads():
            while len(counted) < 10:
                counted.append(bus.recv(10))

        threads = [threading.Thread(target=reads)]
        threads[0].start()
        for _ in range(10):
            bus.send(message(0x602, IDENTITY))
            time.sleep(0.01)
        threads[0].join()
    assert len(counted) == 10


# ---- canopen ----


@pytest.fixture
def network(line):
    network = canopen.Network()
    network.connect(interface="servodrome", channel="can0", line=line)
    yield network
    network.disconnect()


def test_canopen_reads_writes_and_times_out(line, network):
    node = network.add_node(2, canopen.ObjectDictionary())
    assert node.sdo.upload(0x1000, 0) == ANSWER[4:]
    assert node.sdo.upload(0x1008, 0) == b"Servodrome CiA 402 reference drive"
    node.sdo.download(0x6083, 0, (777).to_bytes(4, "little"))
    assert node.sdo.upload(0x6083, 0) == (777).to_bytes(4, "little")
    with pytest.raises(canopen.SdoAbortedError) as refused:
        node.sdo.upload(0x5FFF, 0)
    assert refused.value.code == 0x06020000
    absent = network.add_node(99, canopen.ObjectDictionary())
    begin = line.now
    with pytest.raises(canopen.SdoCommunicationError):
        absent.sdo.upload(0x1000, 0)
    assert line.now == pytest.approx(begin + absent.sdo.RESPONSE_TIMEOUT, abs=1e-3)


def test_canopen_by_the_names_of_the_drives_own_eds(line, network):
    import io

    raw = network.add_node(2, canopen.ObjectDictionary())
    with raw.sdo.open(0x1021, 0, "rb", block_transfer=True) as stream:
        file = io.StringIO(stream.read().decode())
    file.name = "upload.eds"
    drive = network.add_node(2, canopen.import_od(file, 2))
    drive.nmt.state = "OPERATIONAL"
    drive.sdo["Producer heartbeat time"].raw = 100
    assert drive.nmt.wait_for_heartbeat(1) == "OPERATIONAL"
    for word, value in ((0x06, 0x21), (0x07, 0x23), (0x0F, 0x27)):
        drive.sdo["Controlword"].raw = word
        while drive.sdo["Statusword"].raw & 0x6F != value:
            time.sleep(0.01)
    drive.nmt.wait_for_heartbeat(1)
    network.scanner.reset()
    network.scanner.search()
    time.sleep(0.1)
    assert sorted(network.scanner.nodes) == [1, 2]


# ---- Repeatability ----


class Delays:
    """Real-time delays at random places, where another thread could run if the scheduler allowed it."""

    def __init__(self, seed):
        self.random = random.Random(seed)

    def __call__(self):
        if self.random.random() < 0.05:
            with real_time():
                time.sleep(self.random.random() * 1e-3)


def busy_master(delays=None, seconds=0.25):
    """A master that uses all services with threads; returns what it observed, and the traffic of the bus."""
    seen = []
    with two_drives() as line:
        record = line.buses["can0"].record()
        with virtual_time(line):
            network = canopen.Network()
            network.connect(interface="servodrome", channel="can0", line=line)
            other = canopen.Network()
            other.connect(interface="servodrome", channel="can0", line=line)
            network.listeners.append(lambda frame: seen.append((frame.timestamp, frame.arbitration_id, bytes(frame.data))))
            if delays is not None:
                network.listeners.append(lambda _frame: delays())
            nodes = [network.add_node(number, canopen.ObjectDictionary()) for number in (1, 2)]
            watcher = other.add_node(2, canopen.ObjectDictionary())
            watcher.nmt.add_heartbeat_callback(lambda state: seen.append((line.now_ns, "heartbeat", state)))

            def poll(node, index, period):
                while line.now < seconds:
                    seen.append((line.now_ns, node.id, node.sdo.upload(index, 0)))
                    time.sleep(period)

            for node in nodes:
                node.sdo.download(0x1017, 0, (7 + node.id).to_bytes(2, "little"))
                node.sdo.download(0x1800, 2, b"\1")  # TPDO 1 after each SYNC
            network.nmt.send_command(1)
            network.sync.start(0.004)
            rpdo = network.send_periodic(0x202, b"\x06\x00", 0.005)
            threads = [
                threading.Thread(target=poll, args=arguments, name=f"poll {arguments[0].id}")
                for arguments in ((nodes[0], 0x6041, 0.003), (nodes[1], 0x6064, 0.0017))
            ]
            for thread in threads:
                thread.start()
            time.sleep(seconds / 2)
            rpdo.update(b"\x07\x00")
            for thread in threads:
                thread.join()
            network.sync.stop()
            rpdo.stop()
            network.disconnect()
            other.disconnect()
        record.end()
        candump = line.buses["can0"].capture("candump")
        frames = [(frame.time_ns, frame.sender, frame.bytes) for frame in line.buses["can0"].traffic]
    return seen, candump, frames


def test_fifty_runs_with_random_delays_are_equal_to_the_nanosecond(monkeypatch):
    expected = busy_master()
    seen, candump, frames = expected
    kinds = {int(text.split()[2].split("#")[0], 16) & 0x780 for text in candump.decode().splitlines()}
    assert {0x000, 0x080, 0x180, 0x200, 0x580, 0x600, 0x700} <= kinds
    assert len(frames) > 400 and sum(entry[1] == "heartbeat" for entry in seen) > 20
    assert any(time_ns % 1000 for time_ns, _, _ in frames), "times are finer than candump prints"
    for seed in range(50):
        delays = Delays(seed)
        monkeypatch.setattr(Scheduler, "disturb", staticmethod(delays))
        assert busy_master(delays) == expected, f"run {seed}"
