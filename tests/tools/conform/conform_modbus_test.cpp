// The conformance checks against drives on an RS485 line, in virtual time.
#include <gmock/gmock.h>

#include "catalogue/product.hpp"
#include "modbus/rtu_server.hpp"
#include "tools/conform/conform_rig.hpp"

namespace servodrome::master::conform::test {
namespace conform_modbus_test {
namespace {

// Modifies requests and answers; the callbacks receive all bytes of a frame.
class FalseClient final : public links::ByteClient {
 public:
  using Bytes = std::vector<std::uint8_t>;
  using Change = std::function<void(Bytes&)>;

  FalseClient(links::SerialLine& line, links::VirtualClock& clock, const Change& to_drive, const Change& from_drive)
      : client_(line, clock), to_drive_(to_drive), from_drive_(from_drive) {}

  void send(std::span<const std::uint8_t> bytes) override {
    Bytes changed(bytes.begin(), bytes.end());
    if (to_drive_) to_drive_(changed);
    client_.send(changed);
  }
  bool receive(Bytes& bytes, Time timeout) override {
    if (!from_drive_) return client_.receive(bytes, timeout);
    Bytes part;
    if (!client_.receive(part, timeout)) return false;
    // Collects bytes until the end of the frame: 2 ms of silence.
    for (Bytes more; client_.receive(more, 2ms); more.clear()) part.insert(part.end(), more.begin(), more.end());
    from_drive_(part);
    bytes.insert(bytes.end(), part.begin(), part.end());
    return true;
  }
  Time now() const override { return client_.now(); }
  void wait(Time span) override { client_.wait(span); }

 private:
  links::MemoryByteClient client_;
  const Change& to_drive_;
  const Change& from_drive_;
};

struct ModbusRig {
  explicit ModbusRig(std::string_view its_product)
      : product(its_product),
        line(settings_of(fmt::format(R"(
clock = "virtual"
[[bus]]
name = "can0"
[[bus]]
name = "bus"
type = "rs485"
[[axis]]
name = "x"
product = "{}"
bus = "can0"
serial = "bus"
{}
node = 3
)",
                                     its_product, its_product == "ismk" ? "serial_protocol = \"modbus\"" : ""))) {
    line.run_until(200ms);
  }

  Report run(RunOptions options = {}) {
    options.departures = catalogue::product_of(product).departures;
    const line::Product& found = *line::find_product(line::all_products(), product);
    const RegisterList list{found.serial->registers, found.describe().service_table, found.serial->profile->word_order};
    Subject subject(ModbusAccess{client, 3, list},
                    {.product = &catalogue::product_of(product), .cancelled = cancelled});
    return run_checks(subject, options);
  }

