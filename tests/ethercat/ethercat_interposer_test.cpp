#include "slave_rig.hpp"

// A slave that misbehaves on purpose: refusals, mailbox messages, SYNC0, inputs, spontaneous changes of state, SII.
namespace servodrome::ethercat::test {
namespace ethercat_interposer_test {
namespace {

struct Meddler final : SlaveInterposer {
  std::optional<AlStatusCode> refuses(AlState, AlState to) override {
    asked.push_back(to);
    return to == refused && refusal != AlStatusCode::none ? std::optional(refusal) : std::nullopt;
  }
  Dispatch sends(Mail& mail) override {
    if (on_send) on_send(mail);
    const auto bytes =
        mail.mailbox.first(std::min(mail.length, mail.mailbox.size()));  // tests may set a length that is too great
    sent.emplace_back(bytes.begin(), bytes.end());
    return std::exchange(dispatch, {});
  }
  Receipt receives(std::span<std::uint8_t> mailbox) override {
    ++received;
    if (on_receive) on_receive(mailbox);
    return receipt;
  }
  Pulse sync0(Time) override {
    ++pulses;
    return pulse;
  }
  bool keeps_inputs(Time) override { return stale; }

  AlState refused{};
  AlStatusCode refusal = AlStatusCode::none;
  std::vector<AlState> asked;
  Dispatch dispatch;  // for the next message
  std::function<void(Mail&)> on_send;
  std::vector<Bytes> sent;
  Receipt receipt = Receipt::serve;
  std::function<void(std::span<std::uint8_t>)> on_receive;
  unsigned received = 0;
  Pulse pulse;
  unsigned pulses = 0;
  bool stale = false;
};

using Sending = SlaveInterposer::Sending;
using Receipt = SlaveInterposer::Receipt;

class Interposed : public SlaveRig {
 protected:
  explicit Interposed(const Profile& rules = {}) : SlaveRig(rules) { slave.interpose(&meddler); }
  Meddler meddler;
};

// ---- State changes ----

TEST_F(Interposed, RefusesAnyChangeWithItsCode) {
  meddler.refusal = AlStatusCode::needs_cold_start;
  meddler.refused = AlState::pre_operational;
  set_mailbox();
  EXPECT_EQ(request(2), (std::pair{0x11U, AlStatusCode::needs_cold_start}));
  meddler.refused = AlState::safe_operational;
  EXPECT_EQ(request(0x12), good(2));  // the request acknowledges the error too
  set_process_data(7, 7);
  EXPECT_EQ(request(4), (std::pair{0x12U, AlStatusCode::needs_cold_start}));
  meddler.refused = AlState::operational;
  EXPECT_EQ(request(0x14), good(4));
  cycle();
  EXPECT_EQ(request(8), (std::pair{0x14U, AlStatusCode::needs_cold_start}));
  meddler.refused = AlState::init;
  EXPECT_EQ(request(1), (std::pair{0x14U, AlStatusCode::needs_cold_start}));
  slave.interpose(nullptr);
  EXPECT_EQ(request(1), good(1));
}

TEST_F(Interposed, IsAskedAfterTheStacksOwnChecks) {
  EXPECT_EQ(request(2), (std::pair{0x11U, AlStatusCode::invalid_mailbox_configuration}));
  EXPECT_EQ(request(0x18), (std::pair{0x11U, AlStatusCode::invalid_requested_state_change}));
  EXPECT_TRUE(meddler.asked.empty());
  EXPECT_EQ(request(0x11), good(1));
  to_operational();
  EXPECT_EQ(meddler.asked, (std::vector{AlState::pre_operational, AlState::safe_operational, AlState::operational}));
}

// ---- Mailbox, to the master ----

class InterposedMail : public Interposed {
 protected:
  void SetUp() override { to_pre_operational(); }
  void ask(std::uint16_t index = 0x1000, unsigned sub = 0) {
    post(3, join({words({0x2000}), head(0x40, index, sub), bytes_of(std::uint32_t{0})}));
  }
  static std::uint32_t value(const Bytes& mail) { return mail.size() == 16 ? load_u32(&mail[12]) : 0; }
  static unsigned counter(const Bytes& mail) { return mail.empty() ? 0 : mail[5] >> 4; }
  static constexpr std::uint32_t device_type = 0x00020192;
  static constexpr std::uint32_t vendor = 0x66668888;
};

TEST_F(InterposedMail, AWithheldAnswerIsSentForTheSlaveOnly) {
  meddler.dispatch = {Sending::withhold};
  ask();
  EXPECT_TRUE(fetch().empty());
  ask(0x1018, 1);
  const Bytes next = fetch();
  EXPECT_EQ(value(next), vendor);
  EXPECT_EQ(counter(next), 2U);  // the slave counted the first
  // A repeat request returns the message that the master read last.
  write(0x080E, {0x03});
  EXPECT_EQ(fetch(), next);
}

TEST_F(InterposedMail, AHeldAnswerWaitsAndTheOthersBehindIt) {
  meddler.dispatch = {Sending::hold};
  ask();
  EXPECT_TRUE(fetch().empty());
  ask(0x1018, 1);
  slave.emergency(0x3210, 0x05, {});
  run(1s);
  EXPECT_TRUE(fetch().empty());
  EXPECT_EQ(meddler.sent.size(), 1U);
  slave.release_mail();
  EXPECT_EQ(value(fetch()), device_type);
  EXPECT_EQ(load_u16(&fetch()[8]), 0x3210);
  EXPECT_EQ(value(fetch()), vendor);
  EXPECT_TRUE(fetch().empty());
  slave.release_mail();  // no message is held
  EXPECT_TRUE(fetch().empty());
}

TEST_F(InterposedMail, InitForgetsAHeldAnswer) {
  meddler.dispatch = {Sending::hold};
  ask();
  EXPECT_EQ(request(1), good(1));
  slave.release_mail();
  EXPECT_EQ(request(2), good(2));
  slave.release_mail();
  EXPECT_TRUE(fetch().empty());
  ask();
  EXPECT_EQ(value(fetch()), device_type);
}

TEST_F(InterposedMail, ARepeatRequestDoesNotFreeAHeldAnswer) {
  ask();
  const Bytes first = fetch();
  meddler.dispatch = {Sending::hold};
  ask(0x1018, 1);
  write(0x080E, {0x03});
  EXPECT_EQ(fetch(), first);
  EXPECT_TRUE(fetch().empty());
  write(0x080E, {0x01});
  slave.release_mail();  // the repeated message is still in the mailbox
  EXPECT_EQ(fetch(), first);
  EXPECT_EQ(value(fetch()), vendor);
}

TEST_F(InterposedMail, BytesAndLengthAreChangedInPlace) {
  meddler.on_send = [](SlaveInterposer::Mail& mail) {
    EXPECT_EQ(mail.mailbox.size(), mailbox_size);
    EXPECT_EQ(mail.length, 16U);
    mail.mailbox[12] = 0x55;
    mail.mailbox[16] = 0x66;
    store_u16(mail.mailbox.data(), 11);
    mail.length = 17;
  };
  ask();
  const Bytes mail = fetch();
  ASSERT_EQ(mail.size(), 17U);
  EXPECT_EQ(mail[12], 0x55);
  EXPECT_EQ(mail[16], 0x66);
  // A length beyond the mailbox is cut to it.
  meddler.on_send = [](SlaveInterposer::Mail& longer) { longer.length = 10000; };
  ask();
  EXPECT_EQ(value(fetch()), device_type);
}

TEST_F(InterposedMail, ACopyFollowsWhenTheMasterHasReadTheMessage) {
  meddler.dispatch = {Sending::pass, 2};
  ask();
  ask(0x1018, 1);
  const Bytes first = fetch();
  EXPECT_EQ(value(first), device_type);
  EXPECT_EQ(fetch(), first);
  EXPECT_EQ(fetch(), first);
  EXPECT_EQ(value(fetch()), vendor);
  EXPECT_TRUE(fetch().empty());
  EXPECT_EQ(meddler.sent.size(), 2U);  // the copies do not count as messages
}

TEST_F(InterposedMail, AHeldMessageMayHaveCopiesToo) {
  meddler.dispatch = {Sending::hold, 1};
  ask();
  slave.release_mail();
  const Bytes first = fetch();
  EXPECT_EQ(value(first), device_type);
  EXPECT_EQ(fetch(), first);
  EXPECT_TRUE(fetch().empty());
}

TEST_F(InterposedMail, PostsAMessageThatTheSlaveDidNotMake) {
  const Bytes emergency{10, 0, 0, 0, 0, 0x73, 0x00, 0x10, 0x10, 0x32, 0x05, 1, 2, 3, 4, 5};
  EXPECT_TRUE(slave.post(emergency, false));
  EXPECT_FALSE(slave.post(emergency, false));  // the mailbox is full
  EXPECT_EQ(fetch(), emergency);
  EXPECT_TRUE(fetch().empty());
  EXPECT_TRUE(slave.post(emergency));
  EXPECT_EQ(counter(fetch()), 1U);
  ask();
  EXPECT_FALSE(slave.post(emergency));
  const Bytes answer = fetch();
  EXPECT_EQ(counter(answer), 2U);
  EXPECT_TRUE(slave.post(emergency));
  EXPECT_FALSE(fetch().empty());
  write(0x080E, {0x03});
  EXPECT_EQ(fetch(), answer);  // a posted message is not repeated
}

TEST_F(InterposedMail, PostsOnlyWhatFitsIntoAnActiveMailbox) {
  EXPECT_FALSE(slave.post(Bytes(5)));
  EXPECT_FALSE(slave.post(Bytes(mailbox_size + 1)));
  EXPECT_TRUE(slave.post(Bytes(mailbox_size)));
  EXPECT_EQ(fetch().size(), 6U);
  request(1);
  EXPECT_FALSE(slave.post(Bytes(6)));
}

TEST_F(InterposedMail, APostedMessageComesBeforeAHeldOne) {
  meddler.dispatch = {Sending::hold};
  ask();
  EXPECT_TRUE(slave.post(Bytes{2, 0, 0, 0, 0, 0, 1, 0}));
  slave.release_mail();
  EXPECT_EQ(fetch()[5] & 0x0F, 0);
  EXPECT_EQ(value(fetch()), device_type);
  EXPECT_TRUE(fetch().empty());
}

TEST_F(InterposedMail, PostsFromItsOwnCallsBeforeTheAnswer) {
  for (const bool on_receive : {false, true}) {
    const auto post_one = [this] { EXPECT_TRUE(slave.post(Bytes{2, 0, 0, 0, 0, 0, 1, 0})); };
    if (on_receive) {
      meddler.on_receive = [&](auto) { post_one(); };
    } else {
      meddler.on_send = [&](auto&) { post_one(); };
    }
    ask();
    EXPECT_EQ(fetch()[5] & 0x0F, 0) << on_receive;
    meddler.on_receive = {};
    meddler.on_send = {};
    EXPECT_EQ(value(fetch()), device_type) << on_receive;
    EXPECT_TRUE(fetch().empty()) << on_receive;
  }
}

// ---- Mailbox, from the master ----

TEST_F(InterposedMail, TheSlaveServesTheChangedRequest) {
  meddler.on_receive = [](std::span<std::uint8_t> mailbox) {
    EXPECT_EQ(mailbox.size(), mailbox_size);
    store_u16(&mailbox[9], 0x1018);  // in place of 1000h
    mailbox[11] = 1;
  };
  ask();
  EXPECT_EQ(value(fetch()), vendor);
}

TEST_F(InterposedMail, ADiscardedRequestLeavesTheMailboxEmpty) {
  meddler.receipt = Receipt::discard;
  post(3, join({words({0x2000}), head(0x2B, 0x2006, 0), {5, 0, 0, 0}}), 3);
  EXPECT_EQ(objects.ranged, 7);
  EXPECT_TRUE(fetch().empty());
  EXPECT_EQ(line.get<std::uint8_t>(0, 0x0805) & 0x08, 0);
  // The slave treats it as already executed, because the same counter means the same message.
  meddler.receipt = Receipt::serve;
  post(3, join({words({0x2000}), head(0x2B, 0x2006, 0), {5, 0, 0, 0}}), 3);
  EXPECT_TRUE(fetch().empty());
  post(3, join({words({0x2000}), head(0x2B, 0x2006, 0), {5, 0, 0, 0}}), 4);
  EXPECT_FALSE(fetch().empty());
  EXPECT_EQ(objects.ranged, 5);
}

TEST_F(InterposedMail, AKeptRequestLeavesTheMailboxFull) {
  meddler.receipt = Receipt::keep;
  ask();
  run(1s);
  EXPECT_TRUE(fetch().empty());
  EXPECT_EQ(line.get<std::uint8_t>(0, 0x0805) & 0x08, 0x08);
  EXPECT_EQ(write(0x1000, Bytes(mailbox_size)).counter, 0U);
  slave.release_mail();
  EXPECT_TRUE(fetch().empty());
  meddler.receipt = Receipt::serve;
  slave.release_mail();
  EXPECT_EQ(value(fetch()), device_type);
  EXPECT_EQ(line.get<std::uint8_t>(0, 0x0805) & 0x08, 0);
}

TEST_F(InterposedMail, InitEmptiesAFullMailbox) {
  meddler.receipt = Receipt::keep;
  ask();
  request(1);
  slave.interpose(nullptr);
  write(0x0806, {0}), write(0x080E, {0});
  set_mailbox();
  EXPECT_EQ(request(2), good(2));
  ask();
  EXPECT_EQ(value(fetch()), device_type);
}

// ---- SYNC0 ----

class InterposedSync : public Interposed {
 protected:
  void SetUp() override {
    to_pre_operational();
    set_process_data(7, 7);
    start = line.escs[0]->clock().system_time(line.now) + 1'000'000;
    line.put<std::uint64_t>(0, reg::sync_start_time, start);
    line.put<std::uint32_t>(0, reg::sync0_cycle, 1'000'000);
    line.put<std::uint8_t>(0, reg::sync_activation, 3);
    ASSERT_EQ(request(4), good(4));
  }
  void operate() {
    cycle();
    request(8);
    run(1500us);  // half a cycle after the first pulse
    ASSERT_EQ(status(), good(8));
    events.sync_times.clear();
  }
  unsigned missed() { return load_u16(upload(0x1C32, 0x0B).data()); }
  std::uint64_t start = 0;
};

TEST_F(InterposedSync, AMissingPulseMovesNothingButTheNextOne) {
  operate();
  cycle(5);
  meddler.pulse.times = 0;
  run(1ms);
  EXPECT_NE(objects.target_position, 5);
  EXPECT_TRUE(events.sync_times.empty());
  meddler.pulse.times = 1;
  cycle(6);
  run(1ms);
  EXPECT_EQ(objects.target_position, 6);
  EXPECT_EQ(events.sync_times.size(), 1U);
  EXPECT_EQ(missed(), 0U);
  EXPECT_EQ(status(), good(8));
}

TEST_F(InterposedSync, MissingPulsesEndInFatalSyncError) {
  operate();
  meddler.pulse.times = 0;
  run(1ms);
  cycle();  // 1.5 cycles after the last pulse
  EXPECT_EQ(status(), good(8));
  run(1ms);
  EXPECT_EQ(status(), good(8));
  cycle();
  EXPECT_EQ(status(), (std::pair{0x14U, AlStatusCode::fatal_sync_error}));
  meddler.pulse.times = 1;
  request(0x14);
  run(1ms);
  cycle();
  request(8);
  run(1ms);
  EXPECT_EQ(status(), good(8));
}

TEST_F(InterposedSync, WithoutAnyPulseOperationalIsRefused) {
  meddler.pulse.times = 0;
  cycle();
  request(8);
  for (int i = 0; i < 1000 && status() == good(4); ++i) run(10ms), cycle();
  EXPECT_EQ(status(), (std::pair{0x14U, AlStatusCode::no_sync}));
}

TEST_F(InterposedSync, ADoubledPulseIsACycleWithoutOutputs) {
  operate();
  cycle(5);
  meddler.pulse.times = 2;
  run(1ms);
  EXPECT_EQ(objects.target_position, 5);
  ASSERT_EQ(events.sync_times.size(), 2U);
  EXPECT_EQ(events.sync_times[0], events.sync_times[1]);
  EXPECT_EQ(missed(), 1U);  // 10F1h counts it
  for (int i = 0; i < 20 && status() == good(8); ++i) cycle(), run(1ms);
  EXPECT_EQ(status(), (std::pair{0x14U, AlStatusCode::synchronization_error}));
}

TEST_F(InterposedSync, ALatePulseActsLater) {
  operate();
  cycle(5);
  meddler.pulse.delay = 200us;
  run(500us + 199us);
  EXPECT_NE(objects.target_position, 5);
  run(1us);
  EXPECT_EQ(objects.target_position, 5);
  ASSERT_EQ(events.sync_times.size(), 1U);
  EXPECT_EQ(events.sync_times[0], line.now);
  // A frame between the pulse and its late effect is processed one cycle too early.
  run(850us);
  EXPECT_EQ(meddler.pulses, 3U);
  cycle(6);
  run(150us);
  EXPECT_EQ(objects.target_position, 6);
  EXPECT_EQ(status(), good(8));
}

TEST_F(InterposedSync, APulseLaterThanTheNextOneReplacesIt) {
  operate();
  meddler.pulse.delay = 1500us;
  for (int i = 0; i < 10; ++i) cycle(), run(1ms);
  // Every second pulse comes while a delayed one is still pending.
  EXPECT_EQ(events.sync_times.size(), 5U);
  EXPECT_EQ(status(), good(8));
  for (std::size_t i = 1; i < events.sync_times.size(); ++i) {
    EXPECT_EQ(events.sync_times[i] - events.sync_times[i - 1], 2ms);
  }
}

TEST_F(InterposedSync, ALatePulseDoesNotOutliveTheState) {
  operate();
  meddler.pulse.delay = 400us;
  cycle();
  run(600us);
  EXPECT_EQ(request(2), good(2));
  EXPECT_EQ(slave.next_deadline(line.now) > line.now + 300us, true);
  run(1ms);
  EXPECT_TRUE(events.sync_times.empty());
}

// ---- A clock with a fault ----

TEST_F(InterposedSync, AClockThatStandsEndsInFatalSyncError) {
  operate();
  line.escs[0]->stop_clock(true, line.now);
  EXPECT_GT(slave.next_deadline(line.now), line.now + 10ms);
  for (int i = 0; i < 3; ++i) run(1ms), cycle();
  EXPECT_EQ(status(), (std::pair{0x14U, AlStatusCode::fatal_sync_error}));
  EXPECT_TRUE(events.sync_times.empty());
  line.escs[0]->stop_clock(false, line.now);
  request(0x14);
  run(1ms);
  cycle();
  request(8);
  run(1ms);
  EXPECT_EQ(status(), good(8));
}

TEST_F(InterposedSync, AJumpForwardsGivesOnePulseAtOnce) {
  operate();
  cycle(5);
  slave.next_deadline(line.now);
  line.escs[0]->jump_clock(100ms, line.now);
  EXPECT_LE(slave.quiet_until(), line.now);
  run(1us);
  EXPECT_EQ(events.sync_times.size(), 1U);
  EXPECT_EQ(objects.target_position, 5);
  run(1ms);
  EXPECT_EQ(events.sync_times.size(), 2U);
  EXPECT_EQ(status(), good(8));
}

TEST_F(InterposedSync, AJumpBackwardsDelaysThePulses) {
  operate();
  line.escs[0]->jump_clock(-1500us, line.now);
  run(1999us);
  EXPECT_TRUE(events.sync_times.empty());
  run(1us);
  EXPECT_EQ(events.sync_times.size(), 1U);
  line.escs[0]->jump_clock(-1h, line.now);
  for (int i = 0; i < 3; ++i) run(1ms), cycle();
  EXPECT_EQ(status(), (std::pair{0x14U, AlStatusCode::fatal_sync_error}));
}

// ---- Inputs ----

TEST_F(Interposed, StaleInputsCountInTheWorkingCounter) {
  to_operational();
  const auto inputs = [this] { return send(Command::lrd, 0x1100, Bytes(7)); };
  const Bytes before = cycle(5);
  meddler.stale = true;
  EXPECT_EQ(cycle(6), before);
  EXPECT_EQ(inputs().counter, 1U);
  EXPECT_EQ(objects.target_position, 6);  // the outputs act
  meddler.stale = false;
  EXPECT_EQ(cycle(7), (Bytes{0x0F, 0x80, 8, 8, 0, 0, 0}));
}

TEST_F(Interposed, TheFirstInputsAreNeverStale) {
  meddler.stale = true;
  to_safe_operational();
  EXPECT_EQ(send(Command::lrd, 0x1100, Bytes(7)).counter, 1U);
}

// ---- Spontaneous changes of state ----

class Falling : public Interposed {
 protected:
  void go_to(AlState state) {
    switch (state) {
      case AlState::pre_operational: to_pre_operational(); break;
      case AlState::safe_operational: to_safe_operational(); break;
      case AlState::operational: to_operational(); break;
      default: break;
    }
  }
  // Like a master: acknowledge, then go up again, with unchanged settings.
  void bring_back(AlState from) {
    const auto value = static_cast<unsigned>(from);
    ASSERT_EQ(request(0x10 | value), good(value));
    if (from == AlState::init) {
      ASSERT_EQ(request(2), good(2));
    }
    if (from < AlState::safe_operational) {
      set_process_data(7, 7);
      ASSERT_EQ(request(4), good(4));
    }
    if (from < AlState::operational) {
      cycle();
      ASSERT_EQ(request(8), good(8));
    }
    EXPECT_EQ(cycle(41), (Bytes{0x0F, 0x80, 8, 42, 0, 0, 0}));
    EXPECT_EQ(upload(0x1000, 0), bytes_of(0x00020192U));
  }
};

TEST_F(Falling, FromEachStateToEachLowerOneWithAnyCode) {
  using enum AlState;
  const std::array states{init, pre_operational, safe_operational, operational};
  const std::array codes{AlStatusCode::unspecified, AlStatusCode::sync_manager_watchdog,
                         AlStatusCode::restarted_locally, static_cast<AlStatusCode>(0x8001)};
  for (const AlState from : states) {
    for (const AlState to : states) {
      if (to > from) continue;
      for (const AlStatusCode code : codes) {
        SCOPED_TRACE(testing::Message() << text(from) << " to " << text(to) << " with " << static_cast<unsigned>(code));
        ASSERT_EQ(request(0x11), good(1));
        write(0x0806, {0}), write(0x080E, {0}), write(0x0816, {0}), write(0x081E, {0});
        set_mailbox();
        go_to(from);
        ASSERT_EQ(status(), good(static_cast<unsigned>(from)));
        events.changes.clear();
        ASSERT_TRUE(slave.fall_back(to, code, line.now));
        EXPECT_EQ(status(), (std::pair{0x10U | static_cast<unsigned>(to), code}));
        EXPECT_EQ(events.changes.size(), from == to ? 0U : 1U);
        for (const Change& change : events.changes) EXPECT_EQ(change, (Change{from, to, code}));
        if (from >= safe_operational) {
          EXPECT_EQ(send(Command::lwr, 0x1000, Bytes(7)).counter, to == operational ? 1U : 0U);
        }
        run(10ms);  // no deadline of the previous state is left
        EXPECT_EQ(slave.state(), to);
        bring_back(to);
      }
    }
  }
}

TEST_F(Falling, NeverUpwards) {
  using enum AlState;
  for (const AlState to : {pre_operational, bootstrap, safe_operational, operational}) {
    EXPECT_FALSE(slave.fall_back(to, AlStatusCode::unspecified, line.now));
  }
  EXPECT_EQ(status(), good(1));
  to_pre_operational();
  for (const AlState to : {bootstrap, safe_operational, operational}) {
    EXPECT_FALSE(slave.fall_back(to, AlStatusCode::unspecified, line.now));
  }
  EXPECT_EQ(status(), good(2));
  EXPECT_TRUE(events.changes.size() == 1U);
}

TEST_F(Falling, OnTheWayToOperationalTheWaitEnds) {
  to_safe_operational();
  request(8);
  EXPECT_EQ(status(), good(4));  // waits for outputs
  slave.fall_back(AlState::pre_operational, AlStatusCode::unspecified, line.now);
  run(10s);
  EXPECT_EQ(status(), (std::pair{0x12U, AlStatusCode::unspecified}));
  bring_back(AlState::pre_operational);
}

class FallingBoot : public Interposed {
 protected:
  static Profile boots() {
    Profile profile;
    profile.bootstrap = true;
    profile.bootstrap_out = {0x1000, 64, 1024};
    profile.bootstrap_in = {0x1100, 64, 1024};
    return profile;
  }
  FallingBoot() : Interposed(boots()) {}
};

TEST_F(FallingBoot, FromBootstrapToInitOnly) {
  set_mailbox();
  ASSERT_EQ(request(3), good(3));
  EXPECT_FALSE(slave.fall_back(AlState::pre_operational, AlStatusCode::unspecified, line.now));
  EXPECT_EQ(status(), good(3));
  EXPECT_TRUE(slave.fall_back(AlState::init, AlStatusCode::firmware_update_failed, line.now));
  EXPECT_EQ(status(), (std::pair{0x11U, AlStatusCode::firmware_update_failed}));
  EXPECT_EQ(request(0x11), good(1));
  EXPECT_EQ(request(2), good(2));
}

// ---- Slave information ----

class PatchedSii : public Interposed {
 protected:
  std::span<std::uint8_t> image() { return line.escs[0]->sii().memory(); }
  std::uint32_t word(std::uint16_t address) {
    write(reg::sii_control, words({0x0100, address, 0}));
    run(1ms);
    return line.get<std::uint16_t>(0, reg::sii_data);
  }
  void power_cycle() {
    line.escs[0]->power_on(line.now);
    slave.start(line.now);
  }
};

TEST_F(PatchedSii, AMasterReadsTheNewBytesAtOnce) {
  to_operational();
  EXPECT_EQ(word(8), 0U);
  store_u16(&image()[16], 0xBEEF);  // the vendor's low word
  EXPECT_EQ(word(8), 0xBEEFU);
  EXPECT_EQ(status(), good(8));
  power_cycle();
  EXPECT_EQ(word(8), 0xBEEFU);
}

TEST_F(PatchedSii, TheChecksumIsNotRepaired) {
  image()[8] ^= 1;  // the alias, one of the 14 bytes that it covers
  set_mailbox();
  EXPECT_EQ(request(2), good(2));  // the controller loaded the image earlier
  power_cycle();
  set_mailbox();
  EXPECT_EQ(request(2), (std::pair{0x11U, AlStatusCode::eeprom_error}));
  image()[14] = sii_checksum(image().first(14));
  power_cycle();
  set_mailbox();
  EXPECT_EQ(request(2), good(2));
}

}  // namespace
}  // namespace ethercat_interposer_test
}  // namespace servodrome::ethercat::test
