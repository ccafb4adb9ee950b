#include <set>
#include <string>

#include "slave_rig.hpp"

// Changes of state, their checks and their AL status codes (ETG.1000.6 clause 6.4, ETG.1020 table 11).
namespace servodrome::ethercat::test {
namespace ethercat_state_machine_test {
namespace {

class StateMachine : public SlaveRig {};

TEST_F(StateMachine, UpAndDownAgain) {
  EXPECT_EQ(status(), good(1));
  to_operational();
  EXPECT_EQ(request(4), good(4));
  EXPECT_EQ(request(2), good(2));
  EXPECT_EQ(request(4), good(4));
  EXPECT_EQ(request(1), good(1));
  const auto p = AlState::pre_operational, s = AlState::safe_operational;
  EXPECT_EQ(events.changes.size(), 7U);
  EXPECT_EQ(events.changes[5], (Change{p, s, AlStatusCode::none}));
}

TEST_F(StateMachine, ChangesThatDoNotExist) {
  using C = AlStatusCode;
  const auto acknowledge = [this](unsigned state) { EXPECT_EQ(request(0x10 | state), good(state)); };
  for (const unsigned to : {4U, 8U}) {
    EXPECT_EQ(request(to), (std::pair{0x11U, C::invalid_requested_state_change}));
    acknowledge(1);
  }
  for (const unsigned to : {0U, 5U, 6U, 7U, 9U, 15U}) {
    EXPECT_EQ(request(to), (std::pair{0x11U, C::unknown_requested_state})) << to;
    acknowledge(1);
  }
  EXPECT_EQ(request(3), (std::pair{0x11U, C::bootstrap_not_supported}));
  acknowledge(1);
  to_pre_operational();
  for (const unsigned to : {3U, 8U}) {
    EXPECT_EQ(request(to), (std::pair{0x12U, C::invalid_requested_state_change}));
    acknowledge(2);
  }
}

TEST_F(StateMachine, AnErrorStandsUntilAcknowledged) {
  EXPECT_EQ(request(4).first, 0x11U);
  set_mailbox();
  EXPECT_EQ(request(2), (std::pair{0x11U, AlStatusCode::invalid_requested_state_change}));  // ignored
  EXPECT_EQ(request(0x12), good(2));  // acknowledge and state change in one request
}

// Init is accepted without an acknowledgement, because every master starts with it.
TEST_F(StateMachine, InitNeedsNoAcknowledgement) {
  to_operational();
  run(200ms);
  EXPECT_EQ(status(), (std::pair{0x14U, AlStatusCode::sync_manager_watchdog}));
  EXPECT_EQ(request(2), (std::pair{0x14U, AlStatusCode::sync_manager_watchdog}));
  EXPECT_EQ(request(1), good(1));
  EXPECT_EQ(request(8), (std::pair{0x11U, AlStatusCode::invalid_requested_state_change}));
  EXPECT_EQ(request(1), good(1));
}

TEST_F(StateMachine, MailboxChecks) {
  const auto refused = std::pair{0x11U, AlStatusCode::invalid_mailbox_configuration};
  struct Case {
    const char* name;
    unsigned start0, length0, control0, start1, length1, control1;
  };
  for (const Case& one : {Case{"swapped", 0x1000, 128, 0x22, 0x1100, 128, 0x26},
                          {"start 0", 0x1010, 128, 0x26, 0x1100, 128, 0x22},
                          {"start 1", 0x1000, 128, 0x26, 0x1180, 128, 0x22},
                          {"short", 0x1000, 33, 0x26, 0x1100, 128, 0x22},
                          {"long", 0x1000, 128, 0x26, 0x1100, 257, 0x22},
                          {"buffered", 0x1000, 128, 0x24, 0x1100, 128, 0x22}}) {
    line.send(Command::bwr, address_of(0, reg::sync_manager), Bytes(64));
    line.set_sync_manager(0, 0, one.start0, one.length0, one.control0);
    line.set_sync_manager(0, 1, one.start1, one.length1, one.control1);
    EXPECT_EQ(request(0x12), refused) << one.name;
  }
  line.send(Command::bwr, address_of(0, reg::sync_manager), Bytes(64));
  line.set_sync_manager(0, 0, 0x1000, 128, 0x26);
  EXPECT_EQ(request(0x12), refused);  // with only one of them
  line.set_sync_manager(0, 1, 0x1100, 34, 0x22);
  EXPECT_EQ(request(0x12), good(2));
}

TEST_F(StateMachine, LosingTheMailboxEndsInInit) {
  to_pre_operational();
  write(0x0806, {0});
  EXPECT_EQ(status(), (std::pair{0x11U, AlStatusCode::invalid_mailbox_configuration}));
}

TEST_F(StateMachine, ProcessDataChecks) {
  using C = AlStatusCode;
  struct Case {
    const char* name;
    unsigned start2, length2, control2, start3, length3, control3;
    C code;
  };
  to_pre_operational();
  for (const Case& one : {Case{"outputs short", 0x1200, 6, 0x64, 0x1500, 7, 0x20, C::invalid_output_configuration},
                          {"outputs elsewhere", 0x1240, 7, 0x64, 0x1500, 7, 0x20, C::invalid_output_configuration},
                          {"outputs mailbox", 0x1200, 7, 0x26, 0x1500, 7, 0x20, C::invalid_output_configuration},
                          {"outputs read", 0x1200, 7, 0x20, 0x1500, 7, 0x20, C::invalid_output_configuration},
                          {"inputs long", 0x1200, 7, 0x64, 0x1500, 8, 0x20, C::invalid_input_configuration},
                          {"inputs elsewhere", 0x1200, 7, 0x64, 0x1400, 7, 0x20, C::invalid_input_configuration},
                          {"inputs written", 0x1200, 7, 0x64, 0x1500, 7, 0x24, C::invalid_input_configuration},
                          {"good", 0x1200, 7, 0x64, 0x1500, 7, 0x20, C::none}}) {
    line.send(Command::bwr, address_of(0, 0x0810), Bytes(16));
    line.set_sync_manager(0, 2, one.start2, one.length2, one.control2);
    line.set_sync_manager(0, 3, one.start3, one.length3, one.control3);
    EXPECT_EQ(request(0x14), (std::pair{one.code == C::none ? 4U : 0x12U, one.code})) << one.name;
  }
}

TEST_F(StateMachine, AChannelItHasNoUseForIsRefused) {
  to_pre_operational();
  set_process_data(7, 7);
  line.set_sync_manager(0, 7, 0x1800, 4, 0x24);
  EXPECT_EQ(request(4), (std::pair{0x12U, AlStatusCode::invalid_sync_manager_configuration}));
  line.send(Command::bwr, address_of(0, reg::sync_manager + 7 * 8), Bytes(8));
  EXPECT_EQ(request(0x14), good(4));
}

TEST_F(StateMachine, MappingsThatCannotBeServed) {
  to_pre_operational();
  set_process_data(7, 7);
  objects.communication.rx_mapping[0].entry[1] = 0x60410010;  // not an output; as if from a damaged store
  EXPECT_EQ(request(4), (std::pair{0x12U, AlStatusCode::invalid_output_mapping}));
  objects.communication.rx_mapping[0].entry[1] = 0x60600008;
  objects.communication.tx_assignment.pdo[0] = 0x1A77;
  EXPECT_EQ(request(0x14), (std::pair{0x12U, AlStatusCode::invalid_input_mapping}));
}

TEST_F(StateMachine, OperationalWaitsForOutputs) {
  to_safe_operational();
  EXPECT_EQ(request(8), good(4));
  run(4s);
  EXPECT_EQ(status(), good(4));
  cycle();
  EXPECT_EQ(status(), good(8));
}

TEST_F(StateMachine, OperationalIsRefusedWithoutOutputs) {
  to_safe_operational();
  request(8);
  run(5s);
  EXPECT_EQ(status(), (std::pair{0x14U, AlStatusCode::no_valid_outputs}));
}

TEST_F(StateMachine, WatchdogEndsOperation) {
  to_operational();
  run(99ms);
  EXPECT_EQ(status(), good(8));
  cycle();
  run(100ms);
  EXPECT_EQ(status(), (std::pair{0x14U, AlStatusCode::sync_manager_watchdog}));
  EXPECT_EQ(events.changes.back(),
            (Change{AlState::operational, AlState::safe_operational, AlStatusCode::sync_manager_watchdog}));
  cycle();  // the request has no effect before the acknowledgement
  EXPECT_EQ(request(0x18), good(4));
  cycle();
  EXPECT_EQ(status(), good(8));
}

TEST_F(StateMachine, OutputsThatStoppedComingAreNone) {
  to_operational();
  run(100ms);
  EXPECT_EQ(line.get<std::uint16_t>(0, reg::watchdog_status), 0);  // expired until outputs come
  EXPECT_EQ(request(0x18), good(4));
  run(1s);
  EXPECT_EQ(status(), good(4));
  cycle();
  EXPECT_EQ(status(), good(8));
  EXPECT_EQ(line.get<std::uint16_t>(0, reg::watchdog_status), 1);
}

TEST_F(StateMachine, WatchdogSwitchedOff) {
  line.put<std::uint16_t>(0, reg::watchdog_process_data, 0);
  to_operational();
  run(10s);
  EXPECT_EQ(status(), good(8));
}

TEST_F(StateMachine, LosingASyncManagerEndsInPreOperational) {
  to_operational();
  write(0x0816, {0});
  EXPECT_EQ(status(), (std::pair{0x12U, AlStatusCode::invalid_output_configuration}));
}

// Disabled, changed and enabled again in one frame: the checks of the change to Safe-Operational also apply in the
// higher states.
TEST_F(StateMachine, AChannelThatIsMadeAnotherOneEndsInPreOperational) {
  using C = AlStatusCode;
  struct Case {
    const char* name;
    unsigned channel;
    unsigned start, length, control;
    C code;  // none: the change succeeds
  };
  for (const Case& one : {Case{"outputs short", 2, 0x1200, 6, 0x64, C::invalid_output_configuration},
                          {"outputs long", 2, 0x1200, 8, 0x64, C::invalid_output_configuration},
                          {"outputs elsewhere", 2, 0x1240, 7, 0x64, C::invalid_output_configuration},
                          {"outputs mailbox", 2, 0x1200, 7, 0x26, C::invalid_output_configuration},
                          {"outputs read", 2, 0x1200, 7, 0x20, C::invalid_output_configuration},
                          {"inputs short", 3, 0x1500, 6, 0x20, C::invalid_input_configuration},
                          {"inputs written", 3, 0x1500, 7, 0x24, C::invalid_input_configuration},
                          {"another one", 4, 0x1800, 4, 0x24, C::invalid_sync_manager_configuration},
                          {"outputs the same", 2, 0x1200, 7, 0x64, C::none}}) {
    line.send(Command::bwr, address_of(0, reg::sync_manager), Bytes(64));
    slave.poll(line.now);
    request(0x11);
    to_operational();
    std::array<std::uint8_t, max_frame> memory;
    FrameWriter writer = FrameWriter::ethernet(memory);
    const auto at = static_cast<std::uint16_t>(reg::sync_manager + 8 * one.channel);
    writer.add(Command::apwr, 0, address_of(0, at + 6), 1);
    const Bytes settings = words({one.start, one.length, one.control, 1});
    const auto place = writer.add(Command::apwr, 0, address_of(0, at), settings.size());
    std::copy(settings.begin(), settings.end(), place.begin());
    line.segment->process(writer.bytes(), line.now);
    slave.poll(line.now);
    EXPECT_EQ(status(), one.code == C::none ? good(8) : std::pair(0x12U, one.code)) << one.name;
    if (one.code != C::none) continue;
    cycle(77);
    EXPECT_EQ(objects.target_position, 77);
  }
}

TEST_F(StateMachine, TheDeviceMayRefuse) {
  events.refused = AlState::safe_operational;
  events.refusal = AlStatusCode::inconsistent_settings;
  to_pre_operational();
  set_process_data(7, 7);
  EXPECT_EQ(request(4), (std::pair{0x12U, AlStatusCode::inconsistent_settings}));
}

TEST_F(StateMachine, TheDeviceMayFallBack) {
  to_operational();
  slave.fall_back(AlState::safe_operational, AlStatusCode::no_valid_inputs, line.now);
  EXPECT_EQ(status(), (std::pair{0x14U, AlStatusCode::no_valid_inputs}));
}

// An error within the present state is shown and acknowledged like any other, without a change of state.
TEST_F(StateMachine, AFallBackWithinTheStateIsAnError) {
  to_safe_operational();
  cycle();
  EXPECT_NE(send(Command::lwr, 0x1000, Bytes(7)).counter, 0U);
  const std::size_t changes = events.changes.size();
  slave.fall_back(AlState::safe_operational, AlStatusCode::fatal_sync_error, line.now);
  EXPECT_EQ(status(), (std::pair{0x14U, AlStatusCode::fatal_sync_error}));
  EXPECT_EQ(events.changes.size(), changes);
  EXPECT_EQ(send(Command::lwr, 0x1000, Bytes(7)).counter, 0U) << "outputs are not taken before it is acknowledged";
  EXPECT_EQ(request(0x14), good(4));
  EXPECT_NE(send(Command::lwr, 0x1000, Bytes(7)).counter, 0U);
}

TEST_F(StateMachine, ResetOverTheBus) {
  to_operational();
  for (const char letter : {'R', 'E', 'S'}) write(reg::reset_ecat, bytes_of(letter));
  EXPECT_EQ(status(), good(1));
  EXPECT_EQ(events.changes.back(), (Change{AlState::operational, AlState::init, AlStatusCode::none}));
  to_operational();
}

TEST_F(StateMachine, SpoiltSiiKeepsItInInit) {
  line.sii[0][14] ^= 1;
  line.escs[0]->power_on(line.now);
  slave.start(line.now);
  set_mailbox();
  EXPECT_EQ(request(2), (std::pair{0x11U, AlStatusCode::eeprom_error}));
}

TEST_F(StateMachine, IdentificationRequest) {
  EXPECT_EQ(request(0x21), (std::pair{0x21U, static_cast<AlStatusCode>(0x1234)}));
  EXPECT_EQ(request(0x01), good(1));
}

class BootingSlave : public SlaveRig {
 protected:
  static Profile boots() {
    Profile profile;
    profile.bootstrap = true;
    profile.bootstrap_out = {0x1000, 64, 1024};
    profile.bootstrap_in = {0x1400, 64, 1024};
    return profile;
  }
  BootingSlave() : SlaveRig(boots()) {}
};

TEST_F(BootingSlave, Bootstrap) {
  set_mailbox();
  EXPECT_EQ(request(3), (std::pair{0x11U, AlStatusCode::invalid_mailbox_configuration_bootstrap}));
  write(0x0806, {0}), write(0x080E, {0});
  line.set_sync_manager(0, 0, 0x1000, 1024, 0x26);
  line.set_sync_manager(0, 1, 0x1400, 1024, 0x22);
  EXPECT_EQ(request(0x13), good(3));
  EXPECT_EQ(request(2), (std::pair{0x13U, AlStatusCode::invalid_requested_state_change}));
  EXPECT_EQ(request(0x11), good(1));
}

// The numbers of ETG.1020 table 11; the texts have the meaning of the table's.
TEST(AlStatusCodes, HaveTheStandardsNumbersAndWords) {
  struct Row {
    std::uint16_t code;
    const char* word;
  };
  std::set<std::string> texts;
  for (const auto& [code, word] : std::to_array<Row>({
           {0x0000, "no error"},
           {0x0001, "unspecified"},
           {0x0002, "no memory"},
           {0x0003, "device setup"},
           {0x0004, "revision"},
           {0x0006, "SII"},
           {0x0007, "firmware update"},
           {0x000E, "license"},
           {0x0011, "invalid requested state"},
           {0x0012, "unknown requested state"},
           {0x0013, "bootstrap not supported"},
           {0x0014, "no valid firmware"},
           {0x0015, "(bootstrap)"},
           {0x0016, "mailbox configuration"},
           {0x0017, "sync manager configuration"},
           {0x0018, "no valid inputs"},
           {0x0019, "no valid outputs"},
           {0x001A, "synchronization error"},
           {0x001B, "sync manager watchdog"},
           {0x001C, "sync manager types"},
           {0x001D, "output configuration"},
           {0x001E, "input configuration"},
           {0x001F, "watchdog configuration"},
           {0x0020, "cold start"},
           {0x0021, "needs Init"},
           {0x0022, "needs Pre-Operational"},
           {0x0023, "needs Safe-Operational"},
           {0x0024, "input mapping"},
           {0x0025, "output mapping"},
           {0x0026, "inconsistent settings"},
           {0x0027, "free run not supported"},
           {0x0028, "synchronization not supported"},
           {0x0029, "three-buffer"},
           {0x002A, "background watchdog"},
           {0x002B, "inputs and outputs"},
           {0x002C, "fatal"},
           {0x002D, "no synchronization"},
           {0x002E, "FMMU"},
           {0x0030, "DC SYNC configuration"},
           {0x0031, "latch"},
           {0x0032, "PLL"},
           {0x0033, "IO error"},
           {0x0034, "timeout"},
           {0x0035, "SYNC cycle time"},
           {0x0036, "SYNC0"},
           {0x0037, "SYNC1"},
           {0x0041, "AoE"},
           {0x0042, "EoE"},
           {0x0043, "CoE"},
           {0x0044, "FoE"},
           {0x0045, "SoE"},
           {0x004F, "VoE"},
           {0x0050, "EEPROM no access"},
           {0x0051, "EEPROM error"},
           {0x0052, "hardware not ready"},
           {0x0060, "restarted locally"},
           {0x0061, "identification"},
           {0x0070, "module ident list"},
           {0x0080, "voltage too low"},
           {0x0081, "voltage too high"},
           {0x0082, "temperature too low"},
           {0x0083, "temperature too high"},
           {0x00F0, "application controller"},
       })) {
    const char* said = text(AlStatusCode{code});
    ASSERT_NE(said, nullptr) << std::hex << code;
    EXPECT_NE(std::string(said).find(word), std::string::npos) << std::hex << code << " is \"" << said << '"';
    EXPECT_TRUE(texts.insert(said).second) << said << " is said of two codes";
  }
  EXPECT_STREQ(text(AlStatusCode{0x7FFF}), "unknown AL status code");
}

// ETG.1000.6 clause 6.4.1.
TEST(AlStates, HaveTheStandardsNumbersAndNames) {
  EXPECT_STREQ(text(AlState{1}), "Init");
  EXPECT_STREQ(text(AlState{2}), "Pre-Operational");
  EXPECT_STREQ(text(AlState{3}), "Bootstrap");
  EXPECT_STREQ(text(AlState{4}), "Safe-Operational");
  EXPECT_STREQ(text(AlState{8}), "Operational");
  EXPECT_STREQ(text(AlState{5}), "unknown state");
}

}  // namespace
}  // namespace ethercat_state_machine_test
}  // namespace servodrome::ethercat::test
