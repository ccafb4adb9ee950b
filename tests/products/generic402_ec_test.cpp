#include "products/generic402/generic402_ec.hpp"

#include <cmath>
#include <set>

#include "dictionary/failing_medium.hpp"
#include "foe_rig.hpp"
#include "products/generic402/generic402.hpp"

// The reference drive on EtherCAT: its dictionary, its memory, its parameter file, and motion over process data.
namespace servodrome::test {
namespace generic402_ec_test {
namespace {

using dictionary::AbortCode;
using products::Generic402;
using products::Generic402Ec;
using products::ParameterFile;

struct Memory {
  std::array<std::byte, 16384> bytes{};
  dictionary::RamMedium medium{bytes};
};

struct Bus : private Memory, FoeRig<Generic402Ec> {
  // 1600h and 1A00h.
  struct Out {
    static constexpr std::size_t controlword = 0, position = 2, velocity = 6, torque = 10, mode = 12;
  };
  struct In {
    static constexpr std::size_t statusword = 0, position = 2, velocity = 6, torque = 10, mode = 12;
  };

  explicit Bus(bool with_memory = true) : FoeRig(default_plant(), settings(with_memory ? &medium : nullptr)) {}
  static products::Settings settings(dictionary::Medium* store) {
    products::Settings settings;
    settings.serial_number = 4711;
    settings.store = store;
    return settings;
  }

