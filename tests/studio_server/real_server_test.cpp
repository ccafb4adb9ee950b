// The studio's server with a complete drive: whatever ends it, the axis comes to rest.
#include "studio/real_server.hpp"

#include <boost/asio/connect.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/read.hpp>
#include <boost/asio/write.hpp>
#include <gmock/gmock.h>
#include <thread>

#include "axis/axis_rig.hpp"

namespace servodrome::studio {
namespace real_server_test {
namespace {

using namespace std::chrono_literals;

// One virtual drive; its time advances while its bus waits.
class BusOfOne final : public OpenBus {
 public:
  explicit BusOfOne(master::test::AxisRig& rig) : rig_(rig) {}
  std::vector<master::ObjectClient*> drives() override { return {&rig_.objects()}; }
  void back(std::size_t) override {}
  void wait(master::Time span) override {
    rig_.objects().wait(span);
    std::this_thread::sleep_for(span);
  }
  void abort_when(std::function<bool()>) override {}
  Cyclic open_cyclic(std::size_t, const master::CanDrive&) override {
    throw master::MasterError("there are no process data", "mem:", "");
  }
  void configure(std::size_t, const Action& action, const Action&) override { action(rig_.objects()); }
  void show_process_data(const Registers&) override {}
  std::vector<Found> scan() override {
    return {{1, "Servodrome 402", "servo drive (CiA 402)", "generic402"}, {7, "", "", ""}};
  }
  std::optional<Watch> watch_of(std::size_t) override { return std::nullopt; }

 private:
  master::test::AxisRig& rig_;
};

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
  std::string problem;
  {
    RealDrives drives({BusPlan{
        .link = "mem:", .type = "can", .drives = {{"reference", "generic402", 1}}, .open = [&rig](const links::Heard&) {
          return std::make_unique<BusOfOne>(rig);
        }}});
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

}  // namespace
}  // namespace real_server_test
}  // namespace servodrome::studio
