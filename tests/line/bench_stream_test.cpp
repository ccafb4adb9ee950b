#include <cmath>
#include <cstring>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <map>
#include <nlohmann/json.hpp>

#include "api/scope/frame.hpp"
#include "api/version.hpp"
#include "line/bench/line_bench.hpp"
#include "line/bench/scope/line_scope.hpp"
#include "support.hpp"

namespace servodrome::line::bench {
namespace bench_stream_test {
namespace {

using namespace test;
using namespace api;
using nlohmann::json;
using testing::HasSubstr;

struct Frame {
  FrameHeader header;
  std::vector<std::vector<double>> channels;
};

Frame frame_of(const std::string& bytes) {
  Frame frame;
  EXPECT_GE(bytes.size(), sizeof frame.header);
  std::memcpy(&frame.header, bytes.data(), sizeof frame.header);
  EXPECT_EQ(bytes.size(), sizeof frame.header + 8UL * frame.header.samples * frame.header.channels);
  const char* next = bytes.data() + sizeof frame.header;
  for (unsigned channel = 0; channel < frame.header.channels; ++channel) {
    auto& values = frame.channels.emplace_back(frame.header.samples);
    std::memcpy(values.data(), next, values.size() * sizeof(double));
    next += values.size() * sizeof(double);
  }
  return frame;
}

// A client that reads everything immediately, or nothing: `waiting` is then the number of bytes not read.
class Inbox final : public Outbox {
 public:
  void text(std::string message) override { texts.push_back(json::parse(message)); }
  void binary(std::string message) override {
    frames.push_back(frame_of(message));
    if (stuck) waiting += message.size();
  }
  std::size_t queued() const override { return waiting; }
  void close(const std::string& why) override { reason = why; }

  std::vector<json> of(const std::string& key) const {
    std::vector<json> found;
    for (const json& message : texts) {
      if (message.contains(key)) found.push_back(message[key]);
    }
    return found;
  }
  // The values of one subscription by tick. A tick that comes twice is a failure.
  std::map<std::uint64_t, double> samples(std::uint32_t id, std::size_t channel = 0) const {
    std::map<std::uint64_t, double> values;
    for (const Frame& frame : frames) {
      if (frame.header.id != id) continue;
      for (std::uint32_t n = 0; n < frame.header.samples; ++n) {
        const std::uint64_t tick = frame.header.first_tick + std::uint64_t{n} * frame.header.stride;
        EXPECT_TRUE(values.emplace(tick, frame.channels[channel][n]).second) << "tick " << tick << " twice";
      }
    }
    return values;
  }

  std::vector<json> texts;
  std::vector<Frame> frames;
  std::string reason;
  bool stuck = false;
  std::size_t waiting = 0;
};

// A line with a motion: "left" turns under a load torque that a script changes, "right" stands still.
struct Bench {
  explicit Bench(bool with_scope = true) : line(settings_of(two_axes)) {
    if (with_scope) scope = std::make_unique<LineScope>(line);
  }

  json ask(Method method, const std::string& target, const std::string& body = {}, unsigned status = 200) {
    const std::array groups{RouteGroup{recording_routes(), scope ? &scope->scope() : nullptr}};
    const Response response = handle(line, {.method = method, .target = "/api/v1" + target, .body = body}, groups);
    EXPECT_EQ(response.status, status) << target << " " << response.body;
    std::string text = response.body;
    while (response.more) {
      const std::string part = response.more();
      if (part.empty()) break;
      text += part;
    }
    raw = text;
    return json::accept(text) ? json::parse(text) : json();
  }
  void push(double torque_nm) { line.axes()[0]->plant().set_external_torque_nm(torque_nm); }
  void pass(Time time) { line.run_until(line.now() + time); }
  std::uint64_t tick() const { return static_cast<std::uint64_t>(line.now() / tick_length); }

  Line line;
  std::unique_ptr<LineScope> scope;
  std::string raw;
};

const WallTime noon = WallTime() + 1h;

const std::string subscribe_16k = R"({"subscribe":{"id":1,"channels":[{"axis":"left","signal":"position_counts"},
  {"axis":"left","signal":"velocity_rpm"},{"axis":"left","object":"6064:00"},{"axis":"right","object":"6041"}],
  "rate_hz":16000}})";

