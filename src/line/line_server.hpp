#pragma once

#include <boost/asio/io_context.hpp>
#include <boost/asio/steady_timer.hpp>
#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "api/access.hpp"
#include "api/http_server.hpp"
#include "api/scope/web_sockets.hpp"
#include "api/static_files.hpp"
#include "line/bench/line_bench.hpp"
#include "line/bench/scope/line_scope.hpp"
#include "line/bus_logs.hpp"
#include "line/line.hpp"
#include "line/pacing/line_clock.hpp"
#include "line/pacing/virtual_pace.hpp"
#include "line/pacing/waiting.hpp"
#include "links/can/link.hpp"

namespace servodrome::line {

// A line with its connections to the outside: the links of its buses, the bench API, logs, and the clock. Everything
// happens in the thread that calls run(). The parts in pacing/ decide how that thread waits (Waiting) and how the
// line's time passes (LineClock in real time, VirtualPace). Each request first brings the line up to the present.
class LineServer final : private links::LineHost {
 public:
  // Opens all links and the API. On an error it closes them again and throws links::LinkError or std::runtime_error.
  explicit LineServer(const LineSettings& settings);
  ~LineServer() override = default;
  LineServer(const LineServer&) = delete;
  LineServer& operator=(const LineServer&) = delete;

  // Logs a bus to a file: BusLogs::add.
  template <typename Bus>
  void log(Bus& bus, const std::string& path, std::function<void()> on_failure = {}) {
    logs_.add(bus, path, epoch_, std::move(on_failure));
  }

  // Adds routes to the API, beside the line's own. The group's context must outlive the server.
  void add_routes(const api::RouteGroup& group) { routes_.push_back(group); }

  // Sends {"event": event} to all clients of the stream.
  void publish(const api::Json& event) {
    if (scope_) scope_->scope().publish(event);
  }
  // Returns nullptr if there is no recording with this number.
  std::shared_ptr<api::Recording> recording(std::uint32_t id) const {
    return scope_ ? scope_->scope().recordings().find(id) : nullptr;
  }
  // nullptr without an API.
  api::Recordings* recordings() { return scope_ ? &scope_->scope().recordings() : nullptr; }
  // The server has a studio page to serve.
  bool has_page() const { return http_ && page_.has_page(); }

  // Serves until stop() is called. Real time begins with this call.
  void run();
  // Must be called from within run().
  void stop() { io_.stop(); }

  Line& line() { return line_; }
  boost::asio::io_context& io() { return io_; }
  // Wall-clock time of the line's time 0.
  Time wall_epoch() const { return epoch_; }
  // The port of the bench API, 0 without one.
  std::uint16_t api_port() const { return http_ ? http_->port() : std::uint16_t{0}; }
  const std::string& token() const { return access_.token; }
  // The number of API connections that ended because of an exception.
  std::uint64_t failed_connections() const { return http_ ? http_->failures() : 0; }

 private:
  // links::LineHost
  Time now() override { return clock_.now(); }
  Time frame_time() override { return clock_.frame_time(); }
  void report(const std::string& message) override;
  void wake() override;
  // A link adds it to the line's time in the timestamps for its clients. They are wall-clock time if the line has real
  // time, and time since 0 if it has virtual time.
  Time epoch() const override { return clock_.is_real() ? epoch_ : Time{}; }

  // Finds the drives of an RS485 line for its Modbus TCP clients. Before each request the line catches up with real
  // time.
  class Units final : public modbus::Units {
   public:
    Units(LineServer& server, const NamedSerialBus& bus) : server_(server), bus_(bus) {}
    modbus::Server* find(std::uint8_t unit) override;

   private:
    LineServer& server_;
    const NamedSerialBus& bus_;
  };

  void open_serial_links();
  api::Response answer(const api::Request& request);
  bool settled();
  void when_settled(std::function<void()> then, unsigned looks = 0, bool was_settled = false);
  void carry_out(std::shared_ptr<api::Response> response, const api::HttpHandlers::Reply& reply);
  void attend();

  Time epoch_;  // wall-clock time of the line's time 0
  boost::asio::io_context io_;
  links::DescriptorWatch watch_;
  boost::asio::steady_timer attention_;
  api::Access access_;
  std::vector<std::unique_ptr<Units>> units_;  // must outlive the links, which belong to the line
  Line line_;
  BusLogs logs_;
  LineClock clock_;
  VirtualPace virtual_pace_;
  std::unique_ptr<Waiting> waiting_;  // during run()
  api::StaticFiles page_;
  std::unique_ptr<bench::LineScope> scope_;
  std::unique_ptr<api::WebSockets> web_sockets_;
  bench::LineBench bench_;
  std::vector<api::RouteGroup> routes_;
  std::unique_ptr<api::HttpServer> http_;
  bool woken_ = false;  // catching up is already posted
  bool attending_ = false;
};

}  // namespace servodrome::line
