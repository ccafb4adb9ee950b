#include <bit>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <numbers>

#include "line/bench/line_bench.hpp"
#include "support.hpp"

// Two axes of a line that a beam couples: both enabled, one of them without power, and the bench API.
namespace servodrome::line {
namespace coupled_axes_test {
namespace {

using namespace test;

constexpr double stiffness_nm_per_rad = 20.0;
constexpr double rad_per_count = 2.0 * std::numbers::pi / 131072.0;
constexpr std::string_view gantry = R"(
clock = "virtual"
[[bus]]
name = "can0"
[[axis]]
name = "left"
product = "generic402"
node = 1
[[axis]]
name = "alone"
product = "generic402"
node = 2
[[axis]]
name = "right"
product = "generic402"
node = 3
[[coupling]]
axes = ["left", "right"]
stiffness_nm_per_rad = 20
)";

struct Machine {
  explicit Machine(Time its_piece = 10ms) : piece(its_piece) { run(500ms); }

  void run(Time span) {
    for (const Time end = line.now() + span; line.now() < end;) line.run_until(std::min(line.now() + piece, end));
  }
  void write(std::uint8_t node, std::uint16_t index, std::uint32_t value, unsigned size) {
    master.send(sdo_write(node, index, 0, value, size), line.now());
    run(10ms);
  }
  void enable(std::uint8_t node) {
    write(node, 0x6060, 1, 1);
    write(node, 0x6081, 131072 * 2, 4);
    write(node, 0x6083, 131072 * 20, 4);
    write(node, 0x6084, 131072 * 20, 4);
    for (const std::uint32_t word : {6U, 7U, 15U}) write(node, 0x6040, word, 2);
    run(100ms);
  }
  void move_to(std::uint8_t node, std::int32_t counts) {
    write(node, 0x607A, static_cast<std::uint32_t>(counts), 4);
    write(node, 0x6040, 0x3F, 2);
    write(node, 0x6040, 0x0F, 2);
  }
  plant::Plant& plant(const char* name) { return line.find_axis(name)->plant(); }
  double twist_rad() {
    const double apart = static_cast<double>(plant("left").position_counts() - plant("right").position_counts());
    return apart * rad_per_count;
  }