  std::string_view product;
  std::function<bool()> cancelled{};
  FalseClient::Change to_drive;
  FalseClient::Change from_drive;
  line::Line line;
  links::SerialLine& wires{line.find_serial_bus("bus")->line};
  ModbusClient client{std::make_unique<FalseClient>(wires, line, to_drive, from_drive),
                      ModbusClient::Framing::rtu,
                      "mem:",
                      {.format = line.find_serial_bus("bus")->settings.format}};
};

class ModbusDrives : public testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(Products, ModbusDrives, testing::Values("generic402", "ismk"));

TEST_P(ModbusDrives, DepartWhereTheirManualsSay) {
  ModbusRig rig(GetParam());
  const Report report = rig.run();
  expect_departures_only(report);
}

// ---- Planted defects ----

using Bytes = FalseClient::Bytes;

void seal(Bytes& frame) {
  if (frame.size() >= 4) modbus::seal_rtu_frame(frame, frame.size() - 2);
}
FalseClient::Change exception(std::uint8_t from, std::uint8_t to) {
  return [=](Bytes& frame) {
    if (frame.size() != 5 || (frame[1] & 0x80) == 0 || frame[2] != from) return;
    frame[2] = to;
    seal(frame);
  };
}

struct Defect {
  const char* name;
  const char* check;
  FalseClient::Change to_drive;
  FalseClient::Change from_drive;
};

const std::vector<Defect> defects{
    {"an absent register has another exception", "modbus.no-address", {}, exception(0x02, 0x03)},
    {"an unknown function has another exception", "modbus.unknown-function", {}, exception(0x01, 0x04)},
    {"any count of registers is taken",
     "modbus.wrong-count",
     [](Bytes& frame) {
       if (frame.size() == 8 && frame[1] == 0x03) frame[5] = 1;
       seal(frame);
     },
     {}},
    {"a refused value is confirmed",
     "modbus.refused-value",
     {},
     [](Bytes& frame) {
       if (frame.size() == 5 && frame[1] == 0x86) frame = {3, 0x06, 0, 0, 0, 0, 0, 0};
       seal(frame);
     }},
    {"the CRC is not looked at", "modbus.wrong-crc", seal, {}},
    {"other stations are answered for",
     "modbus.other-unit",
     [](Bytes& frame) {
       frame[0] = 3;
       seal(frame);
     },
     {}},
    {"broadcasts are answered",
     "modbus.broadcast",
     [](Bytes& frame) {
       frame[0] = 3;
       seal(frame);
     },
     {}},
    {"function 17h reads before it writes",
     "modbus.read-write",
     {},
     [](Bytes& frame) {
       if (frame.size() == 9 && frame[1] == 0x17) frame[6] ^= 1;
       seal(frame);
     }},
    {"any count of function 17h is taken",
     "modbus.read-write-count",
     [](Bytes& frame) {
       if (frame.size() > 8 && frame[1] == 0x17 && frame[5] != 1) frame[4] = 0, frame[5] = 1;
       seal(frame);
     },
     {}},
    {"a write is answered with something else",
     "modbus.write",
     {},
     [](Bytes& frame) {
       if (frame.size() == 8 && frame[1] == 0x10) frame[5] = 1;
       seal(frame);
     }},
};

class ModbusDefects : public testing::TestWithParam<std::size_t> {};
INSTANTIATE_TEST_SUITE_P(Planted, ModbusDefects, testing::Range(std::size_t{0}, defects.size()));

TEST_P(ModbusDefects, IsFound) {
  const Defect& defect = defects[GetParam()];
  ModbusRig rig("generic402");
  const RunOptions options{.only = {defect.check}};
  const Report sound = rig.run(options);
  ASSERT_EQ(sound.count(Verdict::pass), 1U) << text_of(sound, {Verdict::fail, Verdict::skipped});
  rig.to_drive = defect.to_drive;
  rig.from_drive = defect.from_drive;
  const Report report = rig.run(options);
  EXPECT_THAT(failed(report), testing::ElementsAre(defect.check)) << defect.name << "\n"
                                                                  << text_of(report, {Verdict::pass, Verdict::skipped});
}

TEST(ConformModbus, ABroadcastWritesNothing) {
  ModbusRig rig("generic402");
  unsigned broadcasts = 0;
  rig.to_drive = [&](Bytes& frame) {
    if (frame[0] != 0) return;
    ++broadcasts;
    EXPECT_EQ(frame[1], 0x03);
  };
  const Report report = rig.run({.only = {"modbus.broadcast"}});
  EXPECT_EQ(report.count(Verdict::pass), 1U);
  EXPECT_EQ(broadcasts, 1U);
}

TEST(ConformModbus, ACancelledCheckLeavesTheDriveAsBefore) {
  cancel_each_check<ModbusRig>("generic402", buses::modbus);
}

TEST(ConformModbus, SilenceIsNoRefusal) {
  ModbusRig rig("generic402");
  rig.to_drive = [](Bytes& frame) {
    // A write of the reserved mode 100.
    if (frame.size() == 8 && frame[1] == 0x06 && frame[4] == 0 && frame[5] == 100) frame[0] = 77;
    seal(frame);
  };
  const Report report = rig.run({.only = {"abort.value-range"}});
  EXPECT_THAT(failed(report), testing::ElementsAre("abort.value-range"));
}

// The client knows the registers and would refuse a missing object by itself.
TEST(ConformModbus, MissingObjectsAreCheckedByTheirRegisterOnly) {
  const auto checks = all_checks();
  const auto check =
      std::find_if(checks.begin(), checks.end(), [](const Check& one) { return one.id == "abort.no-object"; });
  ASSERT_NE(check, checks.end());
  EXPECT_EQ(check->buses & buses::modbus, 0U);
}

}  // namespace
}  // namespace conform_modbus_test
}  // namespace servodrome::master::conform::test