TEST(BenchStream, SaysHelloWithAnIdentifierOfTheRun) {
  Bench bench;
  Inbox inbox;
  StreamSession session(bench.scope->scope(), inbox);
  const json hello = inbox.of("hello").at(0);
  EXPECT_EQ(hello["tick"], 0);
  EXPECT_EQ(hello["start"].get<std::string>().size(), 16U);
  EXPECT_EQ(hello["start"], api::run_name());
}

// Positions and velocities of `left` after each tick, read while the test advances the line one tick at a time.
std::map<std::uint64_t, std::pair<double, double>> watched_by_hand() {
  Bench bench(false);
  std::map<std::uint64_t, std::pair<double, double>> values;
  for (int n = 0; n < 4000; ++n) {
    if (n == 160) bench.push(0.3);
    if (n == 2000) bench.push(-0.4);
    bench.pass(tick_length);
    const plant::Plant& plant = bench.line.axes()[0]->plant();
    values[bench.tick()] = {static_cast<double>(plant.position_counts()), plant.velocity_rpm()};
  }
  return values;
}

TEST(BenchStream, AStreamAt16kHzHasEachTickOnceAndChangesNothing) {
  const auto expected = watched_by_hand();
  Bench bench;
  Inbox inbox;
  StreamSession session(bench.scope->scope(), inbox);
  session.receive(subscribe_16k, noon);
  const json subscribed = inbox.of("subscribed").at(0);
  EXPECT_EQ(subscribed["rate_hz"], 16000);
  EXPECT_EQ(subscribed["tick"], 1);
  EXPECT_EQ(subscribed["channels"][1]["unit"], "rpm");
  EXPECT_EQ(subscribed["channels"][2]["object"], "6064:00");
  // Here time advances in other steps than in watched_by_hand().
  bench.pass(160 * tick_length);
  bench.push(0.3);
  bench.pass(1840 * tick_length);
  bench.push(-0.4);
  bench.pass(2000 * tick_length);
  const auto positions = inbox.samples(1, 0);
  const auto velocities = inbox.samples(1, 1);
  ASSERT_EQ(positions.size(), 4000U);
  EXPECT_NE(expected.at(4000).first, 0) << "something moved";
  for (const auto& [tick, value] : expected) {
    ASSERT_EQ(positions.at(tick), value.first) << tick;
    ASSERT_EQ(velocities.at(tick), value.second) << tick;
  }
  EXPECT_EQ(inbox.samples(1, 3).at(4000), bench.ask(Method::get, "/axes/right")["statusword"].get<double>());
}

TEST(BenchStream, ASlowerRateHasTheSameValuesAtItsTicks) {
  Bench bench;
  Inbox inbox;
  StreamSession session(bench.scope->scope(), inbox);
  session.receive(subscribe_16k, noon);
  session.receive(R"({"subscribe":{"id":7,"channels":[{"axis":"left","signal":"position_counts"}],"rate_hz":900}})",
                  noon);
  EXPECT_DOUBLE_EQ(inbox.of("subscribed").at(1)["rate_hz"].get<double>(), 16000.0 / 16) << "800 is farther than 1000";
  bench.push(0.3);
  bench.pass(100ms);
  const auto all = inbox.samples(1);
  const auto some = inbox.samples(7);
  ASSERT_EQ(some.size(), 100U);
  for (const auto& [tick, value] : some) {
    EXPECT_EQ(tick % 16, 0U);
    EXPECT_EQ(value, all.at(tick));
  }
}

TEST(BenchStream, GoesOnThroughAPowerCycle) {
  Bench bench;
  Inbox inbox;
  StreamSession session(bench.scope->scope(), inbox);
  bench.pass(20ms);
  session.receive(subscribe_16k, noon);
  bench.pass(10ms);
  bench.ask(Method::post, "/axes/right/power", R"({"action":"off"})");
  bench.pass(10ms);
  bench.ask(Method::post, "/axes/right/power", R"({"action":"on"})");
  bench.pass(10ms);
  const auto statusword = inbox.samples(1, 3);
  ASSERT_EQ(statusword.size(), 480U);
  for (const auto& [tick, value] : statusword) EXPECT_EQ(std::isnan(value), tick > 480 && tick <= 640) << tick;
  std::vector<std::string> kinds;
  for (const json& event : inbox.of("event")) {
    if (event["axis"] == "right") kinds.push_back(event["kind"].get<std::string>());
  }
  EXPECT_THAT(kinds, testing::Contains("power").Times(2));
}