  Time piece;
  Line line{settings_of(gantry)};
  links::MemoryPort master{line.buses()[0]->bus};
};

TEST(CoupledAxes, AMoveOfOneSideRacksTheBeamAndBothMotorsHoldIt) {
  Machine machine;
  machine.enable(1);
  machine.enable(3);
  machine.move_to(1, 800);
  machine.run(1s);
  EXPECT_NEAR(static_cast<double>(machine.plant("left").position_counts()), 800.0, 30.0);
  EXPECT_NEAR(static_cast<double>(machine.plant("right").position_counts()), 0.0, 30.0);
  // The motors hold the spring, within the static friction of each axis.
  const double spring_nm = stiffness_nm_per_rad * machine.twist_rad();
  EXPECT_NEAR(spring_nm, 0.75, 0.1);
  EXPECT_NEAR(machine.plant("left").torque_nm(), spring_nm, 0.02);
  EXPECT_NEAR(machine.plant("right").torque_nm(), -spring_nm, 0.02);
  machine.move_to(3, 800);
  machine.run(1s);
  EXPECT_NEAR(machine.plant("left").torque_nm(), 0.0, 0.03);
  EXPECT_NEAR(machine.plant("right").torque_nm(), 0.0, 0.03);
}

// No master has commanded this axis: only the coupling moves it.
TEST(CoupledAxes, AnAxisWithoutPowerIsDraggedAlongAndThenRests) {
  for (const bool powered : {true, false}) {
    Machine machine;
    Axis& right = *machine.line.find_axis("right");
    machine.enable(1);
    machine.enable(3);
    if (powered) {
      machine.write(3, 0x6040, 0, 2);  // disable voltage
    } else {
      right.power_off(machine.line.now());
    }
    machine.move_to(1, 4 * 131072);
    machine.run(1s);
    EXPECT_NEAR(machine.plant("right").velocity_rpm(), 120.0, 2.0) << powered;
    machine.run(3s);
    EXPECT_NEAR(static_cast<double>(machine.plant("left").position_counts()), 4.0 * 131072, 30.0);
    EXPECT_LE(std::abs(stiffness_nm_per_rad * machine.twist_rad()), 0.016) << "its static friction";
    const std::int64_t rests_at = right.plant().position_counts();
    machine.run(1s);
    EXPECT_EQ(right.plant().position_counts(), rests_at);
    EXPECT_EQ(right.plant().velocity_rpm(), 0.0);
    EXPECT_EQ(machine.plant("alone").position_counts(), 0);
  }
}

TEST(CoupledAxes, HowTimeIsCutIntoCallsChangesNothing) {
  const auto samples = [](Time piece) {
    Machine machine(piece);
    std::vector<std::uint64_t> bits;
    const auto sample = [&] {
      for (const auto& axis : machine.line.axes()) {
        bits.push_back(static_cast<std::uint64_t>(axis->plant().position_counts()));
        bits.push_back(std::bit_cast<std::uint64_t>(axis->plant().velocity_rpm()));
        bits.push_back(std::bit_cast<std::uint64_t>(axis->plant().torque_nm()));
      }
    };
    machine.enable(1);
    machine.enable(3);
    machine.move_to(1, 20000);
    for (int i = 0; i < 50; ++i) {
      machine.run(10ms);
      sample();
    }
    machine.line.find_axis("left")->power_off(machine.line.now());
    machine.move_to(3, -50000);
    for (int i = 0; i < 50; ++i) {
      machine.run(10ms);
      sample();
    }
    EXPECT_NE(machine.plant("left").velocity_rpm(), 0.0);
    return bits;
  };
  const std::vector<std::uint64_t> reference = samples(10ms);
  EXPECT_EQ(samples(tick_length), reference);
  EXPECT_EQ(samples(333us), reference);
}

struct Bench {
  api::Response ask(api::Method method, const std::string& target, const std::string& body = {}) {
    return bench::handle(line, {.method = method, .target = "/api/v1/axes/" + target, .body = body});
  }
  explicit Bench(std::string_view text) : line(settings_of(text)) {}
  Line line;
};

TEST(CoupledAxes, TheBenchNamesThePartner) {
  Bench bench(std::string(gantry) + "ratio = 2\n");
  for (const auto& [name, partners] : {std::pair{"left", R"(["right"])"}, {"right", R"(["left"])"}, {"alone", "[]"}}) {
    const auto view = nlohmann::json::parse(bench.ask(api::Method::get, name).body);
    EXPECT_EQ(view.at("coupled"), nlohmann::json::parse(partners)) << name;
  }
  const auto coupling_of = [&](const std::string& axis) {
    return nlohmann::json::parse(bench.ask(api::Method::get, axis + "/geometry").body).at("mechanics").at("coupling");
  };
  EXPECT_EQ(coupling_of("left"), nlohmann::json::parse(R"({"axis": "right", "ratio": 2.0})"));
  EXPECT_EQ(coupling_of("right"), nlohmann::json::parse(R"({"axis": "left", "ratio": 0.5})"));
  EXPECT_TRUE(coupling_of("alone").is_null());
}

TEST(CoupledAxes, PlacingAnAxisLeavesTheBeamRelaxed) {
  Bench bench(gantry);
  EXPECT_EQ(bench.ask(api::Method::put, "left/plant", R"({"position_counts": 100000})").status, 200U);
  bench.line.run_until(100ms);
  EXPECT_EQ(bench.line.find_axis("left")->plant().position_counts(), 100000);
  EXPECT_EQ(bench.line.find_axis("right")->plant().position_counts(), 0);
}

TEST(CoupledAxes, ALoadTooLightForTheCouplingIsRefused) {
  std::string stiff(gantry);
  stiff.replace(stiff.rfind("20"), 2, "7000");
  Bench bench(stiff);
  const api::Response refused = bench.ask(api::Method::put, "right/plant", R"({"load_inertia_kgm2": 1e-6})");
  EXPECT_EQ(refused.status, 422U);
  EXPECT_THAT(refused.body, testing::HasSubstr("coupling.stiffness_nm_per_rad: 7000 is not within"));
  EXPECT_EQ(bench.ask(api::Method::put, "alone/plant", R"({"load_inertia_kgm2": 1e-6})").status, 200U);
  EXPECT_EQ(bench.ask(api::Method::put, "right/plant", R"({"load_inertia_kgm2": 1e-3})").status, 200U);
}

}  // namespace
}  // namespace coupled_axes_test
}  // namespace servodrome::line