  // `sync0_ns` 0: synchronous with the sync manager's event.
  void connect(std::uint32_t sync0_ns = 0) {
    to_pre_operational();
    if (sync0_ns != 0) start_sync0(sync0_ns);
    set_process_data();
    ASSERT_EQ(request(4), good(4));
    run_cycles(20, 1);
    write(ethercat::reg::al_control, little_endian(std::uint16_t{8}));
    run_cycles(20, 1);
    ASSERT_EQ(al_status(), good(8));
  }
  void enable(std::int8_t mode) {
    put<std::int8_t>(Out::mode, mode);
    put<std::int32_t>(Out::position, input<std::int32_t>(In::position));
    for (const std::uint16_t word : std::to_array<std::uint16_t>({0x06, 0x07, 0x0F})) {
      put<std::uint16_t>(Out::controlword, word);
      run_cycles(word == 0x07 ? 200 : 5, 1);
    }
    ASSERT_EQ(status() & 0x6FU, 0x27U);
    ASSERT_EQ(input<std::int8_t>(In::mode), mode);
  }
  std::uint16_t status() const { return input<std::uint16_t>(In::statusword); }
  std::int32_t position() const { return input<std::int32_t>(In::position); }
  std::int32_t velocity() const { return input<std::int32_t>(In::velocity); }
  void power_cycle() {
    plant.sample(feedback);
    device.power_on(feedback, now());
  }
};

bool is_communication(const dictionary::Entry& entry) { return entry.index < 0x2000; }

TEST(Generic402EcDictionary, IsThatOfTheCanVariant) {
  // It has no node-ID, bit rate and RS485 port.
  const std::set<std::uint16_t> can_only{0x2F00, 0x2F01, 0x2F20};
  std::vector<const dictionary::Entry*> can, ethercat;
  for (const auto& entry : Generic402::table) {
    if (!is_communication(entry) && can_only.count(entry.index) == 0) can.push_back(&entry);
  }
  for (const auto& entry : Generic402Ec::table) {
    if (!is_communication(entry)) ethercat.push_back(&entry);
  }
  ASSERT_EQ(can.size(), ethercat.size());
  for (std::size_t i = 0; i < can.size(); ++i) {
    const dictionary::Entry &a = *can[i], &b = *ethercat[i];
    ASSERT_EQ(a.key(), b.key());
    EXPECT_STREQ(a.name, b.name) << std::hex << a.index;
    EXPECT_STREQ(a.unit, b.unit);
    EXPECT_EQ(std::tie(a.code, a.type, a.access, a.pdo, a.saved, a.has_range),
              std::tie(b.code, b.type, b.access, b.pdo, b.saved, b.has_range))
        << std::hex << a.index;
    EXPECT_EQ(std::tie(a.minimum, a.maximum, a.default_value), std::tie(b.minimum, b.maximum, b.default_value))
        << std::hex << a.index;
  }
}

TEST(Generic402EcMemory, HoldsWhatTheSlaveIs) {
  Bus bus;
  std::vector<std::uint8_t> image(Generic402Ec::sii_bytes);
  products::Settings settings;
  settings.serial_number = 4711;
  ASSERT_GT(ethercat::write_sii_image(Generic402Ec::sii_description(settings), Generic402Ec::ethercat_profile,
                                      Generic402Ec::table, image),
            0U);
  for (std::uint32_t word = 0; word < image.size() / 2; word += 4) {
    bus.write(ethercat::reg::sii_control, little_endian(std::uint16_t{0x0100}, word));
    bus.run_ms(1);
    ASSERT_EQ(bus.read(ethercat::reg::sii_data, 8), Bytes(image.begin() + word * 2, image.begin() + word * 2 + 8))
        << word;
  }
  EXPECT_EQ(bus.get(0x1018, 4), 4711);
}

// ---- Modes over process data ----

class Modes : public testing::TestWithParam<std::uint32_t> {
 protected:
  void start(std::int8_t mode) {
    bus.connect(GetParam());
    bus.enable(mode);
  }
  Bus bus;
};
INSTANTIATE_TEST_SUITE_P(Synchronisation, Modes, testing::Values(0U, 1'000'000U),
                         [](const auto& one) { return one.param == 0 ? "SyncManager" : "Sync0"; });

TEST_P(Modes, CyclicSynchronousPosition) {
  start(8);
  const std::int32_t begin = bus.position();
  std::int32_t worst = 0;
  bus.run_cycles(1000, 1, [&](int i) {
    // 20000 increments there, as a half wave.
    const double phase = std::min(i, 800) / 800.0 * 3.14159265;
    bus.put<std::int32_t>(Bus::Out::position, begin + static_cast<std::int32_t>(10000 * (1 - std::cos(phase))));
    worst =
        std::max(worst, std::abs(bus.position() - (begin + static_cast<std::int32_t>(10000 * (1 - std::cos(phase))))));
  });
  EXPECT_NEAR(bus.position(), begin + 20000, 20);
  EXPECT_LT(worst, 300);                     // of up to 39 increments a cycle, some cycles late
  EXPECT_EQ(bus.status() & 0x1000, 0x1000);  // the drive follows the command
}

TEST_P(Modes, CyclicSynchronousVelocity) {
  start(9);
  bus.run_cycles(500, 1, [&](int i) { bus.put<std::int32_t>(Bus::Out::velocity, std::min(i * 500, 50000)); });
  EXPECT_NEAR(bus.velocity(), 50000, 2000);  // one increment of the encoder in a tick is 16000/s
}

TEST_P(Modes, CyclicSynchronousTorque) {
  start(10);
  bus.put<std::int16_t>(Bus::Out::torque, 50);  // 5 % of rated
  bus.run_cycles(50, 1);
  EXPECT_NEAR(bus.input<std::int16_t>(Bus::In::torque), 50, 5);
  EXPECT_GT(bus.velocity(), 1000);
}

TEST_P(Modes, ProfilePosition) {
  start(1);
  bus.set(0x6081, 0, 200000);
  bus.set(0x6083, 0, 2000000);
  bus.set(0x6084, 0, 2000000);
  const std::int32_t target = bus.position() + 30000;
  bus.put<std::int32_t>(Bus::Out::position, target);
  bus.put<std::uint16_t>(Bus::Out::controlword, 0x1F);
  bus.run_cycles(3, 1);
  EXPECT_EQ(bus.status() & 0x1000, 0x1000);  // set-point acknowledged
  bus.put<std::uint16_t>(Bus::Out::controlword, 0x0F);
  bus.run_cycles(600, 1);
  EXPECT_NEAR(bus.position(), target, 20);
  EXPECT_EQ(bus.status() & 0x0400, 0x0400);
}

TEST_P(Modes, ProfileVelocity) {
  start(3);
  bus.set(0x6083, 0, 1000000);
  bus.put<std::int32_t>(Bus::Out::velocity, -40000);
  bus.run_cycles(500, 1);
  // One value has a resolution of only a few counts, so takes the mean of some.
  constexpr int cycles = 200;
  double sum = 0.0;
  for (int i = 0; i < cycles; ++i) {
    bus.run_cycles(1, 1);
    sum += bus.velocity();
  }
  EXPECT_NEAR(sum / cycles, -40000.0, 400.0);
}

TEST_P(Modes, ProfileTorque) {
  start(4);
  bus.set(0x6087, 0, 10000);
  bus.put<std::int16_t>(Bus::Out::torque, -50);
  bus.run_cycles(100, 1);
  EXPECT_NEAR(bus.input<std::int16_t>(Bus::In::torque), -50, 5);
  EXPECT_LT(bus.velocity(), -1000);
}

TEST_P(Modes, Velocity) {
  bus.to_pre_operational();
  ASSERT_EQ(bus.download(0x1601, 0, 0, 1), AbortCode::none);
  ASSERT_EQ(bus.download(0x1601, 1, 0x60420010, 4), AbortCode::none);
  ASSERT_EQ(bus.download(0x1601, 0, 1, 1), AbortCode::none);
  ASSERT_EQ(bus.download(0x1C12, 0, 0, 1), AbortCode::none);
  ASSERT_EQ(bus.download(0x1C12, 1, 0x1600, 2), AbortCode::none);
  ASSERT_EQ(bus.download(0x1C12, 2, 0x1601, 2), AbortCode::none);
  ASSERT_EQ(bus.download(0x1C12, 0, 2, 1), AbortCode::none);
  start(2);
  bus.put<std::int16_t>(14, 300);  // rpm
  bus.put<std::uint16_t>(Bus::Out::controlword, 0x7F);
  bus.run_cycles(1500, 1);
  const double wanted = 300.0 / 60.0 * bus.plant.parameters().encoder.counts_per_revolution;
  EXPECT_NEAR(bus.velocity(), wanted, 0.02 * wanted);
}

TEST_P(Modes, Homing) {
  start(6);
  bus.set(0x6098, 0, 34);  // to the index in the positive direction
  bus.put<std::uint16_t>(Bus::Out::controlword, 0x1F);
  bus.run_cycles(8000, 1);
  EXPECT_EQ(bus.status() & 0x3400, 0x1400);
  EXPECT_NEAR(bus.position(), 0, 50);
}

TEST(Generic402EcClock, SetsTheInterpolationPeriod) {
  for (const auto& [cycle_ns, value, power] :
       {std::tuple{1'000'000U, 1, -3}, {2'000'000U, 2, -3}, {250'000U, 25, -5}, {500'000U, 5, -4}}) {
    Bus bus;
    bus.to_pre_operational();
    bus.start_sync0(cycle_ns);
    bus.to_safe_operational();
    EXPECT_EQ(bus.get(0x60C2, 1), value) << cycle_ns;
    EXPECT_EQ(bus.get(0x60C2, 2), power) << cycle_ns;
    EXPECT_EQ(bus.get(0x1C32, 0x0A), cycle_ns);
  }
  Bus bus;
  bus.set(0x60C2, 1, 4);
  bus.to_operational();
  EXPECT_EQ(bus.get(0x60C2, 1), 4);  // no SYNC0: the master sets it
}

// The period is read only on the way up: a later value of the master stays when it goes back to Safe-Operational.
TEST(Generic402EcClock, KeepsTheInterpolationPeriodOnTheWayDown) {
  Bus bus;
  bus.connect(1'000'000);
  ASSERT_EQ(bus.get(0x60C2, 1), 1);
  bus.set(0x60C2, 1, 4);
  ASSERT_EQ(bus.request(4), Bus::good(4));
  EXPECT_EQ(bus.get(0x60C2, 1), 4);
  EXPECT_EQ(bus.get(0x60C2, 2), -3);
}

// ---- Stored parameters ----

TEST(Generic402EcStore, OnCommand) {
  Bus bus;
  bus.to_pre_operational();
  EXPECT_EQ(bus.upload(0x1010, 1), 1U);
  EXPECT_EQ(bus.download(0x2011, 2, 77, 2), AbortCode::none);
  EXPECT_EQ(bus.download(0x1010, 1, 0x12345678, 4), AbortCode::cannot_transfer_or_store);
  bus.power_cycle();
  EXPECT_EQ(bus.get(0x2011, 2), 100);
  bus.to_pre_operational();
  bus.download(0x2011, 2, 77, 2);
  EXPECT_EQ(bus.download(0x1010, 1, 0x65766173, 4), AbortCode::none);
  bus.power_cycle();
  EXPECT_EQ(bus.get(0x2011, 2), 77);
  bus.to_pre_operational();
  EXPECT_EQ(bus.download(0x1011, 4, 0x64616F6C, 4), AbortCode::none);
  EXPECT_EQ(bus.get(0x2011, 2), 77);  // until the next start
  bus.power_cycle();
  EXPECT_EQ(bus.get(0x2011, 2), 100);
  Bus without(false);
  without.to_pre_operational();
  EXPECT_EQ(without.download(0x1010, 1, 0x65766173, 4), AbortCode::hardware_error);
}

class Files : public testing::Test {
 protected:
  static constexpr const char* name = "parameters.txt";
  static constexpr const char* head = "# servodrome parameters 1\n0x1018:01=0x53455256\n0x1018:02=0x34303245\n";