TEST(BenchStream, EndsWithTheSubscriptionOrTheClient) {
  Bench bench;
  Inbox inbox;
  auto session = std::make_unique<StreamSession>(bench.scope->scope(), inbox);
  session->receive(subscribe_16k, noon);
  bench.pass(10ms);
  session->receive(R"({"unsubscribe":{"id":1}})", noon);
  bench.pass(10ms);
  EXPECT_EQ(inbox.samples(1).size(), 160U);
  // Subscribes again with the same id: the samples begin at the present tick.
  session->receive(subscribe_16k, noon);
  bench.pass(10ms);
  EXPECT_EQ(inbox.samples(1).size(), 320U);
  EXPECT_EQ(inbox.samples(1).count(321), 1U);
  session.reset();
  bench.pass(10ms);
  EXPECT_EQ(inbox.samples(1).size(), 320U);
  // A page that connects again.
  Inbox second;
  StreamSession again(bench.scope->scope(), second);
  EXPECT_EQ(second.of("hello").at(0)["start"], inbox.of("hello").at(0)["start"]);
  again.receive(subscribe_16k, noon);
  bench.pass(10ms);
  EXPECT_EQ(second.samples(1).begin()->first, 641U);
  EXPECT_EQ(second.samples(1).size(), 160U);
}

