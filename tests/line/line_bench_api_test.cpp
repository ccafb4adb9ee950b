#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "api/access.hpp"
#include "api/query.hpp"
#include "bench_requests.hpp"
#include "draws.hpp"
#include "line/bench/line_bench.hpp"
#include "support.hpp"

namespace servodrome::line::bench {
namespace line_bench_api_test {
namespace {

using namespace test;
using namespace api;
using nlohmann::json;
using testing::HasSubstr;

class BenchApi : public testing::Test {
 protected:
  BenchApi() { line_.run_until(50ms); }

  Response ask(Method method, const std::string& target, const std::string& body = {}) {
    return handle(line_, {.method = method, .target = "/api/v1" + target, .body = body});
  }
  json get(const std::string& target) {
    const Response response = ask(Method::get, target);
    EXPECT_EQ(response.status, 200U) << target << " " << response.body;
    return json::parse(response.body);
  }
  void pass(Time time) { line_.run_until(line_.now() + time); }

  Line line_{settings_of(two_axes)};
};

TEST_F(BenchApi, ListsTheAxes) {
  const json axes = get("/axes")["axes"];
  ASSERT_EQ(axes.size(), 2U);
  EXPECT_EQ(axes[0], get("/axes/left"));
  const json left = axes[0];
  EXPECT_EQ(left["name"], "left");
  EXPECT_EQ(left["product"], "ismc");
  EXPECT_EQ(left["bus"], "can0");
  EXPECT_EQ(left["node_id"], 1);
  EXPECT_EQ(left["bit_rate"], 1'000'000);
  EXPECT_EQ(left["powered"], true);
  EXPECT_EQ(left["nmt_state"], "pre_operational");
  EXPECT_EQ(left["state"], "switch on disabled");
  EXPECT_EQ(left["faults"], json::array());
  EXPECT_EQ(left["position_counts"], 0);
  EXPECT_EQ(left["temperature_c"], 25.0);
  for (const char* key : {"mode", "mode_name", "statusword", "controlword", "error_code", "homed", "in_motion",
                          "velocity_rpm", "torque_nm", "current_a", "supply_v", "brake_engaged"}) {
    EXPECT_TRUE(left.contains(key)) << key;
  }
}

TEST_F(BenchApi, ReadsAndWritesObjectsAsTheServicePortDoes) {
  EXPECT_EQ(get("/axes/left/objects/6041/0")["value"], get("/axes/left")["statusword"]);
  const json type = get("/axes/left/objects/0x1000/0x0");
  EXPECT_EQ(type["index"], "0x1000");
  EXPECT_EQ(type["type"], "UNSIGNED32");
  EXPECT_EQ(type["access"], "ro");
  EXPECT_EQ(type["name"], "Device type");
  EXPECT_EQ(ask(Method::put, "/axes/left/objects/6081/0", R"({"value": 4321})").status, 204U);
  EXPECT_EQ(get("/axes/left/objects/6081/0")["value"], 4321);
  EXPECT_EQ(ask(Method::put, "/axes/left/objects/607A/0", R"({"value": -5})").status, 204U);
  EXPECT_EQ(get("/axes/left/objects/607a/0")["value"], -5);
  EXPECT_TRUE(get("/axes/right/objects/1008/0")["value"].is_string());
  EXPECT_GT(get("/axes/left/objects")["objects"].size(), 100U);
}

TEST_F(BenchApi, ReadsSeveralObjectsAtOnce) {
  const json values = get("/axes/left/values?objects=6041:00,1000:0,5FFF:00,2F12:06")["values"];
  EXPECT_EQ(values.size(), 4U);
  EXPECT_EQ(values["6041:00"], get("/axes/left")["statusword"]);
  EXPECT_EQ(values["1000:0"], get("/axes/left/objects/1000/0")["value"]);
  EXPECT_EQ(values["5FFF:00"], nullptr) << "not there";
  for (const char* wrong : {"", "?objects=", "?objects=6041", "?objects=6041:00,", "?objects=xyz:00", "?objects=,"}) {
    const unsigned status = ask(Method::get, std::string("/axes/left/values") + wrong).status;
    EXPECT_TRUE(status == 400U || std::string_view(wrong).ends_with(":00,")) << wrong << " " << status;
  }
  std::string many = "/axes/left/values?objects=6041:00";
  for (int i = 0; i < 128; ++i) many += ",6041:00";
  EXPECT_EQ(ask(Method::get, many).status, 400U);
  ask(Method::post, "/axes/left/power", R"({"action": "off"})");
  EXPECT_EQ(get("/axes/left/values?objects=6041:00")["values"]["6041:00"], nullptr);
}

TEST_F(BenchApi, ServesRoutesOfOthersWithTheirContext) {
  struct Shelf {
    std::string last_query;
  } shelf;
  static constexpr std::array shelf_routes{
      Route{Method::get, "/api/v1/shelf/{}/book?page&x",
            [](Call& call) {
              static_cast<Shelf*>(call.context)->last_query = query_value(call, "page").value_or("none");
              call.content = Content{"text/plain", std::string(call.arguments.front())};
              return Json();
            }},
      Route{Method::post, "/api/v1/shelf",
            [](Call&) {
              return Json{{"id", 1}};
            },
            201},
      Route{Method::delete_, "/api/v1/axes", [](Call&) { return Json(); }},
  };
  const std::array groups{RouteGroup{shelf_routes, &shelf}};
  const auto ask_shelf = [&](Method method, const std::string& target) {
    return handle(line_, {.method = method, .target = "/api/v1" + target}, groups);
  };
  const Response book = ask_shelf(Method::get, "/shelf/a/book?x=1&page=12&page=13");
  EXPECT_EQ(book.status, 200U);
  EXPECT_EQ(book.content_type, "text/plain");
  EXPECT_EQ(book.body, "a");
  EXPECT_EQ(shelf.last_query, "12");
  for (const auto& [query, value] :
       {std::pair{"?page=", ""}, {"?page", ""}, {"?page=6041%3A00", "6041:00"}, {"", "none"}}) {
    ask_shelf(Method::get, std::string("/shelf/a/book") + query);
    EXPECT_EQ(shelf.last_query, value) << query;
  }
  const Response misspelt = ask_shelf(Method::get, "/shelf/a/book?pag=1");
  EXPECT_EQ(misspelt.status, 400U);
  EXPECT_THAT(misspelt.body, HasSubstr("did you mean `page`?"));
  EXPECT_EQ(ask_shelf(Method::post, "/shelf").status, 201U);
  // If both groups have an address, the answer lists the methods of both.
  EXPECT_EQ(ask_shelf(Method::delete_, "/axes").status, 204U);
  EXPECT_EQ(ask_shelf(Method::post, "/axes").allow, "GET, DELETE");
  EXPECT_EQ(ask_shelf(Method::get, "/axes").status, 200U);
}

struct Refusal {
  const char* name;
  Method method;
  const char* target;
  const char* body;
  unsigned status;
  const char* what;
  const char* abort;  // nullptr: not refused by the drive
};

void PrintTo(const Refusal& refusal, std::ostream* out) { *out << refusal.name; }

const std::vector<Refusal> refusals{
    {"no_address", Method::get, "/nothing", "", 404, "unknown address", nullptr},
    {"slash", Method::get, "/axes/", "", 404, "there is no axis \"\"", nullptr},
    {"slash_too_many", Method::get, "/axes/left/faults/", "", 404, "unknown address", nullptr},
    {"no_method", Method::put, "/axes", "", 405, "does not support the method", nullptr},
    {"other_method", Method::other, "/clock", "", 405, "does not support the method", nullptr},
    {"no_query", Method::get, "/clock?x=1", "", 400, "unknown key \"x\" in the query", nullptr},
    {"query_key", Method::get, "/axes/left/values?object=6041:00", "", 400, "unknown key \"object\"", nullptr},
    {"no_axis", Method::get, "/axes/lef", "", 404, "there is no axis \"lef\"", nullptr},
    {"no_axis_deep", Method::put, "/axes/lef/inputs", "{}", 404, "there is no axis \"lef\"", nullptr},
    {"no_bus", Method::get, "/buses/can1", "", 404, "there is no bus \"can1\"", nullptr},
    {"index", Method::get, "/axes/left/objects/60x1/0", "", 400, "is not an index", nullptr},
    {"index_large", Method::get, "/axes/left/objects/10000/0", "", 400, "is not an index", nullptr},
    {"sub_large", Method::get, "/axes/left/objects/6041/100", "", 400, "is not a sub-index", nullptr},
    {"no_object", Method::get, "/axes/left/objects/5FFF/0", "", 404, "object does not exist", "0x06020000"},
    {"no_sub", Method::get, "/axes/left/objects/1018/9", "", 404, "sub-index does not exist", "0x06090011"},
    {"no_object_to_write", Method::put, "/axes/left/objects/5FFF/0", R"({"value":1})", 404, "object does not exist",
     "0x06020000"},
    {"read_only", Method::put, "/axes/left/objects/6041/0", R"({"value":1})", 409, "read-only", "0x06010002"},
    {"fraction", Method::put, "/axes/left/objects/6081/0", R"({"value":1.5})", 400, "wrong type", nullptr},
    {"beyond_all_types", Method::put, "/axes/left/objects/6081/0", R"({"value":18446744073709551616})", 400,
     "wrong type", nullptr},
    {"not_this_value", Method::put, "/axes/left/objects/6060/0", R"({"value":5})", 422, "refuses", "0x06090030"},
    {"beyond_type", Method::put, "/axes/left/objects/6040/0", R"({"value":65536})", 422,
     "the value is outside UNSIGNED16, 0 .. 65535", "0x06090031"},
    {"below_type", Method::put, "/axes/left/objects/6040/0", R"({"value":-1})", 422,
     "the value is outside UNSIGNED16, 0 .. 65535", "0x06090032"},
    {"value_missing", Method::put, "/axes/left/objects/6040/0", "{}", 400, "value is missing", nullptr},
    {"value_kind", Method::put, "/axes/left/objects/6040/0", R"({"value":"6"})", 400, "wrong type", nullptr},
    {"value_fraction", Method::put, "/axes/left/objects/6040/0", R"({"value":1.5})", 400, "wrong type", nullptr},
    {"value_key", Method::put, "/axes/left/objects/6040/0", R"({"value":6,"vlaue":6})", 400, "unknown key", nullptr},
    {"key_twice", Method::put, "/axes/left/objects/6040/0", R"({"value": 6, "value": 15})", 400, "there twice",
     nullptr},
    {"not_json", Method::put, "/axes/left/objects/6040/0", "value=6", 400, "not JSON", nullptr},
    {"not_object", Method::put, "/axes/left/objects/6040/0", "[6]", 400, "the body is an array", nullptr},
    {"too_large", Method::put, "/axes/left/objects/6040/0", R"({"value":1e999})", 400, "too large", nullptr},
    {"action", Method::post, "/axes/left/power", R"({"action":"reset"})", 422, "no action \"reset\"", nullptr},
    {"action_kind", Method::post, "/axes/left/power", R"({"action":1})", 400, "action is 1", nullptr},
    {"action_missing", Method::post, "/axes/left/power", "{}", 400, "action is missing", nullptr},
    {"no_input", Method::put, "/axes/left/inputs", R"({"DI0":true,"DI6":true})", 400, "no input \"DI6\"", nullptr},
    {"input_kind", Method::put, "/axes/left/inputs", R"({"DI0":true,"DI1":1})", 400, "neither true", nullptr},
    {"plant_key", Method::put, "/axes/left/plant", R"({"supply_v":48,"supply":48})", 400, "unknown key", nullptr},
    {"plant_kind", Method::put, "/axes/left/plant", R"({"supply_v":48,"ambient_c":"hot"})", 400, "ambient_c is",
     nullptr},
    {"plant_range", Method::put, "/axes/left/plant", R"({"supply_v":48,"ambient_c":1000})", 422, "thermal.ambient_c",
     nullptr},
    {"plant_lock", Method::put, "/axes/left/plant", R"({"supply_v":48,"locked_rotor":1})", 400, "locked_rotor is",
     nullptr},
    {"plant_far", Method::put, "/axes/left/plant", R"({"supply_v":48,"position_counts":9223372036854775807})", 422,
     "start_position_counts", nullptr},
    {"no_fault", Method::post, "/axes/left/faults", R"({"inject":"encoder_los"})", 422, "there is no fault", nullptr},
    {"no_code", Method::post, "/axes/left/faults", R"({"inject":"0x0001"})", 422, "there is no fault", nullptr},
    {"fault_kind", Method::post, "/axes/left/faults", R"({"inject":7})", 400, "inject is 7", nullptr},
    {"fault_back", Method::delete_, "/axes/left/faults", R"({"inject":"x"})", 422, "there is no fault", nullptr},
    {"probability", Method::post, "/buses/can0/disturb", R"({"drop":0.5,"delay":2})", 422, "delay is 2", nullptr},
    {"seed", Method::post, "/buses/can0/disturb", R"({"drop":0.5,"seed":-1})", 422, "seed is -1", nullptr},
    {"wide_id", Method::post, "/buses/can0/disturb", R"({"drop":0.5,"id":536870912})", 422, "id is", nullptr},
    {"disturb_axis", Method::post, "/buses/can0/disturb", R"({"drop":0.5,"axis":"up"})", 422, "no axis \"up\"",
     nullptr},
    {"disturb_key", Method::post, "/buses/can0/disturb", R"({"drop":0.5,"drip":1})", 400, "unknown key", nullptr},
    {"calm_key", Method::delete_, "/buses/can0/disturb", R"({"drop":0.5})", 400, "unknown key", nullptr},
    {"advance_back", Method::post, "/clock/advance", R"({"ms":-1})", 422, "ms is -1", nullptr},
    {"advance_far", Method::post, "/clock/advance", R"({"ms":60001})", 422, "ms is 60001", nullptr},
    {"advance_what", Method::post, "/clock/advance", "", 400, "not JSON", nullptr},
};

// All state that a request could change.
std::string state_of(Line& line) {
  std::string state;
  for (const char* target : {"/axes", "/axes/left/plant", "/axes/left/inputs", "/axes/left/faults", "/axes/right/plant",
                             "/axes/right/inputs", "/axes/right/faults", "/buses", "/clock"}) {
    state += handle(line, {.method = Method::get, .target = std::string("/api/v1") + target}).body + "\n";
  }
  return state;
}

class Refusals : public BenchApi, public testing::WithParamInterface<Refusal> {};

TEST_P(Refusals, SayWhatIsWrongAndChangeNothing) {
  const Refusal& refusal = GetParam();
  const std::string before = state_of(line_);
  const Response response = ask(refusal.method, refusal.target, refusal.body);
  EXPECT_EQ(response.status, refusal.status) << response.body;
  const json error = json::parse(response.body).at("error");
  EXPECT_THAT(error.at("what"), HasSubstr(refusal.what));
  EXPECT_FALSE(error.at("where").get<std::string>().empty());
  EXPECT_FALSE(error.at("hint").get<std::string>().empty());
  EXPECT_EQ(error.contains("abort"), refusal.abort != nullptr) << response.body;
  if (refusal.abort != nullptr) {
    EXPECT_EQ(error.value("abort", ""), refusal.abort);
    EXPECT_FALSE(error.value("abort_text", "").empty());
  }
  EXPECT_EQ(response.allow.empty(), refusal.status != 405);
  EXPECT_EQ(state_of(line_), before);
}

INSTANTIATE_TEST_SUITE_P(BenchApi, Refusals, testing::ValuesIn(refusals),
                         [](const auto& one) { return std::string(one.param.name); });

TEST_F(BenchApi, AllowNamesTheMethods) { EXPECT_EQ(ask(Method::put, "/axes/left/faults").allow, "GET, POST, DELETE"); }

TEST_F(BenchApi, PowerOffForgets) {
  ask(Method::put, "/axes/right/objects/6081/0", R"({"value": 4321})");
  EXPECT_EQ(ask(Method::post, "/axes/right/power", R"({"action":"off"})").body, R"({"powered":false})");
  EXPECT_FALSE(get("/axes/right").contains("state"));
  const Response response = ask(Method::get, "/axes/right/objects/6081/0");
  EXPECT_EQ(response.status, 409U);
  EXPECT_THAT(response.body, HasSubstr("no power"));
  pass(10ms);
  EXPECT_EQ(ask(Method::post, "/axes/right/power", R"({"action":"on"})").body, R"({"powered":true})");
  pass(10ms);
  EXPECT_NE(get("/axes/right/objects/6081/0")["value"], 4321);
  EXPECT_EQ(ask(Method::post, "/axes/right/power", R"({"action":"cycle"})").body, R"({"powered":true})");
}

TEST_F(BenchApi, ForcedInputsReachTheDriveAndGoBack) {
  const auto inputs = [this] { return get("/axes/left/objects/60FD/0")["value"].get<int>() & 0x3F; };
  EXPECT_EQ(inputs(), 4);  // the home switch
  ask(Method::put, "/axes/left/inputs", R"({"DI0": true, "DI2": false, "DI5": true})");
  pass(5ms);
  EXPECT_EQ(inputs(), 0x21);
  const json listed = get("/axes/left/inputs")["inputs"];
  EXPECT_EQ(listed["DI0"], (json{{"level", true}, {"forced", true}}));
  EXPECT_EQ(listed["DI1"], (json{{"level", false}, {"forced", false}}));
  EXPECT_EQ(listed["DI2"], (json{{"level", false}, {"forced", true}}));
  EXPECT_EQ(listed.size(), 6U);
  ask(Method::put, "/axes/left/inputs", R"({"DI0": null, "DI2": null, "DI5": null})");
  pass(5ms);
  EXPECT_EQ(inputs(), 4);
}

TEST_F(BenchApi, ThePlantCanBePushed) {
  const Response response = ask(Method::put, "/axes/right/plant",
                                R"({"load_torque_nm": -0.5, "load_inertia_kgm2": 0.001, "friction_nm": 0.02,
                                    "supply_v": 300, "ambient_c": 30, "position_counts": 777})");
  ASSERT_EQ(response.status, 200U) << response.body;
  const json plant = get("/axes/right/plant");
  EXPECT_EQ(plant, json::parse(response.body));
  EXPECT_EQ(plant["load_torque_nm"], -0.5);
  EXPECT_EQ(plant["load_inertia_kgm2"], 0.001);
  EXPECT_EQ(plant["friction_nm"], 0.02);
  EXPECT_EQ(plant["supply_v"], 300.0);
  EXPECT_EQ(plant["ambient_c"], 30.0);
  EXPECT_EQ(plant["position_counts"], 777);
  EXPECT_EQ(plant["locked_rotor"], false);
  pass(100ms);  // 0.5 Nm in positive direction, and nothing holds the shaft
  EXPECT_GT(get("/axes/right")["position_counts"], 10000);
  ask(Method::put, "/axes/right/plant", R"({"locked_rotor": true})");
  pass(50ms);
  EXPECT_EQ(get("/axes/right/plant")["locked_rotor"], true);
  EXPECT_EQ(get("/axes/right")["velocity_rpm"], 0.0);
  // The errors of the encoder, some arc seconds each, are up to 4 counts.
  EXPECT_NEAR(get("/axes/right/objects/6063/0")["value"].get<double>(),
              get("/axes/right")["position_counts"].get<double>(), 4.0);
}

TEST_F(BenchApi, InjectedFaultsReachTheDrive) {
  const json before = get("/axes/left/faults");
  EXPECT_EQ(before["active"], json::array());
  EXPECT_EQ(before["injected"], json::array());
  EXPECT_EQ(before["injectable"]["plant"].size(), plant::injection_names.size());
  ASSERT_EQ(ask(Method::post, "/axes/left/faults", R"({"inject":"encoder_loss"})").status, 200U);
  pass(50ms);
  EXPECT_EQ(get("/axes/left/faults")["injected"], json::array({"encoder_loss"}));
  ASSERT_EQ(get("/axes/left")["faults"].size(), 1U);
  const std::string code = get("/axes/left")["faults"][0]["code"];
  EXPECT_EQ(fmt::format("0x{:04X}", get("/axes/left")["error_code"].get<int>()), code);
  EXPECT_EQ(get("/axes/left")["state"], "fault");
  ask(Method::delete_, "/axes/left/faults", R"({"inject":"encoder_loss"})");
  EXPECT_EQ(get("/axes/left/faults")["injected"], json::array());
}

// Faults of the ISMC that are off by factory setting are switched on: 2017h bit 1 (ch. 5, 8900h) and 2200h.
TEST_F(BenchApi, EveryFaultOfADriveCanBeInjectedByItsCode) {
  for (const char* axis : {"left", "right"}) {
    const std::string target = fmt::format("/axes/{}", axis);
    const json faults = get(target + "/faults");
    for (const json& fault : faults["injectable"]["drive"]) {
      const std::string code = fault["code"];
      ask(Method::post, target + "/power", R"({"action":"cycle"})");
      dictionary::Dictionary& ismc = line_.find_axis("left")->device().dictionary();
      ismc.set_number(0x2017, 0, 2);
      ismc.set_number(0x2200, 1, 1000);
      pass(50ms);
      ASSERT_EQ(get(target)["faults"], json::array()) << code;
      ASSERT_EQ(ask(Method::post, target + "/faults", fmt::format(R"({{"inject":"{}"}})", code)).status, 200U);
      pass(50ms);
      const json view = get(target);
      EXPECT_THAT(view["faults"].dump() + view["warnings"].dump(), HasSubstr(code)) << axis;
      ask(Method::delete_, target + "/faults");
      EXPECT_EQ(get(target + "/faults")["injected"], json::array());
    }
  }
}

// Two alarms of an iSMK have the code 7331h; their causes distinguish them. The iSMK keeps a history of both without
// objects for it.
TEST(BenchFaults, CausesAndHistory) {
  Line line(settings_of(R"(
clock = "virtual"
[[bus]]
name = "can0"
[[axis]]
name = "joint"
product = "ismk"
)"));
  line.run_until(500ms);
  const auto ask = [&line](Method method, const std::string& target, const std::string& body = {}) {
    const Response response = handle(line, {.method = method, .target = "/api/v1/axes/joint" + target, .body = body});
    EXPECT_LT(response.status, 300U) << response.body;
    return response.body.empty() ? json() : json::parse(response.body);
  };
  EXPECT_EQ(ask(Method::get, "/faults")["history"], json::array());
  ask(Method::put, "/objects/2605/3", R"({"value": 65535})");  // also keeps alarms of a motor that is not enabled
  for (const char* cause : {"encoder_connection", "brake_resistor", "motor_contact"}) {
    ask(Method::post, "/faults", fmt::format(R"({{"inject":"{}"}})", cause));
    line.run_until(line.now() + 20ms);
    ask(Method::delete_, "/faults");
  }
  EXPECT_EQ(ask(Method::get, "/objects/2601/0")["value"], 0x2102);
  const json history = ask(Method::get, "/faults")["history"];
  ASSERT_EQ(history.size(), 3U);
  EXPECT_EQ(history[0]["code"], "0x4310");
  EXPECT_EQ(history[1]["name"], "Chop resistor");
  EXPECT_EQ(history[2]["code"], "0x7331");
  EXPECT_EQ(history[0]["mode"], -4);
  EXPECT_EQ(history[0]["power_stage_on"], false);
  EXPECT_NEAR(history[0]["dc_link_v"].get<double>(), 48.0, 1.0);
}

TEST_F(BenchApi, BusesShowTheirTraffic) {
  const json bus = get("/buses")["buses"][0];
  EXPECT_EQ(bus, get("/buses/can0"));
  EXPECT_EQ(bus["name"], "can0");
  EXPECT_EQ(bus["bit_rate"], 1'000'000);
  EXPECT_GE(bus["frames"], 2);  // two boot-up messages
  EXPECT_EQ(bus["axes"]["left"]["error_state"], "active");
  EXPECT_EQ(bus["disturbance"], nullptr);
}

TEST_F(BenchApi, ADisturbedBusLosesAnswers) {
  links::MemoryPort master(line_.buses()[0]->bus);
  const auto answered = [&](std::uint8_t node) {
    while (master.receive()) {
    }
    master.send(sdo_read(node, 0x1000, 0), line_.now());
    pass(5ms);
    return master.receive().has_value();
  };
  EXPECT_TRUE(answered(1));
  const Response response = ask(Method::post, "/buses/can0/disturb", R"({"drop": 1, "axis": "left", "seed": 9})");
  ASSERT_EQ(response.status, 200U) << response.body;
  EXPECT_EQ(json::parse(response.body)["disturbance"]["drop"], 1.0);
  EXPECT_FALSE(answered(1));
  EXPECT_TRUE(answered(2));
  EXPECT_EQ(get("/buses/can0")["dropped"], 1);

  ask(Method::post, "/buses/can0/disturb", R"({"cut": true, "axis": "right"})");
  EXPECT_TRUE(answered(1));  // the new disturbance replaces the old
  EXPECT_FALSE(answered(2));
  EXPECT_EQ(get("/buses/can0")["axes"]["right"]["cut"], true);

  ask(Method::delete_, "/buses/can0/disturb");
  EXPECT_TRUE(answered(1));
  EXPECT_TRUE(answered(2));

  ask(Method::post, "/buses/can0/disturb", R"({"drop": 1, "id": 1409})");  // 581h
  EXPECT_FALSE(answered(1));
  EXPECT_TRUE(answered(2));
  ask(Method::post, "/buses/can0/disturb", R"({"cut": true})");
  EXPECT_EQ(get("/buses/can0")["cut"], true);
  EXPECT_FALSE(answered(2));
}

TEST_F(BenchApi, TimePassesWhenItIsTold) {
  const json before = get("/clock");
  EXPECT_EQ(before["mode"], "virtual");
  EXPECT_EQ(before["time_ns"], 50'000'000);
  EXPECT_EQ(before["ticks"], 800);
  const json after = json::parse(ask(Method::post, "/clock/advance", R"({"ms": 0.25})").body);
  EXPECT_EQ(after["time_ns"], 50'250'000);
  EXPECT_EQ(after["ticks"], 804);
  EXPECT_EQ(get("/clock"), after);
}

TEST(BenchApiClock, RealTimeCannotBeAdvanced) {
  Line line(settings_of("[[bus]]\nname='can0'\n[[axis]]\nname='x'\nproduct='ismc'\n"));
  const Response response =
      handle(line, {.method = Method::post, .target = "/api/v1/clock/advance", .body = R"({"ms":1})"});
  EXPECT_EQ(response.status, 409U);
  EXPECT_EQ(line.now(), Time{});
  EXPECT_THAT(handle(line, {.target = "/api/v1/clock"}).body, HasSubstr(R"("lag_count":0)"));
}

TEST_F(BenchApi, VersionSaysWho) {
  EXPECT_EQ(get("/version")["name"], "servodrome");
  EXPECT_EQ(get("/version")["api"], 1);
}

TEST_F(BenchApi, RandomRequestsAreAnsweredAndRefusalsChangeNothing) {
  RequestGenerator generator(20240607);
  std::array<int, 600> counts{};
  for (int i = 0; i < servodrome::test::draws(100'000); ++i) {
    const Request request = generator.next();
    const bool watch = i % 10 == 0;
    const std::string before = watch ? state_of(line_) : std::string();
    const Response response = handle(line_, request);
    ASSERT_LT(response.status, 500U) << request.target << " " << request.body;
    ++counts[response.status];
    if (response.status == 204) {
      ASSERT_TRUE(response.body.empty());
    } else {
      ASSERT_TRUE(json::accept(response.body)) << request.target << " " << request.body;
    }
    if (watch && response.status >= 400) {
      ASSERT_EQ(state_of(line_), before) << request.target << " " << request.body;
    }
    if (i % 100 == 0) pass(1ms);
    if (i % 5000 == 0) {  // gives the drives power again for the next requests
      for (const char* axis : {"left", "right"})
        ask(Method::post, fmt::format("/axes/{}/power", axis), R"({"action":"on"})");
    }
  }
  for (const unsigned status : {200U, 204U, 400U, 404U, 405U, 409U, 422U})
    EXPECT_GT(counts[status], servodrome::test::draws(100)) << status;
}

// --- Access control

struct Visit {
  const char* name;
  Method method;
  const char* host;
  const char* origin;  // nullptr: none
  const char* authorization;
  bool from_loopback;
  unsigned status;  // 0: the request is allowed
};

void PrintTo(const Visit& visit, std::ostream* out) { *out << visit.name; }

const std::vector<Visit> visits{
    {"local_read", Method::get, "127.0.0.1:8402", nullptr, "", true, 0},
    {"local_write", Method::put, "127.0.0.1:8402", nullptr, "", true, 0},
    {"local_write_by_name", Method::put, "LocalHost:8402", nullptr, "", true, 0},
    {"local_write_ipv6", Method::delete_, "[::1]:8402", nullptr, "", true, 0},
    {"studio_write", Method::put, "127.0.0.1:8402", "http://127.0.0.1:8402", "", true, 0},
    {"studio_read", Method::get, "localhost:8402", "http://localhost:8402", "", true, 0},
    {"page_write", Method::put, "127.0.0.1:8402", "https://example.org", "", true, 403},
    {"page_of_another_port", Method::post, "127.0.0.1:8402", "http://127.0.0.1:9000", "", true, 403},
    {"page_from_a_file", Method::post, "127.0.0.1:8402", "null", "", true, 403},
    {"empty_origin", Method::post, "127.0.0.1:8402", "", "", true, 403},
    {"page_with_token", Method::put, "127.0.0.1:8402", "https://example.org", "Bearer secret", true, 0},
    {"rebound_read", Method::get, "evil.example:8402", nullptr, "", true, 403},
    {"rebound_write", Method::put, "evil.example:8402", "http://evil.example:8402", "", true, 403},
    {"no_host", Method::get, "", nullptr, "", true, 403},
    {"odd_host", Method::get, "[::1", nullptr, "", true, 403},
    {"name_with_token", Method::put, "bench.example:8402", nullptr, "bearer secret", false, 0},
    {"remote_read", Method::get, "192.168.1.5:8402", nullptr, "", false, 0},
    {"remote_write", Method::put, "192.168.1.5:8402", nullptr, "", false, 401},
    {"remote_studio_write", Method::put, "192.168.1.5:8402", "http://192.168.1.5:8402", "", false, 401},
    {"remote_write_with_token", Method::put, "192.168.1.5:8402", nullptr, "Bearer secret", false, 0},
    {"wrong_token", Method::put, "127.0.0.1:8402", nullptr, "Bearer Secret", true, 401},
    {"short_token", Method::get, "127.0.0.1:8402", nullptr, "Bearer ", true, 401},
    {"basic", Method::get, "127.0.0.1:8402", nullptr, "Basic secret", true, 401},
};

class Visits : public testing::TestWithParam<Visit> {};

TEST_P(Visits, PassOrDoNot) {
  const Visit& visit = GetParam();
  const auto refusal = refuse({.token = "secret"}, {.method = visit.method,
                                                    .target = "/api/v1/axes",
                                                    .host = visit.host,
                                                    .origin = visit.origin != nullptr ? visit.origin : "",
                                                    .authorization = visit.authorization,
                                                    .has_origin = visit.origin != nullptr,
                                                    .from_loopback = visit.from_loopback});
  EXPECT_EQ(refusal ? refusal->status : 0, visit.status);
}

INSTANTIATE_TEST_SUITE_P(Access, Visits, testing::ValuesIn(visits),
                         [](const auto& one) { return std::string(one.param.name); });

TEST(Access, TokensAreLongAndDiffer) {
  ::unsetenv("SERVODROME_TOKEN");
  EXPECT_EQ(make_token().size(), 32U);
  EXPECT_NE(make_token(), make_token());
  ::setenv("SERVODROME_TOKEN", "given", 1);
  EXPECT_EQ(make_token(), "given");
  ::unsetenv("SERVODROME_TOKEN");
}

}  // namespace
}  // namespace line_bench_api_test
}  // namespace servodrome::line::bench
