#include "slave_rig.hpp"

// Process data into the dictionary and back, and the synchronisation modes (ETG.1020 clauses 12 and 17).
namespace servodrome::ethercat::test {
namespace ethercat_process_data_test {
namespace {

class ProcessData : public SlaveRig {};

TEST_F(ProcessData, OutputsInOperationalInputsAlready) {
  to_safe_operational();
  objects.position_actual = 0x01020304;
  slave.process_image_updated(line.now);
  EXPECT_EQ(send(Command::lrd, 0x1100, Bytes(7)).data, (Bytes{0, 0, 0, 4, 3, 2, 1}));
  cycle(0x55);
  EXPECT_EQ(objects.target_position, 0);  // outputs have no effect in Safe-Operational
  EXPECT_EQ(request(8), good(8));
  const Bytes inputs = cycle(0x12345678);
  EXPECT_EQ(objects.target_position, 0x12345678);
  EXPECT_EQ(objects.controlword, 0x0F);
  EXPECT_EQ(objects.mode, 8);
  EXPECT_EQ(inputs, (Bytes{0x0F, 0x80, 8, 0x79, 0x56, 0x34, 0x12}));  // of the same cycle
  request(4);
  cycle(0x66);
  EXPECT_EQ(objects.target_position, 0x12345678);
}

TEST_F(ProcessData, WorkingCountersOfACycle) {
  to_operational();
  EXPECT_EQ(send(Command::lrw, 0x1000, Bytes(0x107)).counter, 3U);
  EXPECT_EQ(send(Command::lwr, 0x1000, Bytes(7)).counter, 1U);
  EXPECT_EQ(send(Command::lrd, 0x1100, Bytes(7)).counter, 1U);
}

// A master that checks only its working counters sees from them which slaves exchange process data.
TEST_F(ProcessData, WorkingCountersTellOfTheState) {
  const auto counter = [this] { return send(Command::lrw, 0x1000, Bytes(0x107)).counter; };
  to_pre_operational();
  set_process_data(7, 7);
  EXPECT_EQ(counter(), 0U);
  ASSERT_EQ(request(4), good(4));
  EXPECT_EQ(counter(), 3U);
  ASSERT_EQ(request(8), good(8));
  run(200ms);  // the watchdog
  EXPECT_EQ(status().first, 0x14U);
  EXPECT_EQ(counter(), 1U);  // inputs only
  EXPECT_EQ(line.get<std::uint16_t>(0, reg::watchdog_status), 0);
  EXPECT_EQ(request(0x14), good(4));
  EXPECT_EQ(counter(), 3U);
  ASSERT_EQ(request(8), good(8));
  EXPECT_EQ(request(4), good(4));  // unchanged
  EXPECT_EQ(counter(), 3U);
  slave.fall_back(AlState::pre_operational, AlStatusCode::needs_pre_operational, line.now);
  EXPECT_EQ(counter(), 0U);
  EXPECT_EQ(request(0x12), good(2));
  EXPECT_EQ(counter(), 0U);
  EXPECT_EQ(request(4), good(4));
  EXPECT_EQ(counter(), 3U);
}

TEST_F(ProcessData, NotLetIntoOperationalOutputsAreNotTaken) {
  to_safe_operational();
  request(8);
  run(5s);
  EXPECT_EQ(status(), (std::pair{0x14U, AlStatusCode::no_valid_outputs}));
  EXPECT_EQ(send(Command::lwr, 0x1000, Bytes(7)).counter, 0U);
  EXPECT_EQ(request(0x18), good(4));
  EXPECT_EQ(send(Command::lwr, 0x1000, Bytes(7)).counter, 1U);
  EXPECT_EQ(status(), good(8));
}

TEST_F(ProcessData, RemappedWithBitsGapsAndTwoPdos) {
  to_pre_operational();
  const auto map = [this](std::uint16_t pdo, std::initializer_list<std::uint32_t> entries) {
    EXPECT_EQ(download(pdo, 0, 0, 1), AbortCode::none);
    unsigned sub = 0;
    for (const std::uint32_t entry : entries) EXPECT_EQ(download(pdo, ++sub, entry, 4), AbortCode::none);
    EXPECT_EQ(download(pdo, 0, sub, 1), AbortCode::none);
  };
  const auto assign = [this](std::uint16_t index, std::initializer_list<std::uint32_t> pdos) {
    EXPECT_EQ(download(index, 0, 0, 1), AbortCode::none);
    unsigned sub = 0;
    for (const std::uint32_t pdo : pdos) EXPECT_EQ(download(index, ++sub, pdo, 2), AbortCode::none);
    EXPECT_EQ(download(index, 0, sub, 1), AbortCode::none);
  };
  // Bit 0 a flag, 3 bits gap, then 16 bits at bit 4; the second PDO begins at bit 20.
  map(0x1600, {0x20200001, 0x00000003, 0x60400010});
  map(0x1601, {0x00050008, 0x20060010, 0x00000004});  // a dummy of 8 bits, an object with a range
  assign(0x1C12, {0x1600, 0x1601});
  map(0x1A01, {0x20210001, 0x00000007, 0x60610008, 0x20210001});
  assign(0x1C13, {0x1A01});
  set_process_data(6, 3);
  ASSERT_EQ(request(4), good(4));
  // Flag 1, controlword ABCDh, dummy FFh, ranged 64h = 100.
  const std::uint64_t outputs = 1ULL | 0xABCDULL << 4 | 0xFFULL << 20 | 100ULL << 28;
  Bytes bytes = bytes_of(outputs);
  bytes.resize(6);
  send(Command::lwr, 0x1000, bytes);
  ASSERT_EQ(request(8), good(8));
  objects.flag_in = true;
  send(Command::lwr, 0x1000, bytes);
  EXPECT_TRUE(objects.flag_out);
  EXPECT_EQ(objects.controlword, 0xABCD);
  EXPECT_EQ(objects.ranged, 100);
  objects.mode = 0x5A;
  bytes[3] = 0xF0, bytes[4] = 0x07;  // 7Fh is beyond the range, so the object keeps its value
  send(Command::lwr, 0x1000, bytes);
  EXPECT_EQ(objects.ranged, 100);
  EXPECT_EQ(send(Command::lrd, 0x1100, Bytes(3)).data, (Bytes{0x01, 0x5A, 0x01}));
}

// Objects that are mapped longer or shorter than their size keep their sign, and refuse values that they cannot hold.
TEST_F(ProcessData, OtherLengthsThanTheObjects) {
  profile.mapped_length_may_differ = true;
  to_pre_operational();
  const auto map = [this](std::uint16_t pdo, std::initializer_list<std::uint32_t> entries) {
    EXPECT_EQ(download(pdo, 0, 0, 1), AbortCode::none);
    unsigned sub = 0;
    for (const std::uint32_t entry : entries) EXPECT_EQ(download(pdo, ++sub, entry, 4), AbortCode::none);
    EXPECT_EQ(download(pdo, 0, sub, 1), AbortCode::none);
  };
  map(0x1600, {0x20060020, 0x607A0010});  // INTEGER16 of -100 to 100 as 32 bits, INTEGER32 as 16
  map(0x1A00, {0x20060020});
  set_process_data(6, 4);
  ASSERT_EQ(request(4), good(4));
  const auto put = [this](std::int32_t ranged, std::int16_t target) {
    Bytes bytes(6);
    store(bytes.data(), ranged);
    store(bytes.data() + 4, target);
    send(Command::lwr, 0x1000, bytes);
    return send(Command::lrd, 0x1100, Bytes(4)).data;
  };
  put(0, 0);
  ASSERT_EQ(request(8), good(8));
  EXPECT_EQ(put(-5, -2), bytes_of(-5));
  EXPECT_EQ(objects.ranged, -5);
  EXPECT_EQ(objects.target_position, -2);
  EXPECT_EQ(put(0x1'0007, 3), bytes_of(-5));  // its lower half would be valid
  EXPECT_EQ(objects.target_position, 3);
}

TEST_F(ProcessData, OwnersAreToldWhenAllValuesAreThere) {
  to_pre_operational();
  download(0x1600, 0, 0, 1);
  download(0x1600, 1, 0x20070010, 4);
  download(0x1600, 2, 0x607A0020, 4);
  download(0x1600, 0, 2, 1);
  set_process_data(6, 7);
  ASSERT_EQ(request(4), good(4));
  send(Command::lwr, 0x1000, {5, 0, 9, 0, 0, 0});
  ASSERT_EQ(request(8), good(8));
  EXPECT_TRUE(events.told.empty());
  send(Command::lwr, 0x1000, {5, 0, 9, 0, 0, 0});
  EXPECT_EQ(events.told, std::vector<std::uint16_t>{0x2007});
  EXPECT_EQ(events.position_when_told, 9);
  send(Command::lwr, 0x1000, {0xEE, 0, 10, 0, 0, 0});  // this object is refused, the others are written
  EXPECT_EQ(events.told.size(), 1U);
  EXPECT_EQ(objects.owned, 5);
  EXPECT_EQ(objects.target_position, 10);
}

TEST_F(ProcessData, NoOutputsAtAll) {
  to_pre_operational();
  download(0x1C12, 0, 0, 1);
  line.set_sync_manager(0, 3, 0x1500, 7, 0x20);
  ASSERT_EQ(request(4), good(4));
  EXPECT_EQ(request(8), good(8));  // nothing to wait for
  run(10s);
  EXPECT_EQ(status(), good(8));
}

TEST_F(ProcessData, TooMuchIsRefused) {
  to_pre_operational();
  profile.greatest_outputs = 10;
  download(0x1600, 0, 0, 1);
  download(0x1600, 1, 0x20030040, 4);
  download(0x1600, 2, 0x607A0020, 4);
  EXPECT_EQ(download(0x1600, 0, 2, 1), AbortCode::mapping_exceeds_pdo_length);
  EXPECT_EQ(download(0x1600, 0, 1, 1), AbortCode::none);
}

TEST_F(ProcessData, RandomMappingsComeThrough) {
  // For any order of the objects, with random gaps, every value arrives at its place in the mapping.
  std::uint32_t seed = 1;
  const auto random = [&seed](std::uint32_t n) {
    seed = seed * 1664525U + 1013904223U;
    return (seed >> 8) % n;
  };
  for (int round = 0; round < 200; ++round) {
    objects.communication.rx_assignment.count = 1;
    auto& mapping = objects.communication.rx_mapping[0];
    std::vector<std::uint32_t> order{0x60400010, 0x60600008, 0x607A0020, 0x20200001, 0x20030040};
    for (std::size_t i = order.size(); i > 1; --i)
      std::swap(order[i - 1], order[random(static_cast<std::uint32_t>(i))]);
    std::uint8_t count = 0;
    unsigned bit = 0;
    std::array<std::uint8_t, 64> image{};
    const std::uint64_t value = 0xF1E2D3C4B5A69788 ^ (std::uint64_t{seed} << 20);
    for (const std::uint32_t entry : order) {
      if (const std::uint32_t gap = random(12); gap != 0) mapping.entry[count++] = gap, bit += gap;
      mapping.entry[count++] = entry;
      for (unsigned i = 0; i < (entry & 0xFF); ++i, ++bit) {
        image[bit / 8] = static_cast<std::uint8_t>(image[bit / 8] | (value >> i & 1) << bit % 8);
      }
    }
    mapping.count = count;
    ProcessImage outputs(dictionary, Direction::outputs, profile, storage.outputs);
    ASSERT_EQ(outputs.resolve(), AbortCode::none);
    ASSERT_EQ(outputs.bytes(), (bit + 7) / 8);
    outputs.write_objects(image);
    EXPECT_EQ(objects.controlword, static_cast<std::uint16_t>(value));
    EXPECT_EQ(objects.mode, static_cast<std::int8_t>(value));
    EXPECT_EQ(objects.target_position, static_cast<std::int32_t>(value));
    EXPECT_EQ(objects.flag_out, (value & 1) != 0);
    EXPECT_EQ(objects.wide, value);
  }
}

// ---- Process data that the application samples ----

TEST_F(ProcessData, AreSampledInTheCycleOfTheApplication) {
  to_operational();
  slave.sample_process_data_every(100us);
  run(100us - line.now % 100us);
  const unsigned before = events.cycles;
  const Bytes inputs = cycle(5);
  EXPECT_EQ(events.cycles, before);
  run(40us);
  EXPECT_EQ(cycle(6), inputs);
  run(40us);
  EXPECT_NE(objects.target_position, 6);
  run(20us);
  EXPECT_EQ(objects.target_position, 6);
  EXPECT_EQ(events.cycles, before + 1);
  EXPECT_EQ(send(Command::lrd, 0x1100, Bytes(7)).data, (Bytes{0x0F, 0x80, 8, 7, 0, 0, 0}));
  // Other data do not wait, and process data that came before them are processed first.
  cycle(7);
  EXPECT_EQ(request(4), good(4));
  EXPECT_EQ(objects.target_position, 7);
  slave.sample_process_data_every(Time{0});
  EXPECT_EQ(request(8), good(8));
  cycle(8);
  EXPECT_EQ(objects.target_position, 8);
}

// Frames at intervals shorter than 1C32h:05 wait for the next control loop, until the intervals are long enough again.
class TooFast : public SlaveRig {
 protected:
  void SetUp() override {
    to_operational();
    slave.sample_process_data_every(50us);
    run(50us - line.now % 50us);
  }
  void learn_loop() {
    slave.process_image_updated(line.now);
    run(400us);
    loop();
  }
  void loop() {
    slave.process_image_updated(line.now);
    begin = line.now;
  }
  void to(Time since_loop) { run(begin + since_loop - line.now); }
  void send_target(std::int32_t target) {
    Bytes outputs(7);
    store(outputs.data() + 3, target);
    line.send(Command::lwr, 0x1000, outputs);
    if (slave.wants_poll(line.now)) slave.poll(line.now);
  }
  void expect_each_target_sampled() {
    const unsigned before = events.cycles;
    for (int target = 1; target < 10; ++target) {
      send_target(target);
      run(50us);
      EXPECT_EQ(objects.target_position, target);
    }
    EXPECT_EQ(events.cycles, before + 9);
  }
  std::int32_t input() { return load<std::int32_t>(&line.send(Command::lrd, 0x1100, Bytes(7)).data[3]); }

  Time begin{};
};

TEST_F(TooFast, ProcessDataAreDealtWithJustBeforeTheControlLoop) {
  learn_loop();
  const unsigned before = events.cycles;
  send_target(1);
  to(50us);
  EXPECT_EQ(events.cycles, before + 1);
  send_target(2);
  to(100us);
  EXPECT_EQ(objects.target_position, 2);
  for (int target = 3; target < 9; ++target) {
    send_target(target);
    EXPECT_FALSE(slave.wants_poll(line.now));
    run(49us);
    EXPECT_EQ(objects.target_position, 2);
    run(1us);
  }
  EXPECT_EQ(objects.target_position, 8);  // 400 us
  EXPECT_EQ(events.cycles, before + 3);
  objects.position_actual = 77;
  loop();
  EXPECT_EQ(input(), 77);
  // A message is processed immediately, and the waiting process data with it.
  send_target(9);
  to(100us);
  EXPECT_EQ(objects.target_position, 8);
  EXPECT_EQ(upload(0x607A, 0), (Bytes{9, 0, 0, 0}));
  EXPECT_EQ(events.cycles, before + 4);
  // Without a control loop this mode ends.
  to(400us);
  loop();
  to(100us);
  send_target(10);
  to(150us);
  EXPECT_EQ(objects.target_position, 10);
  EXPECT_EQ(events.cycles, before + 5);
}

TEST_F(TooFast, ThreeInAControlLoopOfThreeAreNot) {
  learn_loop();
  const unsigned before = events.cycles;
  for (int i = 0; i < 12; ++i) {  // each 150 us
    send_target(i);
    run(50us);
    EXPECT_EQ(objects.target_position, i);
    run(100us);
    if (i % 8 == 7) loop();
  }
  EXPECT_EQ(events.cycles, before + 12);
}

TEST_F(TooFast, WithoutAControlLoopThatIsKnownTheyAreSampledAsEver) { expect_each_target_sampled(); }

// In the mode "synchronous with the sync manager" the inputs stay those of the last frame if no more frames come,
// despite a message and a control loop.
TEST_F(TooFast, AMessageLeavesNoInputsBehind) {
  ASSERT_EQ(request(2), good(2));
  EXPECT_EQ(download(0x1C32, 1, 1, 2), AbortCode::none);
  set_process_data(7, 7);
  ASSERT_EQ(request(4), good(4));
  cycle();
  ASSERT_EQ(request(8), good(8));
  run(50us - line.now % 50us);
  learn_loop();
  for (int target = 1; target < 9; ++target) {
    send_target(target);
    run(50us);
  }
  objects.position_actual = 77;
  loop();
  EXPECT_EQ(input(), 77);
  to(100us);
  EXPECT_EQ(upload(0x607A, 0), (Bytes{8, 0, 0, 0}));
  objects.position_actual = 88;
  to(400us);
  loop();
  EXPECT_EQ(input(), 77);
}

TEST_F(TooFast, AControlLoopOfBeforeAPowerCycleIsNotKnown) {
  learn_loop();
  line.escs[0]->power_on(line.now);
  slave.start(line.now);
  to_operational();
  run(50us - line.now % 50us);
  expect_each_target_sampled();
}

TEST_F(ProcessData, ThatAreSampledDoNotDelayTheWatchdog) {
  to_operational();
  slave.sample_process_data_every(100us);
  cycle();
  run(99ms);
  EXPECT_EQ(status(), good(8));
  run(2ms);
  EXPECT_EQ(status(), (std::pair{0x14U, AlStatusCode::sync_manager_watchdog}));
}

// The checks that a bus with many slaves makes after every frame.
TEST_F(ProcessData, ThatWaitToBeSampledDoNotCallAgain) {
  const auto calls = [this] { return slave.wants_poll(line.now); };
  to_operational();
  slave.sample_process_data_every(100us);
  run(100us - line.now % 100us);
  cycle();
  EXPECT_FALSE(calls());
  EXPECT_EQ(slave.quiet_until(), line.now + 100us);
  run(60us);
  line.send(Command::lwr, 0x1000, Bytes(7));
  line.send(Command::lrd, 0x1100, Bytes(7));
  EXPECT_FALSE(calls());
  EXPECT_FALSE(slave.wants_poll(line.now + 39us));
  EXPECT_TRUE(slave.wants_poll(line.now + 40us));
  // A write to any register may bring a deadline forward, so the deadline is calculated again.
  line.put(0, reg::station_address, std::uint16_t{1});
  EXPECT_TRUE(calls());
  slave.poll(line.now);
  EXPECT_FALSE(calls());
  line.put(0, reg::al_control, std::uint16_t{4});
  EXPECT_TRUE(calls());
  slave.poll(line.now);
  EXPECT_FALSE(calls());
  EXPECT_EQ(status(), good(4));
  // After they are processed, new ones request a poll again.
  line.send(Command::lrd, 0x1100, Bytes(7));
  EXPECT_TRUE(calls());
  slave.poll(line.now);
  EXPECT_FALSE(calls());
  slave.sample_process_data_every(Time{0});
  EXPECT_TRUE(calls());
}

TEST_F(ProcessData, OutputsThatStartTheWatchdogCallBesideInputsThatWait) {
  to_safe_operational();
  line.put(0, reg::watchdog_divider, std::uint16_t{0});
  line.put(0, reg::watchdog_process_data, std::uint16_t{250});  // of 80 ns
  slave.sample_process_data_every(100us);
  run(100us - line.now % 100us);
  send(Command::lrd, 0x1100, Bytes(7));
  EXPECT_FALSE(slave.wants_poll(line.now));
  line.send(Command::lwr, 0x1000, Bytes(7));
  EXPECT_TRUE(slave.wants_poll(line.now));
  slave.poll(line.now);
  EXPECT_EQ(slave.quiet_until(), line.now + 20us);
}

// ---- Distributed clock ----

class Synchronous : public SlaveRig {
 protected:
  void start_sync(std::uint32_t cycle_ns) {
    start = line.escs[0]->clock().system_time(line.now) + 1'000'000;
    line.put<std::uint64_t>(0, reg::sync_start_time, start);
    line.put<std::uint32_t>(0, reg::sync0_cycle, cycle_ns);
    line.put<std::uint8_t>(0, reg::sync_activation, 3);
  }
  void to_synchronous_operation() {
    to_pre_operational();
    operate_with_sync0();
  }
  // From Pre-Operational.
  void operate_with_sync0() {
    set_process_data(7, 7);
    start_sync(1'000'000);
    ASSERT_EQ(request(4), good(4));
    cycle();
    request(8);
    EXPECT_EQ(status(), good(4));  // waits for SYNC0
    run(1500us);                   // half a cycle after the first pulse
    ASSERT_EQ(status(), good(8));
  }
  std::uint64_t start = 0;
};

TEST_F(Synchronous, OutputsActWithTheNextPulse) {
  to_synchronous_operation();
  EXPECT_EQ(upload(0x1C32, 1), (Bytes{2, 0}));
  EXPECT_EQ(upload(0x1C32, 2), bytes_of(1'000'000U));
  EXPECT_EQ(upload(0x1C33, 0x0A), bytes_of(1'000'000U));
  cycle(77);
  EXPECT_NE(objects.target_position, 77);
  run(1ms);
  EXPECT_EQ(objects.target_position, 77);
  EXPECT_EQ(cycle(78), (Bytes{0x0F, 0x80, 8, 78, 0, 0, 0}));  // sampled with the pulse
  for (int i = 0; i < 50; ++i) run(1ms), cycle(i);
  ASSERT_GT(events.sync_times.size(), 50U);
  // SYNC0 comes at its system time, without jitter.
  for (std::size_t i = 1; i < events.sync_times.size(); ++i) {
    EXPECT_EQ(events.sync_times[i] - events.sync_times[i - 1], 1ms);
  }
  EXPECT_EQ(upload(0x1C32, 0x0B), (Bytes{0, 0}));
}

// Without bit 5 of 0981h a start time in the past starts no pulses. The slave waits for pulses and reports that none
// arrive.
TEST_F(Synchronous, AStartTimeInThePastIsToldAsNoSync) {
  to_pre_operational();
  set_process_data(7, 7);
  line.put<std::uint64_t>(0, reg::sync_start_time, line.escs[0]->clock().system_time(line.now) - 1'000'000);
  line.put<std::uint32_t>(0, reg::sync0_cycle, 1'000'000);
  line.put<std::uint8_t>(0, reg::sync_activation, 3);
  ASSERT_EQ(request(4), good(4));
  EXPECT_EQ(upload(0x1C32, 1), (Bytes{2, 0}));
  cycle();
  request(8);
  EXPECT_EQ(status(), good(4));
  for (int i = 0; i < 12'000 && status() == good(4); ++i) run(1ms), cycle(i);
  EXPECT_EQ(status(), (std::pair{0x14U, AlStatusCode::no_sync}));
}

// 1C32h:03 and 1C33h:03, in ns behind SYNC0.
TEST_F(Synchronous, OutputsAndInputsAreShifted) {
  to_pre_operational();
  EXPECT_EQ(download(0x1C32, 3, 300'000, 4), AbortCode::none);
  EXPECT_EQ(download(0x1C33, 3, 500'000, 4), AbortCode::none);
  set_process_data(7, 7);
  start_sync(1'000'000);
  ASSERT_EQ(request(4), good(4));
  EXPECT_EQ(download(0x1C32, 3, 0, 4), AbortCode::device_state);  // 1C32h:03 is in use
  cycle();
  request(8);
  run(1900us);  // until 900 us behind a pulse
  ASSERT_EQ(status(), good(8));
  cycle(77);
  run(350us);  // 250 us behind the next one
  EXPECT_NE(objects.target_position, 77);
  run(100us);
  EXPECT_EQ(objects.target_position, 77);
  const auto inputs = [this] { return send(Command::lrd, 0x1100, Bytes(7)).data; };
  EXPECT_NE(inputs(), (Bytes{0x0F, 0x80, 8, 78, 0, 0, 0}));
  run(200us);
  EXPECT_EQ(inputs(), (Bytes{0x0F, 0x80, 8, 78, 0, 0, 0}));
}

TEST_F(Synchronous, AShiftBeyondTheNextPulseIsRefused) {
  to_pre_operational();
  EXPECT_EQ(download(0x1C33, 3, 1'000'000, 4), AbortCode::none);
  set_process_data(7, 7);
  start_sync(1'000'000);
  EXPECT_EQ(request(4), (std::pair{0x12U, AlStatusCode::invalid_dc_sync_configuration}));
  EXPECT_EQ(download(0x1C33, 3, 999'999, 4), AbortCode::none);
  EXPECT_EQ(request(0x14), good(4));
}

// 1C32h:08: bit 0 starts the measurement, bit 1 resets the counters.
TEST_F(Synchronous, TheShortestCycleIsMeasured) {
  to_pre_operational();
  EXPECT_EQ(download(0x1C32, 1, 1, 2), AbortCode::none);
  EXPECT_EQ(download(0x1C32, 2, 5'000'000, 4), AbortCode::none);
  set_process_data(7, 7);
  ASSERT_EQ(request(4), good(4));
  cycle();
  ASSERT_EQ(request(8), good(8));
  run(100us);
  cycle();
  EXPECT_EQ(upload(0x1C32, 2), bytes_of(5'000'000U));  // the written value stays until a measurement
  EXPECT_EQ(download(0x1C32, 8, 1, 2), AbortCode::none);
  Time last{};
  Time shortest = never;
  for (const Time span : {1000us, 900us, 1100us}) {
    run(span);
    if (last != Time{}) shortest = std::min(shortest, line.now - last);
    last = line.now;
    cycle();
  }
  EXPECT_EQ(upload(0x1C32, 2), bytes_of(static_cast<std::uint32_t>(shortest.count())));
  EXPECT_EQ(upload(0x1C33, 2), upload(0x1C32, 2));
  EXPECT_EQ(upload(0x1C33, 8), (Bytes{1, 0}));
  EXPECT_EQ(download(0x1C33, 8, 0, 2), AbortCode::none);
  EXPECT_EQ(upload(0x1C32, 8), (Bytes{0, 0}));
  run(10us);
  cycle();
  run(10us);
  cycle();
  EXPECT_EQ(upload(0x1C32, 2), bytes_of(static_cast<std::uint32_t>(shortest.count())));
}

TEST_F(Synchronous, TheCountersAreSetBack) {
  to_synchronous_operation();
  cycle();
  run(2ms);
  EXPECT_EQ(upload(0x1C32, 0x0B), (Bytes{1, 0}));
  EXPECT_EQ(download(0x1C32, 8, 1, 2), AbortCode::none);
  EXPECT_EQ(upload(0x1C32, 0x0B), (Bytes{1, 0})) << "bit 0 measures, and sets nothing back";
  EXPECT_EQ(download(0x1C32, 8, 2, 2), AbortCode::none);
  EXPECT_EQ(upload(0x1C32, 0x0B), (Bytes{0, 0}));
  EXPECT_EQ(upload(0x1C33, 0x0B), (Bytes{0, 0}));
}

// The mode that one master selects with its pulses does not apply to the next master.
TEST_F(Synchronous, TheNextMasterNeedsNoPulses) {
  to_synchronous_operation();
  EXPECT_EQ(upload(0x1C32, 1), (Bytes{2, 0}));
  EXPECT_EQ(request(2), good(2));
  line.put<std::uint8_t>(0, reg::sync_activation, 0);
  EXPECT_EQ(request(4), good(4));
  EXPECT_EQ(upload(0x1C32, 1), (Bytes{0, 0}));
  EXPECT_EQ(request(2), good(2));
  EXPECT_EQ(download(0x1C32, 1, 2, 2), AbortCode::none);  // this master requires pulses
  EXPECT_EQ(request(4), (std::pair{0x12U, AlStatusCode::invalid_dc_sync_configuration}));
  EXPECT_EQ(request(0x11), good(1));
  set_mailbox();
  EXPECT_EQ(request(2), good(2));
  EXPECT_EQ(upload(0x1C32, 1), (Bytes{0, 0}));
}

// A repeated request does not delay the answer.
TEST_F(Synchronous, AskingAgainDoesNotMakeTheWaitLonger) {
  to_pre_operational();
  set_process_data(7, 7);
  ASSERT_EQ(request(4), good(4));
  for (int i = 0; i < 4; ++i) {
    EXPECT_EQ(request(8), good(4));
    run(1400ms);
  }
  EXPECT_EQ(status(), (std::pair{0x14U, AlStatusCode::no_valid_outputs}));
}

TEST_F(Synchronous, MissedCyclesAreCountedAndForgiven) {
  to_synchronous_operation();
  cycle();
  run(1ms);
  run(1ms);  // without outputs: the counter is 3
  EXPECT_EQ(upload(0x1C32, 0x0B), (Bytes{1, 0}));
  EXPECT_EQ(status(), good(8));
  for (int i = 0; i < 3; ++i) cycle(), run(1ms);  // the counter is 0 again
  run(1ms);
  EXPECT_EQ(status(), good(8));
  run(1ms);  // 6 > 4
  EXPECT_EQ(status(), (std::pair{0x14U, AlStatusCode::synchronization_error}));
  EXPECT_EQ(upload(0x1C32, 0x20), Bytes{1});
}

// Outputs that were processed once do not count as a set-point of the next cycle.
TEST_F(Synchronous, ACycleWithoutOutputsBringsNone) {
  to_pre_operational();
  EXPECT_EQ(download(0x1600, 0, 0, 1), AbortCode::none);
  EXPECT_EQ(download(0x1600, 3, 0x20070010, 4), AbortCode::none);  // an object whose owner receives a callback
  EXPECT_EQ(download(0x1600, 4, 0x00000010, 4), AbortCode::none);
  EXPECT_EQ(download(0x1600, 0, 4, 1), AbortCode::none);
  operate_with_sync0();
  for (int i = 0; i < 3; ++i) cycle(7), run(1ms);
  const unsigned cycles = events.cycles;
  const std::size_t told = events.told.size();
  run(1ms);
  EXPECT_EQ(status(), good(8));
  EXPECT_EQ(events.cycles, cycles);
  EXPECT_EQ(events.told.size(), told);
  cycle(8), run(1ms);
  EXPECT_EQ(events.cycles, cycles + 1);
  EXPECT_EQ(events.told.size(), told + 1);
}

// 10F1h:01 = 0: the error is shown, and cleared after enough cycles with outputs.
TEST_F(Synchronous, TheSlaveMayStayWithSyncErrors) {
  to_pre_operational();
  EXPECT_EQ(upload(0x10F1, 1), bytes_of(1U));
  EXPECT_EQ(download(0x10F1, 1, 2, 4), AbortCode::value_invalid);
  EXPECT_EQ(download(0x10F1, 1, 0, 4), AbortCode::none);
  operate_with_sync0();
  cycle();
  run(1ms);
  EXPECT_EQ(upload(0x1C32, 0x20), Bytes{0});
  run(50ms);  // without outputs
  EXPECT_EQ(status(), good(8));
  EXPECT_EQ(upload(0x1C32, 0x20), Bytes{1});
  EXPECT_EQ(upload(0x1C33, 0x20), Bytes{1});
  EXPECT_EQ(upload(0x1C32, 0x0B), (Bytes{50, 0}));
  for (int i = 0; i < 2; ++i) cycle(), run(1ms);  // from 4 + 3 to 5
  EXPECT_EQ(upload(0x1C32, 0x20), Bytes{1});
  cycle(99), run(1ms);
  EXPECT_EQ(upload(0x1C32, 0x20), Bytes{0});
  EXPECT_EQ(objects.target_position, 99);
  // 10F1h:01 = 0 does not apply to missing pulses: they still end Operational.
  write(reg::sync_activation, {0});
  cycle();
  EXPECT_EQ(status(), (std::pair{0x14U, AlStatusCode::fatal_sync_error}));
}

// 1C32h:0C: two events of the sync manager closer than 1C32h:05, in Operational.
TEST_F(Synchronous, CyclesThatAreTooShortAreCounted) {
  to_pre_operational();
  EXPECT_EQ(download(0x1C32, 1, 1, 2), AbortCode::none);
  set_process_data(7, 7);
  ASSERT_EQ(request(4), good(4));
  cycle();
  run(10us);
  cycle();
  ASSERT_EQ(request(8), good(8));
  for (const Time span : {1000us, 200us, 126us}) run(span), cycle();
  EXPECT_EQ(upload(0x1C32, 0x0C), (Bytes{0, 0}));
  for (int i = 0; i < 3; ++i) run(10us), cycle(i);
  EXPECT_EQ(upload(0x1C32, 0x0C), (Bytes{3, 0}));
  EXPECT_EQ(upload(0x1C33, 0x0C), (Bytes{0, 0}));
  EXPECT_EQ(objects.target_position, 2);  // they are still processed
  EXPECT_EQ(download(0x1C32, 8, 2, 2), AbortCode::none);
  EXPECT_EQ(upload(0x1C32, 0x0C), (Bytes{0, 0}));
}

// 1C33h:0D: the frame passed between SYNC0 and the time at which the inputs are sampled (1C33h:03).
TEST_F(Synchronous, FramesBeforeTheShiftedInputsAreCounted) {
  to_pre_operational();
  EXPECT_EQ(download(0x1C33, 3, 600'000, 4), AbortCode::none);
  set_process_data(7, 7);
  start_sync(1'000'000);
  ASSERT_EQ(request(4), good(4));
  cycle();
  request(8);
  run(1800us);  // 800 us behind a pulse
  ASSERT_EQ(status(), good(8));
  cycle();
  run(1ms);
  cycle();
  EXPECT_EQ(upload(0x1C33, 0x0D), (Bytes{0, 0}));
  run(500us);  // 300 us behind a pulse
  cycle();
  run(1ms);
  cycle();
  EXPECT_EQ(upload(0x1C33, 0x0D), (Bytes{2, 0}));
  EXPECT_EQ(upload(0x1C32, 0x0D), (Bytes{0, 0}));
  EXPECT_EQ(status(), good(8));
  EXPECT_EQ(download(0x1C33, 8, 2, 2), AbortCode::none);
  EXPECT_EQ(upload(0x1C33, 0x0D), (Bytes{0, 0}));
}

TEST_F(Synchronous, TheLimitIs10F1h) {
  to_pre_operational();
  EXPECT_EQ(download(0x10F1, 2, 30, 2), AbortCode::none);
  set_process_data(7, 7);
  start_sync(1'000'000);
  request(4);
  cycle();
  request(8);
  run(1500us);
  ASSERT_EQ(status(), good(8));
  run(11ms);  // the first cycle is tolerated; ten missed cycles give 30, which does not exceed 30
  EXPECT_EQ(status(), good(8));
  run(1ms);
  EXPECT_EQ(status(), (std::pair{0x14U, AlStatusCode::synchronization_error}));
}

// A master starts SYNC0 and passes the control of the pulses to the application (0980h): the next master cannot stop
// them.
TEST_F(Synchronous, PulsesThatWereGivenAwayEndWithInit) {
  line.put<std::uint64_t>(0, reg::sync_start_time, line.escs[0]->clock().system_time(line.now) + 3'600'000'000'000);
  line.put<std::uint32_t>(0, reg::sync0_cycle, 1'000'000);
  line.put<std::uint8_t>(0, reg::sync_activation, 3);
  line.put<std::uint8_t>(0, reg::cyclic_unit_control, 1);
  EXPECT_EQ(line.write(0, reg::sync_activation, {0}).counter, 0U);
  EXPECT_EQ(request(0x11), good(1));
  EXPECT_EQ(line.get<std::uint8_t>(0, reg::sync_activation), 0);
  to_operational();
}

TEST_F(Synchronous, PulsesThatEnd) {
  to_synchronous_operation();
  write(reg::sync_activation, {0});
  cycle();
  EXPECT_EQ(status(), (std::pair{0x14U, AlStatusCode::fatal_sync_error}));
}

TEST_F(Synchronous, PulsesThatNeverCome) {
  to_pre_operational();
  set_process_data(7, 7);
  start_sync(1'000'000);
  line.put<std::uint8_t>(0, reg::sync_activation, 0);
  line.put<std::uint64_t>(0, reg::sync_start_time, start + 60'000'000'000);
  line.put<std::uint8_t>(0, reg::sync_activation, 3);
  request(4);
  request(8);
  for (int i = 0; i < 51; ++i) cycle(), run(100ms);
  EXPECT_EQ(status(), (std::pair{0x14U, AlStatusCode::no_sync}));
}

TEST_F(Synchronous, SettingsThatDoNotFit) {
  to_pre_operational();
  set_process_data(7, 7);
  EXPECT_EQ(download(0x1C32, 1, 2, 2), AbortCode::none);  // DC, and no pulses
  EXPECT_EQ(request(4), (std::pair{0x12U, AlStatusCode::invalid_dc_sync_configuration}));
  start_sync(100'000);  // below the minimum cycle
  EXPECT_EQ(request(0x14), (std::pair{0x12U, AlStatusCode::invalid_sync0_cycle_time}));
  profile.synchronisation = sync_support::free_run;
  EXPECT_EQ(request(0x14), (std::pair{0x12U, AlStatusCode::synchronization_not_supported}));
}

}  // namespace
}  // namespace ethercat_process_data_test
}  // namespace servodrome::ethercat::test