TEST(BenchStream, ASlowClientLosesResolutionAndIsGivenUpInTheEnd) {
  Bench bench;
  Inbox slow;
  Inbox quick;
  StreamSession slow_session(bench.scope->scope(), slow);
  StreamSession quick_session(bench.scope->scope(), quick);
  slow_session.receive(subscribe_16k, noon);
  quick_session.receive(subscribe_16k, noon);
  slow.stuck = true;
  bench.pass(4s);
  EXPECT_EQ(quick.samples(1).size(), 64000U);
  EXPECT_GT(slow.frames.back().header.stride, 1U);
  const auto all = quick.samples(1);
  for (const auto& [tick, value] : slow.samples(1)) ASSERT_EQ(value, all.at(tick));
  // The client reads again: the resolution rises after some wall-clock time.
  slow.stuck = false;
  slow.waiting = 0;
  Subscription subscription(
      9, {bench.scope->source().taps().open(signal_channel(*bench.line.axes()[0], "velocity_rpm"), 1)});
  for (const std::size_t queued : {600'000U, 1'200'000U, 1'800'000U}) subscription.adapt(queued, noon);
  EXPECT_EQ(subscription.stride(), 8);
  subscription.adapt(0, noon + 500ms);
  EXPECT_EQ(subscription.stride(), 8);
  for (int n = 1; n <= 3; ++n) subscription.adapt(0, noon + n * 1100ms);
  EXPECT_EQ(subscription.stride(), 1);
  // The client reads nothing: it gets no more samples, and the session ends.
  slow.waiting = StreamSession::most_queued;
  const std::size_t frames = slow.frames.size();
  slow_session.send_samples(static_cast<std::int64_t>(bench.tick()) + 1, noon);
  slow_session.send_samples(static_cast<std::int64_t>(bench.tick()) + 1, noon + 9s);
  EXPECT_EQ(slow.reason, "");
  slow_session.send_samples(static_cast<std::int64_t>(bench.tick()) + 1, noon + 11s);
  EXPECT_EQ(slow.frames.size(), frames);
  EXPECT_THAT(slow.reason, HasSubstr("too slow"));
}

TEST(BenchStream, WatchTellsTheAxesThatChanged) {
  Bench bench;
  Inbox inbox;
  StreamSession session(bench.scope->scope(), inbox);
  bench.pass(50ms);
  session.receive(R"({"watch":{"axes":20}})", noon);
  session.attend(noon);
  const json first = inbox.texts.back();
  ASSERT_EQ(first["axes"].size(), 2U);
  EXPECT_EQ(first["axes"][0], bench.ask(Method::get, "/axes/left"));
  EXPECT_EQ(first["clock"], bench.ask(Method::get, "/clock"));
  const std::size_t count = inbox.texts.size();
  session.attend(noon + 20ms);
  session.attend(noon + 60ms);
  EXPECT_EQ(inbox.texts.size(), count) << "nothing has changed";
  bench.line.axes()[1]->force_input(0, true);
  bench.ask(Method::put, "/axes/right/plant", R"({"position_counts":77})");
  session.attend(noon + 120ms);
  ASSERT_EQ(inbox.texts.back()["axes"].size(), 1U);
  EXPECT_EQ(inbox.texts.back()["axes"][0]["position_counts"], 77);
  session.receive(R"({"watch":{"axes":0}})", noon);
  bench.pass(5ms);
  session.attend(noon + 1s);
  EXPECT_FALSE(inbox.texts.back().contains("clock") && inbox.texts.back()["clock"]["time_ms"] == 55.0);
}

TEST(BenchStream, RefusesWhatIsNoMessage) {
  Bench bench;
  Inbox inbox;
  StreamSession session(bench.scope->scope(), inbox);
  const std::string many = [] {
    std::string list;
    for (int i = 0; i < 17; ++i) list += std::string(i == 0 ? "" : ",") + R"({"axis":"left","signal":"DI0"})";
    return R"({"subscribe":{"id":3,"channels":[)" + list + "]}}";
  }();
  const std::vector<std::pair<std::string, std::string>> refused{
      {"", "not JSON"},
      {"[]", "an array"},
      {"{}", "one key"},
      {R"({"x":1})", "unknown key"},
      {R"({"subscribe":1})", "instead of an object"},
      {R"({"subscribe":{"channels":[]}})", "id is missing"},
      {R"({"subscribe":{"id":-1,"channels":[]}})", "id is -1"},
      {R"({"subscribe":{"id":4294967296,"channels":[]}})", "id is 4294967296"},
      {R"({"subscribe":{"id":3,"channels":[]}})", "not a list of 1 to 16"},
      {many, "not a list of 1 to 16"},
      {R"({"subscribe":{"id":3,"channels":[{"axis":"x","signal":"DI0"}]}})", "no axis \"x\""},
      {R"({"subscribe":{"id":3,"channels":[{"axis":"left"}]}})", "a signal or an object"},
      {R"({"subscribe":{"id":3,"channels":[{"axis":"left","signal":"DI99"}]}})", "no signal \"DI99\""},
      {R"({"subscribe":{"id":3,"channels":[{"axis":"left","object":"zz"}]}})", "is not an object"},
      {R"({"subscribe":{"id":3,"channels":[{"axis":"left","object":"5FFF:00"}]}})", "does not exist"},
      {R"({"subscribe":{"id":3,"channels":[{"axis":"left","object":"1008:00"}]}})", "not a readable number"},
      {R"({"subscribe":{"id":3,"rate_hz":0,"channels":[{"axis":"left","signal":"DI0"}]}})", "rate_hz is 0"},
      {R"({"subscribe":{"id":3,"rate_hz":16001,"channels":[{"axis":"left","signal":"DI0"}]}})", "rate_hz is 16001"},
      {R"({"watch":{"axes":1000}})", "axes is 1000"},
      {std::string(16000, '['), "nested deeper"},
  };
  for (const auto& [message, what] : refused) {
    session.receive(message, noon);
    ASSERT_TRUE(inbox.texts.back().contains("error")) << message;
    EXPECT_THAT(inbox.texts.back()["error"]["what"].get<std::string>(), HasSubstr(what)) << message;
    const bool refers = message.find(R"("id":3)") != std::string::npos;
    EXPECT_EQ(inbox.texts.back().value("id", 0), refers ? 3 : 0) << message;
  }
  bench.pass(20ms);
  EXPECT_TRUE(inbox.frames.empty());
}

TEST(BenchStream, BoundsWhatAClientMayAskFor) {
  Bench bench;
  Inbox inbox;
  StreamSession session(bench.scope->scope(), inbox);
  const auto subscribe = [&](int id) {
    session.receive(R"({"subscribe":{"id":)" + std::to_string(id) +
                        R"(,"channels":[{"axis":"left","signal":"DI0"}],"rate_hz":16000}})",
                    noon);
    return inbox.texts.back();
  };
  for (int id = 0; id < 8; ++id) EXPECT_TRUE(subscribe(id).contains("subscribed"));
  EXPECT_THAT(subscribe(8)["error"]["what"].get<std::string>(), HasSubstr("at most 8"));
  EXPECT_TRUE(subscribe(7).contains("subscribed")) << "replaces the one there is";
  for (int n = 0; n < 300; ++n) session.receive("{}", noon);
  EXPECT_THAT(inbox.reason, HasSubstr("messages in a second"));
  const std::size_t before = inbox.frames.size();
  bench.pass(20ms);
  EXPECT_EQ(inbox.frames.size(), before);
}

TEST(BenchStream, TapsOfAllClientsTogetherAreBounded) {
  Bench bench;
  std::vector<std::shared_ptr<Samples>> taps;
  Axis& left = *bench.line.axes()[0];
  std::vector<Channel> channels;
  for (const dictionary::Entry& entry : left.device().dictionary().table()) {
    if (const Channel channel = object_channel(left, entry); channel.read != nullptr) channels.push_back(channel);
  }
  Axis& right = *bench.line.axes()[1];
  for (const dictionary::Entry& entry : right.device().dictionary().table()) {
    if (const Channel channel = object_channel(right, entry); channel.read != nullptr) channels.push_back(channel);
  }
  ASSERT_GT(channels.size(), 520U);
  const auto open_all = [&] {
    for (const Channel& channel : channels) taps.push_back(bench.scope->source().taps().open(channel, 1));
  };
  EXPECT_THROW(open_all(), ApiError);
  EXPECT_GT(taps.size(), 480U);
  EXPECT_EQ(bench.scope->source().taps().open(channels.front(), 1), taps.front())
      << "another who wants the same costs nothing";
  taps.clear();
  EXPECT_NO_THROW(bench.scope->source().taps().open(channels.back(), 1));
}

// --- Recordings

// The tick after which `left` first turns faster than 10 rpm, after an external torque from tick 1600 on.
std::uint64_t tick_of_10_rpm() {
  Bench bench(false);
  bench.pass(100ms);
  bench.push(-0.3);
  while (bench.line.axes()[0]->plant().velocity_rpm() < 10) bench.pass(tick_length);
  return bench.tick();
}

constexpr const char* on_10_rpm = R"({"name":"push","channels":[{"axis":"left","signal":"velocity_rpm"},
  {"axis":"left","signal":"position_counts"}],"rate_hz":16000,"duration_ms":50,"pre_ms":20,
  "trigger":{"kind":"edge","channel":0,"level":10.0,"slope":"rising"}})";

