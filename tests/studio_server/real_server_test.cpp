// The studio's server with a complete drive: whatever ends it, the axis comes to rest.
#include "studio/real_server.hpp"

#include <boost/asio/connect.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/read.hpp>
#include <boost/asio/write.hpp>
#include <gmock/gmock.h>
#include <thread>

#include "bus_of_rig.hpp"
#include "studio/real_bench.hpp"

namespace servodrome::studio {
namespace real_server_test {
namespace {

using namespace std::chrono_literals;

// The controlwords that the drives of a bus have received: "1 2" is a quick stop of drive 1.
struct Controlwords {
  std::mutex mutex{};
  std::vector<std::string> written{};
  unsigned unanswered = 0;  // accesses to the object 5FFEh, which never gets an answer
};

class NotedObjects final : public master::ObjectClient {
 public:
  NotedObjects(master::ObjectClient& objects, Controlwords& noted) : objects_(objects), noted_(noted) {}
  std::vector<std::byte> upload(master::ObjectAddress object) override {
    leave_unanswered(object);
    return objects_.upload(object);
  }
  void download(master::ObjectAddress object, std::span<const std::byte> data) override {
    leave_unanswered(object);
    if (object.index == 0x6040) {
      const std::lock_guard lock(noted_.mutex);
      noted_.written.push_back(fmt::format("{} {:X}", objects_.address(), std::to_integer<unsigned>(data[0])));
    }
    objects_.download(object, data);
  }
  bool size_is_known() const override { return objects_.size_is_known(); }
  master::Time now() const override { return objects_.now(); }
  void wait(master::Time span) override { objects_.wait(span); }
  std::uint16_t address() const override { return objects_.address(); }
  std::string where() const override { return objects_.where(); }

 private:
  void leave_unanswered(master::ObjectAddress object) {
    if (object.index != 0x5FFE) return;
    const std::lock_guard lock(noted_.mutex);
    ++noted_.unanswered;
    throw master::ObjectError("no answer", "test", "", false, false);
  }

  master::ObjectClient& objects_;
  Controlwords& noted_;
};

class NotedBus final : public BusOfRig {
 public:
  NotedBus(master::test::AxisRig& rig, Controlwords& noted) : BusOfRig(rig, Pace::real_time) {
    for (const auto& client : rig.clients) noted_.push_back(std::make_unique<NotedObjects>(*client, noted));
  }
  std::vector<master::ObjectClient*> drives() override {
    std::vector<master::ObjectClient*> drives;
    for (const auto& objects : noted_) drives.push_back(objects.get());
    return drives;
  }
  std::vector<Found> scan() override {
    return {{1, "Servodrome 402", "servo drive (CiA 402)", "generic402"}, {7, "", "", ""}};
  }