  void SetUp() override { bus.to_pre_operational(); }
  static std::string with(std::string lines) { return head + lines; }
  Bus bus;
};

TEST_F(Files, HoldsEveryStoredObject) {
  bus.set(0x2011, 2, 123);
  bus.set(0x6065, 0, 54321);
  const std::string text = bus.receive(name);
  EXPECT_EQ(text.substr(0, std::strlen(head)), head);
  EXPECT_NE(text.find("\n0x2011:02=123\n"), std::string::npos);
  EXPECT_NE(text.find("\n0x6065:00=54321\n"), std::string::npos);
  EXPECT_NE(text.find("\n0x60C2:02=-3\n"), std::string::npos);
  std::size_t lines = static_cast<std::size_t>(std::count(text.begin(), text.end(), '\n'));
  std::size_t stored = 0;
  for (const auto& entry : Generic402Ec::table) stored += entry.saved && entry.writable() ? 1U : 0U;
  EXPECT_EQ(lines, stored + 3);
  EXPECT_EQ(text.find("0x6040"), std::string::npos);
}

TEST_F(Files, GoesFromOneDriveToAnother) {
  bus.set(0x2011, 2, 123);
  bus.set(0x6098, 0, 17);
  const dictionary::Entry* user_data = bus.device.dictionary().find(0x2F10, 0);
  const std::string words(1000, 'u');
  ASSERT_EQ(bus.device.dictionary().write(*user_data, std::as_bytes(std::span(words))), AbortCode::none);
  const std::string text = bus.receive(name);
  Bus other;
  other.to_pre_operational();
  EXPECT_EQ(other.transmit(name, text), "");
  EXPECT_EQ(other.receive(name), text);
  EXPECT_EQ(other.get(0x2011, 2), 123);
  other.power_cycle();  // it is stored
  other.to_pre_operational();
  EXPECT_EQ(other.receive(name), text);
}

TEST_F(Files, NamesWhatItChanges) {
  bus.set(0x2020, 1, 55);
  EXPECT_EQ(bus.transmit(name, with("# a comment\r\n\r\n0x2011:02=0x50\r\n0x6098:00=-1")), "");
  EXPECT_EQ(bus.get(0x2011, 2), 0x50);
  EXPECT_EQ(bus.get(0x6098), -1);
  EXPECT_EQ(bus.get(0x2020, 1), 55);
}

TEST_F(Files, OfEveryLengthAroundAPacket) {
  for (std::size_t length = 2 * bus.packet - 1; length <= 2 * bus.packet + 1; ++length) {
    std::string text = with("0x2011:02=99\n");
    text += "#" + std::string(length - text.size() - 2, 'x') + "\n";
    ASSERT_EQ(text.size(), length);
    bus.set(0x2011, 2, 100);
    EXPECT_EQ(bus.transmit(name, text), "") << length;
    EXPECT_EQ(bus.get(0x2011, 2), 99) << length;
  }
}

TEST_F(Files, RefusedAsAWholeWithAReason) {
  const std::string before = bus.receive(name);
  struct Case {
    std::string text, error;
  };
  const Case cases[] = {
      {"0x2011:02=99\n", "!8004 line 1: not a parameter file"},
      {"", "!8004 does not say of which vendor and product it is"},
      {"# servodrome parameters 1\n0x2011:02=99\n", "!8004 does not say of which vendor and product it is"},
      {"# servodrome parameters 1\n0x1018:01=1\n", "!8004 line 2: of another product"},
      {with("0x2011:02=99\n0x2011:02\n"), "!8004 line 5: not INDEX:SUB=VALUE of this object"},
      {with("0x2011:02=99\n0x2011:02=ten\n"), "!8004 line 5: not INDEX:SUB=VALUE of this object"},
      {with("0x2011:02=99\n0x2011:02=65536\n"), "!8004 line 5: not INDEX:SUB=VALUE of this object"},
      {with("0x2011:02=99\n0x2011:02= 5\n"), "!8004 line 5: not INDEX:SUB=VALUE of this object"},
      {with("0x2011:02=99\n0x2F10:00=ABC\n"), "!8004 line 5: not INDEX:SUB=VALUE of this object"},
      {with("0x2011:02=99\n0x2999:00=1\n"), "!8004 line 5: no such object"},
      {with("0x2011:02=99\n0x6040:00=1\n"), "!8004 line 5: not a stored object"},
      {with("0x2011:02=99\n0x6041:00=1\n"), "!8004 line 5: not a stored object"},
      {with("0x2011:01=99\n0x2011:02=501\n"),
       std::string("!8004 line 5: ") + dictionary::text(AbortCode::value_too_high)},
      {std::string(ParameterFile::capacity + 1, '#'), "!8003 the file is too long"},
  };
  for (const Case& one : cases) {
    EXPECT_EQ(bus.transmit(name, one.text), one.error);
    EXPECT_EQ(bus.receive(name), before) << one.error;
  }
  EXPECT_EQ(bus.receive("firmware.efw"), "!8001 the only file is parameters.txt");
  EXPECT_EQ(bus.transmit("firmware.efw", ""), "!8001 the only file is parameters.txt");
}

// Each of the two units is possible alone, so the whole file passes the check of its lines; together they are refused.
TEST_F(Files, AConflictOfTwoLinesUndoesAll) {
  const std::string words(500, 'u');
  const dictionary::Entry* user_data = bus.device.dictionary().find(0x2F10, 0);
  ASSERT_EQ(bus.device.dictionary().write(*user_data, std::as_bytes(std::span(words))), AbortCode::none);
  const std::string before = bus.receive(name);
  const std::string lines = "0x6083:00=4711\n0x2F10:00=AB\n0x6083:00=4712\n0x6091:01=16000\n0x608F:01=262144\n";
  EXPECT_EQ(bus.transmit(name, with(lines)),
            std::string("!8004 line 8: ") + dictionary::text(AbortCode::parameter_incompatible));
  EXPECT_EQ(bus.receive(name), before);
  EXPECT_EQ(bus.transmit(name, with("0x608F:01=262144\n")), "") << "the drive uses the old values";
}

TEST_F(Files, NotWhileTheMotorHasPower) {
  bus.set_process_data();
  ASSERT_EQ(bus.request(4), bus.good(4));
  bus.run_cycles(20, 1);
  ASSERT_EQ(bus.request(8), bus.good(8));
  bus.enable(8);
  EXPECT_EQ(bus.transmit(name, head), "!8002 the motor has power");
  EXPECT_EQ(bus.receive(name).substr(0, 10), "# servodro");
}

TEST(FilesWithoutMemory, AreReadOnly) {
  Bus bus(false);
  bus.to_pre_operational();
  EXPECT_EQ(bus.transmit("parameters.txt", ""), "!8002 there is no memory for parameters");
  EXPECT_NE(bus.receive("parameters.txt").find("0x2011:02=100"), std::string::npos);
}

TEST(FilesWithABrokenMemory, ChangeNothing) {
  dictionary::FailingMedium medium(16384);
  medium.flush_fails = true;
  FoeRig<Generic402Ec> bus(default_plant(), Bus::settings(&medium));
  bus.to_pre_operational();
  const std::string before = bus.receive("parameters.txt");
  const std::string text = "# servodrome parameters 1\n0x1018:01=0x53455256\n0x1018:02=0x34303245\n0x2011:02=99\n";
  EXPECT_EQ(bus.transmit("parameters.txt", text).substr(0, 5), "!800B");
  EXPECT_EQ(bus.receive("parameters.txt"), before);
}

TEST(FilesInBootstrap, AndNothingElse) {
  Bus bus;
  bus.set_sync_manager(0, Generic402Ec::ethercat_profile.bootstrap_out.start, Bus::mailbox_bytes, 0x26);
  bus.set_sync_manager(1, Generic402Ec::ethercat_profile.bootstrap_in.start, Bus::mailbox_bytes, 0x22);
  ASSERT_EQ(bus.request(3), bus.good(3));
  const std::string text = bus.receive("parameters.txt");
  EXPECT_NE(text.find("0x2011:02=100\n"), std::string::npos);
  bus.set(0x2011, 2, 5);
  EXPECT_EQ(bus.transmit("parameters.txt", text), "");
  EXPECT_EQ(bus.get(0x2011, 2), 100);
  EXPECT_EQ(bus.request(4).state & 0x10U, 0x10U);  // only back to Init
}

}  // namespace
}  // namespace generic402_ec_test
}  // namespace servodrome::test