TEST(BenchRecordings, AnEdgeIsFoundToTheTickWithWhatWasBefore) {
  const std::uint64_t trigger = tick_of_10_rpm();
  ASSERT_GT(trigger, 1600U);
  Bench bench;
  Inbox inbox;
  StreamSession session(bench.scope->scope(), inbox);
  session.receive(subscribe_16k, noon);
  const json made = bench.ask(Method::post, "/recordings", on_10_rpm, 201);
  EXPECT_EQ(made["state"], "armed");
  bench.ask(Method::get, "/recordings/1/data", {}, 409);
  bench.pass(100ms);
  EXPECT_EQ(bench.ask(Method::get, "/recordings/1")["state"], "armed");
  bench.push(-0.3);
  bench.pass(20ms);
  EXPECT_EQ(bench.ask(Method::get, "/recordings/1")["state"], "running");
  bench.pass(100ms);
  const json done = bench.ask(Method::get, "/recordings/1");
  EXPECT_EQ(done["state"], "done");
  EXPECT_EQ(done["name"], "push");
  EXPECT_EQ(done["trigger_tick"], trigger);
  EXPECT_EQ(done["first_tick"], trigger - 320);
  EXPECT_EQ(done["samples"], 800);
  bench.ask(Method::get, "/recordings/1/data");
  const Frame frame = frame_of(bench.raw);
  EXPECT_EQ(frame.header.id, 1U);
  EXPECT_EQ(frame.header.stride, 1U);
  EXPECT_EQ(frame.header.first_tick, trigger - 320);
  ASSERT_EQ(frame.header.samples, 800U);
  EXPECT_LT(frame.channels[0][319], 10);
  EXPECT_GE(frame.channels[0][320], 10);
  const auto positions = inbox.samples(1, 0);
  for (std::uint64_t n = 0; n < 800; ++n) ASSERT_EQ(frame.channels[1][n], positions.at(trigger - 320 + n)) << n;
  std::vector<std::string> states;
  for (const json& event : inbox.of("event")) {
    if (event["kind"] == "recording") states.push_back(event["recording"]["state"]);
  }
  EXPECT_EQ(states, (std::vector<std::string>{"running", "done"}));
}

TEST(BenchRecordings, ASlowRecordingIsTriggeredToTheTickToo) {
  const std::uint64_t trigger = tick_of_10_rpm();
  Bench bench;
  bench.ask(Method::post, "/recordings",
            R"({"channels":[{"axis":"left","signal":"velocity_rpm"}],"rate_hz":100,"duration_ms":100,"pre_ms":50,
                "trigger":{"kind":"edge","level":10.0}})",
            201);
  bench.pass(100ms);
  bench.push(-0.3);
  bench.pass(200ms);
  const json done = bench.ask(Method::get, "/recordings/1");
  EXPECT_EQ(done["trigger_tick"], trigger);
  EXPECT_EQ(done["samples"], 10);
  EXPECT_EQ(done["first_tick"], (trigger + 159) / 160 * 160 - 5 * 160);
}