 private:
  std::vector<std::unique_ptr<NotedObjects>> noted_;
};

BusPlan plan_of(master::test::AxisRig& rig, Controlwords& noted) {
  BusPlan plan{.link = "mem:", .type = "can", .drives = {{"reference", "generic402", 1}}};
  if (rig.clients.size() > 1) plan.drives.push_back({"second", "generic402", 2});
  plan.open = [&rig, &noted](const links::Heard&) { return std::make_unique<NotedBus>(rig, noted); };
  return plan;
}

// The axis "reference" of drives that run in real time, when it answers.
const RealDrives::Axis& answering_axis(RealDrives& drives) {
  drives.set_wait([](master::Time) { std::this_thread::sleep_for(1ms); });
  const RealDrives::Axis& axis = *drives.find("reference");
  for (int i = 0; i < 3000 && drives.state_of(axis).problem; ++i) std::this_thread::sleep_for(10ms);
  return axis;
}

std::string ask(std::uint16_t port, const std::string& method, const std::string& target, const std::string& body) {
  boost::asio::io_context io;
  boost::asio::ip::tcp::socket socket(io);
  socket.connect({boost::asio::ip::address_v4::loopback(), port});
  const std::string request =
      fmt::format("{} /api/v1/{} HTTP/1.1\r\nHost: 127.0.0.1:{}\r\nContent-Length: {}\r\nConnection: close\r\n\r\n{}",
                  method, target, port, body.size(), body);
  boost::asio::write(socket, boost::asio::buffer(request));
  std::string answer;
  boost::system::error_code end;
  boost::asio::read(socket, boost::asio::dynamic_buffer(answer), end);
  return answer;
}

// Returns when the answer to a GET contains the text; otherwise the last answer.
std::string wait_for(std::uint16_t port, const std::string& target, const std::string& text) {
  std::string answer;
  for (int i = 0; i < 3000 && answer.find(text) == std::string::npos; ++i) {
    std::this_thread::sleep_for(10ms);
    answer = ask(port, "GET", target, "");
  }
  return answer;
}

class EndingServer : public testing::TestWithParam<bool> {};
INSTANTIATE_TEST_SUITE_P(Ways, EndingServer, testing::Bool(),
                         [](const auto& by_exception) { return by_exception.param ? "exception" : "stop"; });

TEST_P(EndingServer, BringsItsAxesToRest) {
  master::test::AxisRig rig{{"generic402"}};
  Controlwords noted;
  std::string problem;
  {
    RealDrives drives({plan_of(rig, noted)});
    RealServer server(drives, {.address = "127.0.0.1", .port = 0});
    std::thread thread([&] {
      try {
        server.run();
      } catch (const std::exception& error) {
        problem = error.what();
      }
    });
    const std::uint16_t port = server.port();
    wait_for(port, "axes/reference", "\"powered\":true");
    ask(port, "POST", "axes/reference/jobs", R"({"do": "enable"})");
    EXPECT_THAT(wait_for(port, "jobs/1", "done"), testing::HasSubstr("done"));
    ask(port, "POST", "axes/reference/jobs",
        R"({"do": "velocity", "velocity": 1, "acceleration": 20, "units": "revolutions"})");
    EXPECT_THAT(wait_for(port, "jobs/2", "done"), testing::HasSubstr("done"));
    if (GetParam()) {
      boost::asio::post(server.io(), [] { throw std::runtime_error("a handler's mistake"); });
    } else {
      boost::asio::post(server.io(), [&server] { server.stop(); });
    }
    thread.join();
  }
  EXPECT_EQ(problem, GetParam() ? "a handler's mistake" : "");
  EXPECT_NE(master::Axis402(rig.objects(), rig.options()).state(), master::PowerState::operation_enabled);
  const double stood = rig.shaft_counts();
  rig.line.run_until(rig.line.now() + 1s);
  EXPECT_NEAR(rig.shaft_counts(), stood, 100.0);
}

// The server remembers 64 jobs. It stops an axis at its end although it has forgotten the axis's jobs, and all axes
// brake before it waits for the first one.
TEST(EndingServerOfTwo, StopsBothAxesAtOnceWithoutTheirJobs) {
  master::test::AxisRig rig{{"generic402"}, 2};
  Controlwords noted;
  std::size_t before = 0;
  {
    RealDrives drives({plan_of(rig, noted)});
    RealServer server(drives, {.address = "127.0.0.1", .port = 0});
    std::thread thread([&server] { server.run(); });
    const std::uint16_t port = server.port();
    int job = 0;
    for (const std::string axis : {"reference", "second"}) {
      wait_for(port, "axes/" + axis, "\"powered\":true");
      for (const char* body : {R"({"do": "enable"})",
                               R"({"do": "velocity", "velocity": 1, "acceleration": 20, "units": "revolutions"})"}) {
        ask(port, "POST", "axes/" + axis + "/jobs", body);
        EXPECT_THAT(wait_for(port, fmt::format("jobs/{}", ++job), "done"), testing::HasSubstr("done"));
      }
    }
    // A stop replaces the one before it without waiting.
    for (int i = 0; i < 64; ++i) ask(port, "POST", "axes/second/jobs", R"({"do": "stop"})");
    EXPECT_THAT(wait_for(port, fmt::format("jobs/{}", job + 64), "done"), testing::HasSubstr("done"));
    EXPECT_THAT(ask(port, "GET", "jobs/2", ""), testing::HasSubstr("404"));
    EXPECT_THAT(wait_for(port, "axes/reference", "operation enabled"), testing::HasSubstr("operation enabled"));
    boost::asio::post(server.io(), [&server, &noted, &before] {
      const std::lock_guard lock(noted.mutex);
      before = noted.written.size();
      server.stop();
    });
    thread.join();
  }
  for (const std::size_t i : {std::size_t{0}, std::size_t{1}}) {
    EXPECT_NE(master::Axis402(rig.objects(i), rig.options()).state(), master::PowerState::operation_enabled) << i;
  }
  const std::vector<std::string> at_end(noted.written.begin() + static_cast<std::ptrdiff_t>(before),
                                        noted.written.end());
  ASSERT_GE(at_end.size(), 2U);
  EXPECT_THAT((std::vector{at_end[0], at_end[1]}), testing::UnorderedElementsAre("1 2", "2 2"));
  const double stood = rig.shaft_counts(0);
  rig.line.run_until(rig.line.now() + 1s);
  EXPECT_NEAR(rig.shaft_counts(0), stood, 100.0);
}

TEST(RealServerTest, RoutesThatNeedSimulatedDrivesAreRefused) {
  master::test::AxisRig rig{{"generic402"}};
  Controlwords noted;
  RealDrives drives({plan_of(rig, noted)});
  RealServer server(drives, {.address = "127.0.0.1", .port = 0});
  std::thread thread([&server] { server.run(); });
  using Call = std::pair<const char*, const char*>;
  for (const auto& [method, target] :
       {Call{"GET", "scenario"}, Call{"PUT", "scenario"}, Call{"DELETE", "scenario"}, Call{"POST", "scenario/master"},
        Call{"GET", "scenario/actions"}, Call{"GET", "scenario/rules"}, Call{"POST", "scenario/rules"},
        Call{"DELETE", "scenario/rules/any"}, Call{"PUT", "trial"}, Call{"DELETE", "trial"},
        Call{"POST", "trial/master"}, Call{"POST", "trial/report"}, Call{"GET", "recordings/1/bode?input=0"}}) {
    const std::string answer = ask(server.port(), method, target, "");
    EXPECT_THAT(answer, testing::StartsWith("HTTP/1.1 409")) << method << " " << target;
    EXPECT_THAT(answer, testing::HasSubstr("simulated drives only")) << method << " " << target;
  }
  boost::asio::post(server.io(), [&server] { server.stop(); });
  thread.join();
}

// The answer does not depend on the jobs, which are forgotten.
TEST(RealDrivesTest, AnAxisMayMoveFromItsFirstJobUntilAStop) {
  master::test::AxisRig rig{{"generic402"}, 2};
  Controlwords noted;
  RealDrives drives({plan_of(rig, noted)});
  drives.set_wait([](master::Time) { std::this_thread::sleep_for(1ms); });
  const RealDrives::Axis& first = *drives.find("reference");
  const RealDrives::Axis& second = *drives.find("second");
  for (int i = 0; i < 3000 && (drives.state_of(first).problem || drives.state_of(second).problem); ++i) {
    std::this_thread::sleep_for(10ms);
  }
  Jobs jobs(drives);
  EXPECT_FALSE(drives.was_operated(first));
  jobs.begin("reference", R"({"do": "enable"})");
  for (int i = 0; i < 70; ++i) jobs.begin("second", R"({"do": "stop"})");
  EXPECT_TRUE(drives.may_move(first));
  EXPECT_FALSE(drives.may_move(second));
  jobs.begin("reference", R"({"do": "stop"})");
  EXPECT_FALSE(drives.may_move(first));
  EXPECT_TRUE(drives.was_operated(first));
  drives.note_motion("reference");  // for example a write of 60FFh during the stop
  EXPECT_TRUE(drives.may_move(first));
  drives.stop_all();
  EXPECT_FALSE(drives.may_move(first));
  EXPECT_TRUE(drives.was_operated(first));
}

// Where the page begins its proposal of a homing method, and what it must not propose.
TEST(RealBenchTest, HomingTellsTheMethodOfTheDriveAndWhetherItHasAnIndex) {
  struct Case {
    const char* product;
    int written;
    api::Json selected;
    api::Json index;
  };
  // A ProNet has an incremental encoder or a serial one, and no object of the real drive tells which.
  for (const Case& one : {Case{"generic402", 17, 17, true}, Case{"pronet", 18, 18, nullptr}}) {
    master::test::AxisRig rig{{one.product}};
    Controlwords noted;
    BusPlan plan = plan_of(rig, noted);
    plan.drives.front().product = one.product;
    RealDrives drives({plan});
    const RealDrives::Axis& axis = answering_axis(drives);
    drives.open(axis)->write<std::int8_t>(0x6098, 0, static_cast<std::int8_t>(one.written));
    RealBench bench(drives);
    const std::string no_body;
    api::Call call{.arguments = {"reference"}, .body = no_body};
    const api::Json view = bench.show_homing(call);
    EXPECT_EQ(view["selected"], one.selected) << one.product;
    EXPECT_EQ(view["index_available"], one.index) << one.product;
  }
}

// The type of an object that is in no table is not known, so the server first asks the drive for the object.
TEST(RealBenchTest, AnObjectThatTheDriveDoesNotHaveIsNotFound) {
  for (const auto bus : {master::test::RigCase::BusKind::can, master::test::RigCase::BusKind::modbus}) {
    master::test::AxisRig rig{{"generic402", bus}};
    Controlwords noted;
    BusPlan plan = plan_of(rig, noted);
    plan.drives.front().product = "generic402";
    RealDrives drives({plan});
    answering_axis(drives);
    RealBench bench(drives);
    for (const std::string body : {R"({"value": 1})", R"({"value": "01"})"}) {
      for (const char* const object : {"5FFF", "1018"}) {
        api::Call call{.arguments = {"reference", object, "9"}, .body = body};
        try {
          bench.write_object(call);
          ADD_FAILURE() << object << " " << body;
        } catch (const api::ApiError& error) {
          EXPECT_EQ(error.status, 404U) << object << " " << body << " " << error.what;
        }
      }
    }
  }
}

TEST(RealBenchTest, AWriteToASilentDriveWaitsForOneAnswerOnly) {
  master::test::AxisRig rig{{"generic402"}};
  Controlwords noted;
  RealDrives drives({plan_of(rig, noted)});
  answering_axis(drives);
  RealBench bench(drives);
  api::Call call{.arguments = {"reference", "5FFE", "0"}, .body = R"({"value": "01"})"};
  EXPECT_THROW(bench.write_object(call), api::ApiError);
  const std::lock_guard lock(noted.mutex);
  EXPECT_EQ(noted.unanswered, 1U);
}

TEST(RealDrivesTest, AMoveBeyondTheSoftwareLimitsIsRefused) {
  master::test::AxisRig rig{{"generic402"}};
  Controlwords noted;
  RealDrives drives({plan_of(rig, noted)});
  const RealDrives::Axis& axis = answering_axis(drives);
  Jobs jobs(drives);
  const auto status_of = [&](const char* body) {
    try {
      jobs.begin("reference", body);
    } catch (const api::ApiError& error) {
      EXPECT_THAT(error.what, testing::HasSubstr("beyond the highest position of 607Dh at 1000 "));
      return error.status;
    }
    jobs.begin("reference", R"({"do": "stop"})");
    jobs.end(*jobs.running("reference"), "the test has seen it");
    return 201U;
  };
  EXPECT_EQ(status_of(R"({"do": "move", "to": 1001})"), 201U);
  drives.open(axis)->write<std::int32_t>(0x607D, 1, -1000);
  drives.open(axis)->write<std::int32_t>(0x607D, 2, 1000);
  EXPECT_EQ(status_of(R"({"do": "move", "to": 1001})"), 409U);
  EXPECT_EQ(status_of(R"({"do": "move", "by": 1100})"), 409U);
  EXPECT_EQ(status_of(R"({"do": "move", "to": 1000})"), 201U);
  EXPECT_EQ(status_of(R"({"do": "move", "to": 1001, "beyond": true})"), 201U);
}

}  // namespace
}  // namespace real_server_test
}  // namespace servodrome::studio
