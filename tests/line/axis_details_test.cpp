// The bench API's data about an axis for drawing: travel, homing methods, power states, faults in words.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "catalogue/object_texts.hpp"
#include "drive/drive.hpp"
#include "line/bench/line_bench.hpp"
#include "support.hpp"

namespace servodrome::line::bench {
namespace axis_details_test {
namespace {

using namespace test;
using namespace api;
using nlohmann::json;
using testing::HasSubstr;

constexpr std::string_view all_kinds = R"(
clock = "virtual"
[[bus]]
name = "can0"
[[bus]]
name = "ecat"
type = "ethercat"
[[axis]]
name = "ismc"
product = "ismc"
bus = "can0"
node = 1
  [axis.travel]
  counts_per_unit = 1000
  low_stop = -11
  high_stop = 11
  negative_limit = -10
  positive_limit = { at = 10, hysteresis = 1, normally_closed = true }
  home = { from = -5, to = 5 }
  [[axis.travel.switch]]
  from = 7
  to = 8
  wire = 4
[[axis]]
name = "pronet"
product = "pronet"
bus = "can0"
node = 2
[[axis]]
name = "ismk"
product = "ismk"
bus = "can0"
node = 3
[[axis]]
name = "generic402"
product = "generic402"
bus = "can0"
node = 4
[[axis]]
name = "jmc_ec"
product = "jmc_ec"
bus = "ecat"
[[axis]]
name = "generic402-ec"
product = "generic402-ec"
bus = "ecat"
[[axis]]
name = "ismk-ea"
product = "ismk-ea"
bus = "ecat"
)";

class AxisDetails : public testing::TestWithParam<const char*> {
 protected:
  AxisDetails() { line_.run_until(100ms); }

  Response ask(Method method, const std::string& target, const std::string& body = {}) {
    return handle(line_, {.method = method, .target = "/api/v1/axes/" + target, .body = body});
  }
  json get(const std::string& target) {
    const Response response = ask(Method::get, target);
    EXPECT_EQ(response.status, 200U) << target << " " << response.body;
    return json::parse(response.body);
  }
  void pass(Time time) { line_.run_until(line_.now() + time); }
  void control(const std::string& axis, unsigned word) {
    const Response response = ask(Method::put, axis + "/objects/6040/0", json{{"value", word}}.dump());
    ASSERT_EQ(response.status, 204U) << response.body;
  }