TEST(BenchRecordings, WhatWasBeforeTheBeginningIsNotThereAndTheLengthIsKept) {
  Bench bench;
  bench.pass(10ms);
  bench.ask(Method::post, "/recordings",
            R"({"channels":[{"axis":"left","signal":"DI0"}],"rate_hz":16000,"duration_ms":10,"pre_ms":5})", 201);
  bench.pass(20ms);
  const json done = bench.ask(Method::get, "/recordings/1");
  EXPECT_EQ(done["state"], "done");
  EXPECT_EQ(done["trigger_tick"], 161);
  EXPECT_EQ(done["first_tick"], 161);
  EXPECT_EQ(done["samples"], 160) << "10 ms, all after the trigger";
}

TEST(BenchRecordings, LevelsAndStatesTrigger) {
  Bench bench;
  bench.pass(50ms);
  bench.ask(Method::post, "/recordings",
            R"({"channels":[{"axis":"left","signal":"velocity_rpm"}],"duration_ms":5,
                "trigger":{"kind":"level","level":5,"slope":"falling"}})",
            201);
  bench.ask(Method::post, "/recordings",
            R"({"channels":[{"axis":"left","signal":"velocity_rpm"}],"duration_ms":5,
                "trigger":{"kind":"state","axis":"left","state":"ready to switch on"}})",
            201);
  bench.ask(Method::post, "/recordings",
            R"({"channels":[{"axis":"left","signal":"velocity_rpm"}],"duration_ms":5,
                "trigger":{"kind":"state","axis":"left","state":"operation enabled"}})",
            201);
  bench.pass(20ms);
  bench.ask(Method::put, "/axes/left/objects/6040/0", R"({"value":6})", 204);
  bench.pass(20ms);
  EXPECT_EQ(bench.ask(Method::get, "/recordings/1")["trigger_tick"], 801) << "it was so already";
  const json state = bench.ask(Method::get, "/recordings/2");
  EXPECT_EQ(state["state"], "done");
  EXPECT_GT(state["trigger_tick"], 1120);
  EXPECT_LT(state["trigger_tick"], 1120 + 48);
  EXPECT_EQ(bench.ask(Method::get, "/recordings/3")["state"], "armed");
  const json stopped = bench.ask(Method::post, "/recordings/3/stop");
  EXPECT_EQ(stopped["state"], "stopped");
  EXPECT_EQ(stopped["trigger_tick"], nullptr);
  EXPECT_EQ(stopped["samples"], 80) << "the last of what there was";
  bench.ask(Method::get, "/recordings/3/data.csv");
  EXPECT_THAT(bench.raw, testing::StartsWith("tick,time_s,left velocity_rpm [rpm]\r\n"));
  EXPECT_EQ(std::count(bench.raw.begin(), bench.raw.end(), '\n'), 81);
  bench.ask(Method::delete_, "/recordings/3", {}, 204);
  bench.ask(Method::get, "/recordings/3", {}, 404);
  EXPECT_EQ(bench.ask(Method::get, "/recordings")["recordings"].size(), 2U);
}

// The conditions of `servodrome scope`, with the same words.
TEST(BenchRecordings, HaveTheConditionsOfTheCommand) {
  Bench bench;
  bench.pass(50ms);
  const auto recording = [&bench](const std::string& trigger, unsigned status = 201) {
    return bench.ask(Method::post, "/recordings",
                     R"({"channels":[{"axis":"left","object":"6041"},{"axis":"left","signal":"velocity_rpm"}],)"
                     R"("duration_ms":5,"trigger":)" +
                         trigger + "}",
                     status);
  };
  recording(R"({"kind":"sets","value":1})");                 // 1: bit 0 of the statusword
  recording(R"({"kind":"lacks","value":1})");                // 2: it is 0 already
  recording(R"({"kind":"changes","channel":0})");            // 3
  recording(R"({"kind":">","channel":1,"value":1})");        // 4: the axis rests
  recording(R"({"kind":"edge","channel":0,"level":0.5})");   // 5
  recording(R"({"kind":"rises","channel":0,"value":0.5})");  // 6: the same
  bench.pass(20ms);
  bench.ask(Method::put, "/axes/left/objects/6040/0", R"({"value":6})", 204);
  bench.pass(20ms);
  const auto tick = [&bench](int id) {
    return bench.ask(Method::get, fmt::format("/recordings/{}", id))["trigger_tick"];
  };
  EXPECT_EQ(tick(2), 801);
  ASSERT_TRUE(tick(1).is_number()) << tick(1);
  EXPECT_GT(tick(1), 1120);
  EXPECT_EQ(tick(3), tick(1)) << "ready to switch on";
  EXPECT_TRUE(tick(4).is_null());
  EXPECT_EQ(tick(5), tick(6));
  recording(R"({"kind":"rises"})", 400);              // no value
  recording(R"({"kind":"changes","value":1})", 400);  // one too many
  recording(R"({"kind":"rise","value":1})", 422);     // no such condition
  EXPECT_THAT(bench.raw, testing::HasSubstr("did you mean `rises`?"));
}

