// Parameters and PDOs of every product over the bench API: the requests of a script or of the page's Objects page.
#include <algorithm>
#include <gmock/gmock.h>

#include "commissioning_rig.hpp"

namespace servodrome::studio {
namespace parameter_routes_test {
namespace {

using api::Method;
using nlohmann::json;
using testing::HasSubstr;
using namespace std::chrono_literals;

class ParametersOf : public CommissioningRig, public testing::WithParamInterface<std::string> {
 protected:
  std::string axis_ = GetParam();
  std::string path_ = "axes/" + axis_ + "/parameters";
  std::string text() { return ask(Method::get, path_).body; }
  // A line of the text with a number that can be changed: its object, type and value.
  struct Row {
    std::string object, type, value;
  };
  std::vector<Row> rows() {
    std::vector<Row> rows;
    std::istringstream lines(text());
    for (std::string line; std::getline(lines, line);) {
      Row row;
      std::istringstream words(line);
      words >> row.object >> row.type >> row.value;
      if (row.object.size() == 7 && row.object[4] == ':') rows.push_back(row);
    }
    return rows;
  }
  std::string file(const std::string& lines) {
    return "# servodrome parameters 1\nproduct: " + axis_ + "\n" + lines + "end\n";
  }
};
INSTANTIATE_TEST_SUITE_P(Products, ParametersOf, testing::ValuesIn(names_of_products()), name_of_test);

TEST_P(ParametersOf, AreSavedAndLoadedUnchanged) {
  const std::string before = text();
  EXPECT_THAT(before, HasSubstr("product: " + axis_ + "\n"));
  EXPECT_GT(rows().size(), 30U);
  const json report = json_of(Method::put, path_, before);
  EXPECT_EQ(report["compared"], rows().size());
  EXPECT_TRUE(report["written"].empty()) << report["written"].dump();
  EXPECT_EQ(json_of(Method::post, path_ + "/diff", before)["differences"], json::array());
}

TEST_P(ParametersOf, AChangeIsToldAndTakenBack) {
  const json fresh = get(path_ + "/diff");
  const std::string before = text();
  // All products have 6081h, and none has the factory value 4321.
  json_of(Method::put, "axes/" + axis_ + "/objects/6081/0", R"({"value": 4321})");
  const json changed = json_of(Method::post, path_ + "/diff", before);
  ASSERT_EQ(changed["differences"].size(), 1U) << changed.dump();
  EXPECT_EQ(changed["differences"][0]["object"], "6081:00");
  EXPECT_EQ(changed["differences"][0]["right"], "4321");
  const json to_factory = get(path_ + "/diff");
  EXPECT_EQ(to_factory["differences"].size(), fresh["differences"].size() + 1);
  // The left side of the difference, as the page's "Take" sends it.
  const json& one = changed["differences"][0];
  const json report =
      json_of(Method::put, path_,
              file(fmt::format("6081:00 {} {}\n", one["type"].get<std::string>(), one["left"].get<std::string>())));
  ASSERT_EQ(report["written"].size(), 1U);
  EXPECT_EQ(report["written"][0]["object"], "6081:00");
  EXPECT_EQ(report["compared"], 1);
  EXPECT_EQ(text(), before);
}

// Values that differ from the stored ones are lost in a power cycle.
TEST_P(ParametersOf, AreComparedWithTheStoredValues) {
  EXPECT_EQ(get(path_ + "/diff?with=stored")["differences"], json::array());
  json_of(Method::put, "axes/" + axis_ + "/objects/6083/0", R"({"value": 4321})");
  const json changed = get(path_ + "/diff?with=stored");
  const bool at_once = changed["differences"].empty();  // this drive stores each value immediately
  if (!at_once) {
    ASSERT_EQ(changed["differences"].size(), 1U) << changed.dump();
    EXPECT_EQ(changed["differences"][0]["object"], "6083:00");
    EXPECT_EQ(changed["differences"][0]["right"], "4321");
  }
  json_of(Method::post, "axes/" + axis_ + "/power", R"({"action": "cycle"})");
  pass(500ms);
  EXPECT_EQ(value(axis_, "6083/0") == 4321, at_once);
  EXPECT_EQ(get(path_ + "/diff?with=stored")["differences"], json::array());
  json_of(Method::put, "axes/" + axis_ + "/objects/6083/0", R"({"value": 4321})");
  json_of(Method::post, path_ + "/store");
  pass(500ms);
  const json stored = get(path_ + "/diff?with=stored");
  for (const json& left : stored["differences"]) EXPECT_EQ(left["object"], "6083:00");
  EXPECT_EQ(ask(Method::get, path_ + "/diff?with=x").status, 400U);
}

TEST_P(ParametersOf, WhatDoesNotFitIsRefusedAndNothingIsWritten) {
  const std::string before = text();
  const auto refused = [&](const std::string& body, unsigned status, const std::string& words) {
    const auto response = ask(Method::put, path_, body);
    EXPECT_EQ(response.status, status) << body.substr(0, 200) << response.body;
    EXPECT_THAT(response.body, HasSubstr(words)) << body.substr(0, 200);
  };
  refused("", 400, "body:1");
  refused("hello", 400, "body:1");
  refused(file("6081:00 u32 1\n6081:00 u32 2\n"), 400, "body:4");
  refused(before.substr(0, before.size() / 2), 400, "body");  // cut off: the end is missing
  refused(file("6081:00 u32 1\n6041:00 u16 1\n"), 422, "6041:00");
  refused(file("6081:00 u16 1\n"), 422, "type");
  refused("# servodrome parameters 1\nproduct: another\n6081:00 u32 1\nend\n", 422, "another product");
  EXPECT_EQ(text(), before);
  const auto forced =
      ask(Method::put, path_ + "?force=true", "# servodrome parameters 1\nproduct: another\n6081:00 u32 1\nend\n");
  EXPECT_EQ(forced.status, 200U) << forced.body;
  EXPECT_EQ(value(axis_, "6081/0"), 1);
  EXPECT_EQ(ask(Method::put, path_ + "?force=maybe", file("6081:00 u32 1\n")).status, 400U);
}

TEST_P(ParametersOf, AreNotLoadedIntoAnEnabledDrive) {
  json_of(Method::post, "axes/" + axis_ + "/jobs", R"({"do": "enable"})");
  pass(3s);
  ASSERT_EQ(get("axes/" + axis_)["state"], "operation enabled");
  const auto response = ask(Method::put, path_, file("6081:00 u32 1\n"));
  EXPECT_EQ(response.status, 422U);
  EXPECT_THAT(response.body, HasSubstr("disable it"));
}

TEST_P(ParametersOf, WithoutPowerAreNotThere) {
  json_of(Method::post, "axes/" + axis_ + "/power", R"({"action": "off"})");
  for (const auto method : {Method::get, Method::put}) EXPECT_EQ(ask(method, path_, text()).status, 409U);
  EXPECT_EQ(ask(Method::get, "axes/" + axis_ + "/pdos").status, 409U);
}

TEST_P(ParametersOf, ArePdosAsTheObjectsSay) {
  const json pdos = get("axes/" + axis_ + "/pdos");
  ASSERT_GE(pdos["pdos"].size(), 2U);
  for (const json& pdo : pdos["pdos"]) {
    const std::string index = pdo["index"].get<std::string>().substr(2);
    EXPECT_EQ(pdo["objects"].size(), value(axis_, index + "/0").get<std::size_t>()) << pdo.dump();
    for (std::size_t i = 0; i < pdo["objects"].size(); ++i) {
      const json& mapped = pdo["objects"][i];
      const std::string object = mapped["object"];
      const auto raw = value(axis_, fmt::format("{}/{:x}", index, i + 1)).get<std::uint32_t>();
      EXPECT_EQ(fmt::format("{:04X}:{:02X}", raw >> 16U, raw >> 8U & 0xFFU), object);
      EXPECT_EQ(mapped["bits"], raw & 0xFFU);
      EXPECT_NE(mapped["name"], "") << object;
    }
  }
  EXPECT_FALSE(pdos["mappable"]["receive"].empty());
  EXPECT_FALSE(pdos["mappable"]["transmit"].empty());
}

// The first receive PDO that can be mapped gets one object less, and then its original mapping.
TEST_P(ParametersOf, APdoIsMappedAnewAndBack) {
  to_pre_operational();
  const json before = get("axes/" + axis_ + "/pdos");
  const auto pdo = std::find_if(before["pdos"].begin(), before["pdos"].end(), [](const json& one) {
    return one["direction"] == "receive" && one["objects"].size() > (one.contains("enabled") ? 0U : 1U);
  });
  ASSERT_NE(pdo, before["pdos"].end());
  json objects = json::array({"6040:00"});
  const bool longer = (*pdo)["objects"].size() == 1;
  if (longer) objects.push_back("607A:00");
  const json body{{"pdos", json::array({{{"index", (*pdo)["index"]}, {"objects", objects}}})}};
  if ((*pdo)["fixed"] == true) {
    EXPECT_GE(ask(Method::put, "axes/" + axis_ + "/pdos", body.dump()).status, 400U);
    EXPECT_EQ(get("axes/" + axis_ + "/pdos"), before);
    return;
  }
  const json after = json_of(Method::put, "axes/" + axis_ + "/pdos", body.dump());
  const auto place = static_cast<std::size_t>(pdo - before["pdos"].begin());
  ASSERT_EQ(after["pdos"][place]["objects"].size(), objects.size()) << after["pdos"][place].dump();
  EXPECT_EQ(after["pdos"][place]["objects"].back()["object"], objects.back());
  // Everything else is unchanged: identifiers, assignments.
  json rest = after;
  rest["pdos"][place]["objects"] = before["pdos"][place]["objects"];
  EXPECT_EQ(rest, before);
  json back = json::array();
  for (const json& one : (*pdo)["objects"]) {
    const std::string object = one["object"];
    back.push_back(object == "0000:00" ? fmt::format("{}/{}", object, one["bits"].get<int>()) : object);
  }
  const json undone{{"pdos", json::array({{{"index", (*pdo)["index"]}, {"objects", back}}})}};
  EXPECT_EQ(json_of(Method::put, "axes/" + axis_ + "/pdos", undone.dump()), before);
}

TEST_P(ParametersOf, WhatTheDriveRefusesToMapIsSaidAndPutBack) {
  to_pre_operational();
  const std::string path = "axes/" + axis_ + "/pdos";
  const json before = get(path);
  const json& first = before["pdos"][0];
  const auto refuse = [&](const std::string& objects, unsigned status) {
    const auto response = ask(
        Method::put, path,
        fmt::format(R"({{"pdos": [{{"index": "{}", "objects": {}}}]}})", first["index"].get<std::string>(), objects));
    EXPECT_EQ(response.status, status) << objects << response.body;
    EXPECT_EQ(get(path), before) << objects;
    return response.body;
  };
  if (first["fixed"] == false) {
    EXPECT_THAT(refuse(R"(["6041:00"])", 409), HasSubstr("0604 0041h"));  // an object of a TPDO, in an RPDO
    EXPECT_THAT(refuse(R"(["1018:01/32"])", 409), HasSubstr("0604 0041h"));
    EXPECT_THAT(refuse(R"(["7777:00/32"])", 409), HasSubstr("h)"));
    EXPECT_THAT(refuse(R"(["6040:00", "6041:00"])", 409), HasSubstr("0604 0041h"));  // not an error about a gap
    if (before["bus"] == "can") {
      EXPECT_THAT(refuse(R"(["607A:00", "607A:00", "607A:00"])", 409), HasSubstr("0604 0042h"));  // longer than 8 bytes
    }
  }
  refuse(R"(["7777:00"])", 422);
  refuse(R"(["6040"])", 422);
  refuse(R"([6040])", 422);
  refuse(R"("6040:00")", 422);
  EXPECT_EQ(ask(Method::put, path, R"({"pdos": [{"index": "0x1FFF", "objects": []}]})").status, 422U);
  EXPECT_EQ(ask(Method::put, path, R"({"pdos": [{"index": "0x1600", "colour": 1}]})").status, 400U);
  EXPECT_EQ(ask(Method::put, path, R"({"pdos": 1})").status, 422U);
  EXPECT_EQ(get(path), before);
}

class Parameters : public CommissioningRig {};

TEST_F(Parameters, AreStored) {
  json_of(Method::put, "axes/ismc/parameters?store=true",
          "# servodrome parameters 1\nproduct: ismc\n6081:00 u32 77\nend\n");
  json_of(Method::post, "axes/ismc/power", R"({"action": "cycle"})");
  pass(1s);
  EXPECT_EQ(value("ismc", "6081/0"), 77);
  json_of(Method::put, "axes/ismc/objects/6081/0", R"({"value": 78})");
  EXPECT_EQ(json_of(Method::post, "axes/ismc/parameters/store"),
            json::parse(R"({"stored": true, "keeps_at_once": false, "lost_with_power": []})"));
  json_of(Method::post, "axes/ismc/power", R"({"action": "cycle"})");
  pass(1s);
  EXPECT_EQ(value("ismc", "6081/0"), 78);
  EXPECT_EQ(json_of(Method::post, "axes/pronet/parameters/store"),
            json::parse(R"({"stored": false, "keeps_at_once": true, "lost_with_power": []})"));
  json_of(Method::put, "axes/pronet/objects/6083/0", R"({"value": 4711})");
  const json lost = json_of(Method::post, "axes/pronet/parameters/store")["lost_with_power"];
  ASSERT_EQ(lost.size(), 1U) << lost.dump();
  EXPECT_EQ(lost[0]["object"], "6083:00") << "the manual has no memory for it";
}

// A value that only the drive itself can refuse: the values written before are restored, and the error is reported.
TEST_F(Parameters, ARefusedFileIsTakenBack) {
  const std::string before = ask(Method::get, "axes/generic402/parameters").body;
  const auto response = ask(Method::put, "axes/generic402/parameters",
                            "# servodrome parameters 1\nproduct: generic402\n1600:00 u8 1\n1600:01 u32 60410010h\n"
                            "6081:00 u32 5\nend\n");
  EXPECT_EQ(response.status, 409U) << response.body;
  EXPECT_THAT(response.body, HasSubstr("1600:01"));
  EXPECT_THAT(response.body, HasSubstr("0604 0041h"));
  EXPECT_THAT(response.body, HasSubstr("were restored"));
  EXPECT_EQ(ask(Method::get, "axes/generic402/parameters").body, before);
}

TEST_F(Parameters, AnIdentifierAndATransmissionTypeAreChanged) {
  const json after = json_of(Method::put, "axes/generic402/pdos",
                             R"({"pdos": [{"index": "0x1A00", "transmission_type": 1, "inhibit_time_us": 5000,
                                           "event_timer_ms": 20, "can_id": 401, "enabled": true}]})");
  EXPECT_EQ(value("generic402", "1800/2"), 1);
  EXPECT_EQ(value("generic402", "1800/3"), 50);
  EXPECT_EQ(value("generic402", "1800/5"), 20);
  EXPECT_EQ(value("generic402", "1800/1").get<std::uint32_t>() & 0x800007FFU, 401U);
  const auto odd =
      ask(Method::put, "axes/generic402/pdos", R"({"pdos": [{"index": "0x1A00", "inhibit_time_us": 50}]})");
  EXPECT_EQ(odd.status, 422U) << odd.body;
  EXPECT_EQ(value("generic402", "1800/3"), 50);
}