  Line line_{settings_of(all_kinds)};
};
INSTANTIATE_TEST_SUITE_P(Products, AxisDetails,
                         testing::Values("ismc", "pronet", "ismk", "generic402", "jmc_ec", "generic402-ec", "ismk-ea"));

TEST_F(AxisDetails, GeometryIsTheLineFiles) {
  EXPECT_EQ(get("ismc/geometry"), json::parse(R"({
    "negative_stop": -11000, "positive_stop": 11000, "negative_limit": -10000, "positive_limit": 10000,
    "home_from": -5000, "home_to": 5000, "index_every": 131072, "index_at": 0,
    "inputs": {"negative_limit": "DI0", "positive_limit": "DI1", "home": "DI2"},
    "switches": [
      {"name": "negative_limit", "input": "DI0", "from": null, "to": -10000, "hysteresis": 0, "normally_closed": false},
      {"name": "positive_limit", "input": "DI1", "from": 10000, "to": null, "hysteresis": 1000, "normally_closed": true},
      {"name": "home", "input": "DI2", "from": -5000, "to": 5000, "hysteresis": 0, "normally_closed": false},
      {"name": "switch", "input": "DI4", "from": 7000, "to": 8000, "hysteresis": 0, "normally_closed": false}],
    "mechanics": {"kind": "linear", "counts_per_revolution": 131072, "cycle_revolutions": 1.0,
                  "cycle_offset_turns": 0.0, "crank_ratio": 0.0, "hangs": false, "belt": false, "elastic": false,
                  "coupling": null}})"));
  const json open = get("generic402/geometry");
  for (const char* key :
       {"negative_stop", "positive_stop", "negative_limit", "positive_limit", "home_from", "home_to"}) {
    EXPECT_TRUE(open.at(key).is_null()) << key;
  }
  EXPECT_EQ(open["switches"], json::array());
  EXPECT_EQ(open["mechanics"]["kind"], "rotary");
}

// The mechanics of an axis whose group [axis.load] is `load`.
json mechanics_with(const std::string& load) {
  Line line(
      settings_of("clock = \"virtual\"\n[[bus]]\nname = \"can0\"\n[[axis]]\nname = \"x\"\nproduct = \"ismc\"\n"
                  "[axis.travel]\nlow_stop = -5\nhigh_stop = 5\n[axis.load]\n" +
                  load));
  const Response response = handle(line, {.method = Method::get, .target = "/api/v1/axes/x/geometry", .body = {}});
  EXPECT_EQ(response.status, 200U) << response.body;
  return json::parse(response.body)["mechanics"];
}

TEST_F(AxisDetails, TheLineFileSaysWhatTheLoadIs) {
  const struct {
    const char* load;
    const char* kind;
  } rows[] = {{"arm_torque_nm = 0.2", "arm"},
              {"crank_inertia_kgm2 = 0.0001", "crank"},
              {"crank_torque_nm = 0.1", "crank"},
              {"gravity_torque_nm = 0.2", "linear"}};
  for (const auto& [load, kind] : rows) EXPECT_EQ(mechanics_with(load)["kind"], kind) << load;
  const json crank =
      mechanics_with("crank_torque_nm = 0.1\ncrank_ratio = 0.25\ncycle_revolutions = 12.0\ncycle_offset_turns = 0.5");
  EXPECT_EQ(crank["crank_ratio"], 0.25);
  EXPECT_EQ(crank["cycle_revolutions"], 12.0);
  EXPECT_EQ(crank["cycle_offset_turns"], 0.5);
  EXPECT_EQ(mechanics_with("gravity_torque_nm = 0.2")["hangs"], true);
}

json method_of(const json& homing, int number) {
  for (const json& one : homing["methods"]) {
    if (one["method"] == number) return one;
  }
  return {};
}

TEST_F(AxisDetails, HomingLegsAreThoseOfTheStandardsFigures) {
  const json homing = get("generic402/homing");
  EXPECT_EQ(homing["reversed"], false);
  const auto method = [&homing](int number) { return method_of(homing, number); };
  const json seven = method(7);
  EXPECT_EQ(seven["needs"], json({"home", "index"}));
  EXPECT_EQ(seven["start_active"], 2);
  EXPECT_EQ(seven["returns"], true);
  ASSERT_EQ(seven["legs"].size(), 4U);
  EXPECT_EQ(seven["legs"][0], json::parse(R"({"direction": "positive", "speed": "switch", "until": "home_rising",
    "then": "stop", "next": 2, "on_limit": 1,
    "text": "positive, at the speed during search for switch, until the home switch becomes active; then stop; at the positive limit switch stop, then leg 2"})"));
  EXPECT_EQ(seven["legs"][3]["until"], "index");
  EXPECT_EQ(seven["legs"][3]["then"], "latch");
  EXPECT_TRUE(seven["legs"][3]["next"].is_null());
  const json one = method(1);
  EXPECT_EQ(one["needs"], json({"negative_limit", "index"}));
  EXPECT_THAT(one["legs"][1]["text"].get<std::string>(), HasSubstr("the negative limit switch becomes inactive"));
  EXPECT_EQ(method(37)["legs"], json::array());
  EXPECT_EQ(method(15), json()) << "reserved";
}

// With 607Eh bit 7 a method runs to the other end of the shaft. 60FDh of the reference drive names the switches by the
// shaft, that of the JMC by the user's directions.
TEST_F(AxisDetails, AReversedPolarityExchangesTheEndsThatHomingNeeds) {
  const std::array rows{std::pair{"generic402", "the positive limit switch becomes inactive"},
                        std::pair{"jmc_ec", "the negative limit switch becomes inactive"}};
  for (const auto& [axis, text] : rows) {
    ASSERT_EQ(ask(Method::put, std::string(axis) + "/objects/607E/0", R"({"value": 128})").status, 204U);
    pass(10ms);
    const json homing = get(std::string(axis) + "/homing");
    EXPECT_EQ(homing["reversed"], true);
    const json one = method_of(homing, 1);
    EXPECT_EQ(one["legs"][0]["direction"], "negative") << axis;
    EXPECT_THAT(one["needs"], testing::Contains("positive_limit")) << axis;
    EXPECT_THAT(one["needs"], testing::Not(testing::Contains("negative_limit"))) << axis;
    EXPECT_THAT(one["legs"][1]["text"].get<std::string>(), HasSubstr(text)) << axis;
  }
}

TEST_P(AxisDetails, HomingIsTheProductsTable) {
  const std::span<const drive::Method> table = line_.find_axis(GetParam())->device().drive().policy().homing.methods;
  std::size_t supported = 0;
  const json methods = get(std::string(GetParam()) + "/homing")["methods"];
  for (const json& method : methods) {
    const drive::Method* row = find_method(table, method["method"].get<std::int8_t>());
    if (row == nullptr || row->idle) {
      EXPECT_EQ(method["supported"], false);
      continue;
    }
    EXPECT_EQ(method["supported"], true);
    EXPECT_EQ(method["legs"].size(), row->leg_count);
    ++supported;
  }
  EXPECT_EQ(supported, static_cast<std::size_t>(std::count_if(
                           table.begin(), table.end(), [](const drive::Method& method) { return !method.idle; })));
}

// The controlwords lead to the listed states, through all states up and down.
TEST_P(AxisDetails, TransitionsLeadWhereTheySay) {
  const std::string axis = GetParam();
  const auto go = [&](unsigned number) {
    const json transitions = get(axis + "/states")["transitions"];
    for (const json& transition : transitions) {
      if (transition["number"] != number) continue;
      control(axis, transition["controlword"].get<unsigned>());
      pass(500ms);
      EXPECT_EQ(get(axis + "/states")["state"], transition["to"]) << number;
      return;
    }
    ADD_FAILURE() << "no transition " << number << " in " << get(axis + "/states").dump();
  };
  if (get(axis + "/states")["state"] == "ready to switch on") go(7);  // Kinco's drives start with controlword 6
  EXPECT_EQ(get(axis + "/states")["state"], "switch on disabled");
  for (const unsigned number : {2U, 7U, 2U, 3U, 6U, 3U, 4U, 5U, 4U, 9U, 2U, 3U, 10U}) go(number);
  const json left = get(axis + "/states")["transitions"];
  EXPECT_EQ(left.size(), 1U);
  for (const json& transition : left) {
    EXPECT_EQ(transition,
              json::parse(R"({"number": 2, "name": "shutdown", "to": "ready to switch on", "controlword": 6})"));
  }
}

TEST_F(AxisDetails, Transition16IsOfferedWhereTheDriveHasIt) {
  const auto numbers_in_quick_stop = [this](const std::string& axis) {
    for (const unsigned word : {0x06U, 0x07U, 0x0FU, 0x02U}) {
      control(axis, word);
      pass(200ms);
    }
    EXPECT_EQ(get(axis + "/states")["state"], "quick stop active") << axis;
    std::vector<unsigned> numbers;
    const json transitions = get(axis + "/states")["transitions"];
    for (const json& transition : transitions) numbers.push_back(transition["number"]);
    return numbers;
  };
  ASSERT_EQ(ask(Method::put, "generic402/objects/605A/0", R"({"value": 6})").status, 204U);
  ASSERT_EQ(ask(Method::put, "ismc/objects/605A/0", R"({"value": 6})").status, 204U);
  EXPECT_THAT(numbers_in_quick_stop("generic402"), testing::UnorderedElementsAre(12U, 16U));
  EXPECT_THAT(numbers_in_quick_stop("ismc"), testing::UnorderedElementsAre(12U));
}

json entry_of(const json& list, const std::string& index, unsigned sub) {
  for (const json& entry : list["objects"]) {
    if (entry["index"] == index && entry["sub"] == sub) return entry;
  }
  return json();
}

// Every object of a product has a text, and there is no text for an object that no product has.
TEST_P(AxisDetails, EveryObjectIsExplained) {
  const json list = get(std::string(GetParam()) + "/objects");
  for (const json& entry : list["objects"]) {
    const auto index = std::stoul(entry["index"].get<std::string>(), nullptr, 16);
    if (index < 0x1000) continue;  // data types
    EXPECT_GT(entry.value("text", "").size(), 20U) << entry["index"] << ":" << entry["sub"] << " " << entry["name"];
  }
}

TEST_F(AxisDetails, TextsAreInOrderAndOfObjectsThatExist) {
  for (const char* product : {"", "generic402", "ismc", "pronet", "ismk", "jmc_ec"}) {
    const auto texts = *product == '\0' ? catalogue::standard_object_texts() : catalogue::product_object_texts(product);
    EXPECT_FALSE(texts.empty()) << product;
    for (std::size_t i = 0; i < texts.size(); ++i) {
      const catalogue::ObjectText& row = texts[i];
      EXPECT_LE(i == 0 ? 0 : texts[i - 1].index, row.index);
      const auto has = [&row](const auto& axis) {
        const auto table = axis->device().dictionary().table();
        return std::any_of(table.begin(), table.end(), [&row](const dictionary::Entry& entry) {
          return entry.index == row.index && (row.sub == catalogue::any_sub || entry.sub == row.sub);
        });
      };
      EXPECT_TRUE(std::any_of(line_.axes().begin(), line_.axes().end(), has))
          << fmt::format("{:04X}:{:02X}", row.index, row.sub);
    }
  }
}

TEST_F(AxisDetails, BitsAndValuesHaveTheProductsNames) {
  const json reference = get("generic402/objects");
  const json kinco = get("ismk/objects");
  const auto name = [](const json& names, const char* key, int value) {
    for (const json& one : names) {
      if (one[key] == value) return one["name"].get<std::string>();
    }
    return std::string();
  };
  const json status = entry_of(reference, "0x6041", 0)["bits"];
  EXPECT_EQ(name(status, "bit", 10), "target reached");
  EXPECT_THAT(name(status, "bit", 12),
              HasSubstr("set-point acknowledge (mode 1), speed zero (3), homing attained (6)"));
  const json own = entry_of(kinco, "0x6041", 0)["bits"];
  EXPECT_EQ(name(own, "bit", 15), "home found");
  EXPECT_THAT(name(own, "bit", 12), HasSubstr("homing error (6)"));
  EXPECT_THAT(name(own, "bit", 10), testing::Not(HasSubstr("(6)"))) << "it has none in homing";
  EXPECT_EQ(name(entry_of(reference, "0x6060", 0)["enumeration"], "value", 8), "cyclic_sync_position");
  EXPECT_EQ(name(entry_of(kinco, "0x6060", 0)["enumeration"], "value", 8), "");
  EXPECT_EQ(name(entry_of(kinco, "0x6060", 0)["enumeration"], "value", -3), "immediate_velocity");
  const json quick_stop = entry_of(reference, "0x605A", 0)["enumeration"];
  EXPECT_EQ(quick_stop.size(), 9U);
  EXPECT_EQ(name(quick_stop, "value", 0), "disable the drive function");
  EXPECT_EQ(name(quick_stop, "value", 2), "quick stop ramp, then switch on disabled");
  EXPECT_EQ(name(quick_stop, "value", 6), "quick stop ramp, stays in quick stop active");
  EXPECT_EQ(name(entry_of(kinco, "0x605A", 0)["enumeration"], "value", 18),
            "brake through the windings, stays in quick stop active");
  EXPECT_EQ(name(entry_of(kinco, "0x605A", 0)["enumeration"], "value", 3), "") << "the iSMK has 0, 1, 2, 5, 6, 18";
  EXPECT_EQ(name(entry_of(reference, "0x605D", 0)["enumeration"], "value", 1), "slow-down ramp");
  EXPECT_EQ(entry_of(reference, "0x6007", 0)["enumeration"].size(), 4U);
  EXPECT_EQ(entry_of(kinco, "0x6007", 0)["enumeration"].size(), 2U) << "its range ends at 1";
  EXPECT_EQ(name(entry_of(reference, "0x60FD", 0)["bits"], "bit", 17), "DI1");
  EXPECT_EQ(name(entry_of(reference, "0x60FD", 0)["bits"], "bit", 2), "home switch");
  EXPECT_EQ(name(entry_of(reference, "0x60FE", 1)["bits"], "bit", 16), "DO0");
  EXPECT_FALSE(entry_of(reference, "0x60FE", 0).contains("bits"));
  EXPECT_EQ(name(entry_of(reference, "0x2030", 3)["enumeration"], "value", 3), "home switch");
  EXPECT_EQ(entry_of(reference, "0x2030", 3)["terminal"], "Functions of the inputs");
  EXPECT_EQ(name(entry_of(kinco, "0x2010", 3)["enumeration"], "value", 0x8400), "Fast capture 1");
  EXPECT_EQ(name(entry_of(kinco, "0x2010", 15)["enumeration"], "value", 1), "Ready");
  EXPECT_EQ(name(entry_of(kinco, "0x2010", 10)["bits"], "bit", 1), "DI2 is on");
  EXPECT_EQ(entry_of(reference, "0x60B8", 0)["terminal"], "Touch probes");
  EXPECT_FALSE(entry_of(reference, "0x6040", 0).contains("terminal"));
  EXPECT_EQ(entry_of(kinco, "0x2FF0", 1)["text"].get<std::string>().substr(0, 8), "1 stores");
}

TEST_F(AxisDetails, WithoutPowerThereAreNoStates) {
  ASSERT_EQ(ask(Method::post, "ismc/power", R"({"action": "off"})").status, 200U);
  EXPECT_EQ(ask(Method::get, "ismc/states").status, 409U);
  EXPECT_EQ(ask(Method::get, "ismc/homing").status, 200U) << "a table needs no power";
  EXPECT_EQ(ask(Method::get, "ismc/geometry").status, 200U);
}

TEST_P(AxisDetails, AFaultIsExplained) {
  const std::string axis = GetParam();
  ASSERT_EQ(ask(Method::post, axis + "/faults", R"({"inject": "encoder_loss"})").status, 200U);
  pass(500ms);
  const json active = get(axis + "/faults")["active"];
  ASSERT_FALSE(active.empty());
  for (const json& fault : active) {
    for (const char* key : {"code", "name", "text", "cause", "remedy"}) {
      EXPECT_FALSE(fault.value(key, "").empty()) << key << " of " << fault.dump();
    }
  }
  EXPECT_EQ(get(axis)["faults"][0].size(), 2U) << "the list of axes stays short";
  EXPECT_EQ(get(axis + "/states")["state"], "fault");
  EXPECT_EQ(get(axis + "/states")["transitions"][0]["controlword"], 0x80);
}

TEST_F(AxisDetails, TheErrorHistoryIsExplained) {
  EXPECT_EQ(get("generic402/faults")["history"], json::array());
  for (const char* code : {"0x7305", "0x4310"}) {
    ASSERT_EQ(ask(Method::post, "generic402/faults", json{{"inject", code}}.dump()).status, 200U);
    pass(50ms);
    ASSERT_EQ(ask(Method::delete_, "generic402/faults").status, 200U);
    pass(50ms);
  }
  const json past = get("generic402/faults")["history"];
  ASSERT_EQ(past.size(), 2U) << past;
  EXPECT_EQ(past[0]["code"], "0x4310") << "the newest first";
  EXPECT_EQ(past[1]["code"], "0x7305");
  for (const json& fault : past) {
    for (const char* key : {"name", "text", "cause", "remedy"}) {
      EXPECT_FALSE(fault.value(key, "").empty()) << key << " of " << fault.dump();
    }
  }
  // The drive keeps 1003h only while it has power.
  ASSERT_EQ(ask(Method::post, "generic402/power", R"({"action": "off"})").status, 200U);
  EXPECT_EQ(get("generic402/faults")["history"], json::array());
}

TEST_F(AxisDetails, WhatADriveRemembersIsExplained) {
  // The drive then also keeps alarms of a motor that is not enabled.
  ASSERT_EQ(ask(Method::put, "ismk/objects/2605/3", R"({"value": 65535})").status, 204U);
  for (const char* code : {"0x7331", "0x4310"}) {
    ASSERT_EQ(ask(Method::post, "ismk/faults", json{{"inject", code}}.dump()).status, 200U);
    pass(50ms);
  }
  const json past = get("ismk/faults")["history"];
  ASSERT_EQ(past.size(), 2U);
  EXPECT_EQ(past[0]["code"], "0x4310");
  for (const json& fault : past) {
    for (const char* key : {"alarm", "text", "cause", "remedy"}) {
      EXPECT_FALSE(fault.value(key, "").empty()) << key << " of " << fault.dump();
    }
  }
}

}  // namespace
}  // namespace axis_details_test
}  // namespace servodrome::line::bench