TEST(BenchRecordings, NameAndNoteCanBeChanged) {
  Bench bench;
  Inbox inbox;
  StreamSession session(bench.scope->scope(), inbox);
  const json made =
      bench.ask(Method::post, "/recordings",
                R"({"name":"push","note":"before","channels":[{"axis":"left","signal":"supply_v"}]})", 201);
  EXPECT_EQ(made["note"], "before");
  const json named = bench.ask(Method::put, "/recordings/1", R"({"name":"gr\u00f6\u00dfer"})");
  EXPECT_EQ(named["name"], "gr\u00f6\u00dfer");
  EXPECT_EQ(named["note"], "before") << "what the body does not name stays";
  EXPECT_EQ(bench.ask(Method::put, "/recordings/1", R"({"note":""})")["note"], "");
  bench.ask(Method::put, "/recordings/1", R"({"name":"x","colour":"red"})", 400);
  bench.ask(Method::put, "/recordings/1", R"({"name":7})", 400);
  bench.ask(Method::put, "/recordings/1", json{{"name", "x"}, {"note", std::string(4001, 'a')}}.dump(), 422);
  bench.ask(Method::post, "/recordings",
            json{{"name", std::string(101, 'a')}, {"channels", {{{"axis", "left"}, {"signal", "supply_v"}}}}}.dump(),
            422);
  EXPECT_EQ(bench.ask(Method::get, "/recordings/1")["name"], "gr\u00f6\u00dfer") << "a refusal changes nothing";
  EXPECT_EQ(bench.ask(Method::get, "/recordings")["recordings"].size(), 1U);
  bench.ask(Method::put, "/recordings/2", R"({"name":"x"})", 404);
}

TEST(BenchRecordings, AFaultLeavesItsMomentBehind) {
  Bench bench;
  Inbox inbox;
  StreamSession session(bench.scope->scope(), inbox);
  bench.pass(1s);
  bench.ask(Method::post, "/recordings",
            R"({"channels":[{"axis":"right","signal":"supply_v"}],"duration_ms":20,"pre_ms":10,
                "trigger":{"kind":"fault"}})",
            201);
  bench.ask(Method::post, "/axes/left/faults", R"({"inject":"encoder_loss"})");
  bench.pass(200ms);
  const json list = bench.ask(Method::get, "/recordings")["recordings"];
  ASSERT_EQ(list.size(), 2U);
  EXPECT_EQ(list[0]["state"], "done");
  EXPECT_EQ(list[0]["fault"]["axis"], "left");
  const json moment = list[1];
  EXPECT_EQ(moment["state"], "done");
  EXPECT_EQ(moment["fault"], list[0]["fault"]);
  EXPECT_EQ(moment["samples"], 600);
  EXPECT_EQ(moment["rate_hz"], 1000);
  const std::int64_t trigger = moment["trigger_tick"];
  EXPECT_EQ(moment["first_tick"], trigger - 8000);
  EXPECT_GE(trigger, list[0]["trigger_tick"].get<std::int64_t>());
  EXPECT_LT(trigger, list[0]["trigger_tick"].get<std::int64_t>() + 16) << "one look later at most";
  bench.ask(Method::get, "/recordings/2/data");
  const Frame frame = frame_of(bench.raw);
  std::size_t statusword = 0;
  while (moment["channels"][statusword]["name"] != "statusword") ++statusword;
  for (std::size_t n = 0; n < 600; ++n) {
    const auto word = static_cast<unsigned>(frame.channels[statusword][n]);
    ASSERT_EQ((word & 0x08U) != 0, n >= 500) << n;
  }
  std::vector<json> faults;
  for (const json& event : inbox.of("event")) {
    if (event["kind"] == "fault") faults.push_back(event);
  }
  ASSERT_EQ(faults.size(), 1U);
  EXPECT_EQ(faults[0]["axis"], "left");
  EXPECT_EQ(faults[0]["code"], moment["fault"]["code"]);
}