TEST_F(Parameters, ANumberThatDoesNotFitIntoAPdoObjectIsRefused) {
  const auto before = value("generic402", "1800/2");
  const auto mapping = get("axes/generic402/pdos");
  for (const char* part : {R"("transmission_type": 257)", R"("sync_start": 256)", R"("objects": ["0000:00/264"])"}) {
    const auto response =
        ask(Method::put, "axes/generic402/pdos", fmt::format(R"({{"pdos": [{{"index": "0x1A00", {}}}]}})", part));
    EXPECT_EQ(response.status, 422U) << part << " " << response.body;
  }
  EXPECT_EQ(value("generic402", "1800/2"), before);
  EXPECT_EQ(get("axes/generic402/pdos"), mapping);
}

TEST_F(Parameters, AnAssignmentIsChangedInPreOperationalOnly) {
  const auto early = ask(Method::put, "axes/jmc_ec/pdos", R"({"receive": ["0x1601"]})");
  EXPECT_EQ(early.status, 409U);
  EXPECT_THAT(early.body, HasSubstr("0800 0022h"));
  to_pre_operational();
  const json before = get("axes/jmc_ec/pdos");
  ASSERT_EQ(before["receive"], json::array({"0x1600"}));
  const json after = json_of(Method::put, "axes/jmc_ec/pdos", R"({"receive": ["0x1601"], "transmit": ["0x1A01"]})");
  EXPECT_EQ(after["receive"], json::array({"0x1601"}));
  EXPECT_EQ(value("jmc_ec", "1C13/1"), 0x1A01);
  EXPECT_EQ(ask(Method::put, "axes/jmc_ec/pdos", R"({"receive": ["0x1A00"]})").status, 409U);
  EXPECT_EQ(get("axes/jmc_ec/pdos"), after);
}

}  // namespace
}  // namespace parameter_routes_test
}  // namespace servodrome::studio
