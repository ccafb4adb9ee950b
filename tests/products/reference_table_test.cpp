#include "object_csv.hpp"
#include "products/generic402/generic402.hpp"
#include "rig.hpp"

// Compares the reference drive's objects with a table (tests/data/generic402_od.csv), like those of the makers' drives,
// so that objects change only on purpose.
namespace servodrome {
namespace reference_table_test {
namespace {

using products::Generic402;
using Rig = test::Rig<Generic402>;

TEST(ReferenceTable, IsThatOfItsFile) {
  Rig rig;
  const auto rows = test::read_csv("generic402_od.csv");
  EXPECT_EQ(test::compare_objects(rig.device.dictionary(), Generic402::factory_node_id, rows, {}), rows.size());
  std::set<std::pair<unsigned long, unsigned long>> named;
  for (const test::CsvRow& row : rows) {
    named.insert({std::stoul(row.at("index"), nullptr, 16), std::stoul(row.at("sub"), nullptr, 16)});
  }
  for (const dictionary::Entry& entry : Generic402::table) {
    EXPECT_TRUE(named.contains({entry.index, entry.sub})) << std::hex << entry.index << ":" << int{entry.sub};
  }
}

// Some values on which masters depend, with their clauses.
TEST(ReferenceTable, FactoryValuesOfTheStandard) {
  Rig rig;
  EXPECT_EQ(rig.get(0x1000), 0x00020192);     // CiA 402-3: servo drive
  EXPECT_EQ(rig.get(0x1600, 1), 0x60400010);  // CiA 402-3, 7.2: RPDO 1 is the controlword,
  EXPECT_EQ(rig.get(0x1A00, 1), 0x60410010);  // TPDO 1 the statusword,
  EXPECT_EQ(rig.get(0x1603, 1), 0x60400010);  // RPDO 4 controlword
  EXPECT_EQ(rig.get(0x1603, 2), 0x60FF0020);  // and target velocity
  EXPECT_EQ(rig.get(0x1603, 0), 2);
  EXPECT_EQ(rig.get(0x605A), 2);  // CiA 402-2, 8.4: slow down on the quick stop ramp
  EXPECT_EQ(rig.get(0x605B), 0);  // disable the drive function
  EXPECT_EQ(rig.get(0x605C), 1);  // slow down on the slow down ramp
  EXPECT_EQ(rig.get(0x605D), 1);
  EXPECT_EQ(rig.get(0x605E), 2);
  EXPECT_EQ(rig.get(0x6007), 1);  // fault
  // Homing: two and a quarter revolutions of 131072 counts per second.
  EXPECT_EQ(rig.get(0x6099, 1), 2 * 131072);
  EXPECT_EQ(rig.get(0x6099, 2), 131072 / 4);
}

// CiA 305, table 3: indices 0 to 8, 5 is reserved.
TEST(ReferenceTable, BitRatesOfLss) {
  constexpr std::uint32_t rates[] = {1'000'000, 800'000, 500'000, 250'000, 125'000, 0, 50'000, 20'000, 10'000};
  for (std::uint8_t index = 0; index < 12; ++index) {
    std::array<std::byte, 16384> bytes{};
    dictionary::RamMedium medium(bytes);
    Rig rig(test::default_plant(), {.store = &medium});
    const auto ask = [&rig](std::vector<std::uint8_t> request) {
      request.resize(8);
      rig.sent.clear();
      rig.send(0x7E5, request);
      rig.run_ms(1);
      for (const canopen::Frame& frame : rig.sent) {
        if (frame.id == 0x7E4) return int{frame.data[1]};
      }
      return -1;
    };
    rig.send(0x7E5, {0x04, 0x01, 0, 0, 0, 0, 0, 0});  // all to configuration
    const bool exists = index < std::size(rates) && rates[index] != 0;
    EXPECT_EQ(ask({0x13, 0x00, index}), exists ? 0 : 1) << int{index};
    EXPECT_EQ(ask({0x17}), 0);
    rig.device.power_on(rig.feedback, rig.now());
    EXPECT_EQ(rig.device.bit_rate(), exists ? rates[index] : 1'000'000U) << int{index};
  }
}

// 2F00h is a node-ID or CiA 305's value for none, 2F01h a bit rate of CiA 305.
TEST(ReferenceTable, NodeIdAndBitRateAreThoseOfTheBus) {
  using dictionary::AbortCode;
  Rig rig;
  for (const auto& [value, answer] : {std::pair{127, AbortCode::none},
                                      {255, AbortCode::none},
                                      {128, AbortCode::value_invalid},
                                      {254, AbortCode::value_invalid}}) {
    EXPECT_EQ(rig.set(0x2F00, 0, value), answer) << value;
  }
  EXPECT_EQ(rig.set(0x2F01, 0, 250'000), AbortCode::none);
  EXPECT_EQ(rig.set(0x2F01, 0, 100'000), AbortCode::value_invalid) << "reserved";
}

// ---- CiA 303-3: RUN shows the NMT state, ERR errors of the bus ----

TEST(ReferenceTable, LampsOfTheBus) {
  using canopen::BusState;
  using products::Light;
  Rig rig;
  rig.set(0x1016, 1, 0x050032);  // node 5, 50 ms
  const auto is = [&rig](std::size_t lamp, Light light, int flashes = 0) {
    const products::Lamp now = rig.device.lamps(rig.now()).all()[lamp];
    return now.light == light && now.flashes == flashes;
  };
  constexpr std::size_t run = 0;
  constexpr std::size_t error = 1;
  EXPECT_TRUE(is(run, Light::blinking)) << "pre-operational";
  rig.send(0, {1, 0});
  EXPECT_TRUE(is(run, Light::on)) << "operational";
  rig.send(0, {2, 0});
  EXPECT_TRUE(is(run, Light::flashes, 1)) << "stopped";
  rig.send(0, {1, 0});
  EXPECT_TRUE(is(error, Light::off));
  rig.send(0x705, {5});
  rig.run_ms(100);
  EXPECT_TRUE(is(error, Light::flashes, 2)) << "error control event";
  rig.device.can_node()->bus_state(BusState::error_passive, rig.now());
  EXPECT_TRUE(is(error, Light::flashes, 1)) << "warning limit";
  rig.device.can_node()->bus_state(BusState::bus_off, rig.now());
  EXPECT_TRUE(is(error, Light::on));
}

// 1021h: the stored text of the drive, read by SDO.
TEST(ReferenceTable, CarriesItsDescription) {
  constexpr std::string_view text = "[FileInfo]";
  Rig rig(test::default_plant(), {.description = std::as_bytes(std::span(text))});
  rig.sent.clear();
  rig.send(0x602, {0x40, 0x21, 0x10, 0, 0, 0, 0, 0});
  rig.send(0x602, {0x60, 0, 0, 0, 0, 0, 0, 0});
  rig.send(0x602, {0x70, 0, 0, 0, 0, 0, 0, 0});
  std::vector<canopen::Frame> answers;
  for (const canopen::Frame& frame : rig.sent) {
    if (frame.id == 0x582) answers.push_back(frame);
  }
  ASSERT_EQ(answers.size(), 3U);
  EXPECT_EQ(answers[0].data[4], text.size());
  EXPECT_EQ(std::string(answers[1].data.begin() + 1, answers[1].data.begin() + 8), "[FileIn");
  EXPECT_EQ(std::string(answers[2].data.begin() + 1, answers[2].data.begin() + 4), "fo]");
}

// ---- 60D5h to 60D8h: edge counters of each probe ----

TEST(ReferenceTable, EdgeCountersOfTheTouchProbes) {
  Rig rig;
  ASSERT_EQ(rig.set(0x2030, 4, 5), dictionary::AbortCode::none);  // DI3 is touch probe 1,
  ASSERT_EQ(rig.set(0x2030, 5, 6), dictionary::AbortCode::none);  // DI4 touch probe 2
  rig.set(0x60B8, 0, 0x3333);                                     // both on, every edge, each event
  rig.run_ms(2);
  const auto pulse = [&rig](int wire, int times) {
    for (int i = 0; i < times; ++i) {
      for (const bool level : {true, false}) {
        rig.plant.force_input(wire, level);
        rig.run_ms(2);
      }
    }
  };
  const auto counters = [&rig] {
    return std::array{rig.get(0x60D5), rig.get(0x60D6), rig.get(0x60D7), rig.get(0x60D8)};
  };
  EXPECT_EQ(counters(), (std::array<std::int64_t, 4>{0, 0, 0, 0}));
  pulse(3, 3);
  EXPECT_EQ(counters(), (std::array<std::int64_t, 4>{3, 3, 0, 0}));
  pulse(4, 2);
  rig.plant.force_input(4, true);
  rig.run_ms(2);
  EXPECT_EQ(counters(), (std::array<std::int64_t, 4>{3, 3, 3, 2}));
  rig.set(0x60B8, 0, 0x3300);  // probe 1 off and on: its counter restarts
  rig.set(0x60B8, 0, 0x3333);
  rig.run_ms(2);
  pulse(3, 1);
  EXPECT_EQ(counters(), (std::array<std::int64_t, 4>{1, 1, 3, 2}));
}

}  // namespace
}  // namespace reference_table_test
}  // namespace servodrome