TEST(BenchRecordings, TheLatestFourMomentsOfAnAxisAreKept) {
  Bench bench;
  bench.pass(1s);
  for (int n = 0; n < 6; ++n) {
    bench.ask(Method::post, "/axes/left/faults", R"({"inject":"encoder_loss"})");
    bench.pass(200ms);
    bench.ask(Method::delete_, "/axes/left/faults");
    bench.ask(Method::post, "/axes/left/power", R"({"action":"cycle"})");
    bench.pass(500ms);
  }
  const json list = bench.ask(Method::get, "/recordings")["recordings"];
  ASSERT_EQ(list.size(), 4U);
  EXPECT_EQ(list[0]["id"], 3);
  EXPECT_EQ(list[3]["id"], 6);
}

TEST(BenchRecordings, MemoryIsBounded) {
  Bench bench;
  const std::string large = R"({"channels":[{"axis":"left","signal":"DI0"},{"axis":"left","signal":"DI1"}],
    "rate_hz":16000,"duration_ms":65000,"pre_ms":1)";
  bench.ask(Method::post, "/recordings",
            R"({"channels":[{"axis":"left","signal":"DI0"}],"rate_hz":16000,"duration_ms":200000})", 422);
  for (int n = 0; n < 4; ++n) {
    bench.ask(Method::post, "/recordings", large + R"(,"trigger":{"kind":"edge","level":5}})", 201);
  }
  const json full = bench.ask(Method::get, "/recordings");
  EXPECT_LE(full["bytes"], full["most_bytes"]);
  bench.ask(Method::post, "/recordings", large + "}", 409);
  bench.ask(Method::post, "/recordings/2/stop");
  EXPECT_EQ(bench.ask(Method::post, "/recordings", large + "}", 201)["id"], 5);
  bench.ask(Method::get, "/recordings/2", {}, 404);
  EXPECT_EQ(bench.ask(Method::get, "/recordings")["recordings"].size(), 4U);
}

TEST(BenchRecordings, RefusesWhatIsNone) {
  Bench bench;
  const std::string channels = R"("channels":[{"axis":"left","signal":"DI0"}])";
  bench.ask(Method::post, "/recordings", "{}", 400);
  bench.ask(Method::post, "/recordings", "{" + channels + R"(,"pre_ms":500})", 422);
  bench.ask(Method::post, "/recordings", "{" + channels + R"(,"trigger":{"kind":"x"}})", 422);
  bench.ask(Method::post, "/recordings", "{" + channels + R"(,"trigger":{"kind":"edge"}})", 400);
  bench.ask(Method::post, "/recordings", "{" + channels + R"(,"trigger":{"kind":"edge","level":1,"channel":1}})", 422);
  bench.ask(Method::post, "/recordings", "{" + channels + R"(,"trigger":{"kind":"now","x":1}})", 400);
  bench.ask(Method::post, "/recordings", "{" + channels + R"(,"trigger":{"kind":"state","state":"x"}})", 422);
  bench.ask(Method::post, "/recordings", "{" + channels + R"(,"trigger":{"kind":"fault","axis":"x"}})", 404);
  const auto where_of = [&](const std::string& body) {
    return bench.ask(Method::post, "/recordings", body, 400)["error"]["where"];
  };
  EXPECT_EQ(where_of("{" + channels + R"(,"trigger":{"kind":"edge","level":"x"}})"), "trigger.level");
  EXPECT_EQ(where_of("{" + channels + R"(,"trigger":{"kind":"edge","level":1,"y":2}})"), "trigger");
  EXPECT_EQ(where_of(R"({"channels":[{"axis":"left","signal":"DI0"},{"axis":"left","objekt":"6064:00"}]})"),
            "channels[1]");
  bench.ask(Method::get, "/recordings/1", {}, 404);
  bench.ask(Method::delete_, "/recordings/x", {}, 404);
  EXPECT_EQ(bench.ask(Method::get, "/recordings")["bytes"], 0);
}

}  // namespace
}  // namespace bench_stream_test
}  // namespace servodrome::line::bench
