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
#include "line/line.hpp"
#include "line/real_pace.hpp"
#include "line/vigil.hpp"
#include "links/can/link.hpp"

namespace servodrome::line {

// A line with its connections to the outside: the links of its buses, the bench API, logs, and the clock. Everything
// happens in the thread that calls run().
//
// In real time the line follows CLOCK_MONOTONIC. A timer wakes it for the next event on a bus, and at least every 1 ms
// while a CAN client is connected or after an EtherCAT segment was used, otherwise at least every 10 ms. A line with
// `raw:` or `busy` links polls and sleeps in serve_frames() instead. Each request first brings the line up to the
// present. Time that the line cannot catch up with is dropped (RealPace, Line::lag).
class LineServer final : private links::LineHost {
 public:
  // Opens all links and the API. On an error it closes them again and throws links::LinkError or std::runtime_error.
  explicit LineServer(const LineSettings& settings);
  ~LineServer() override;
  LineServer(const LineServer&) = delete;
  LineServer& operator=(const LineServer&) = delete;

  // Logs a bus to a file. The format of a CAN bus is candump, or pcap if the name ends in ".pcap". An EtherCAT segment
  // is always logged as pcap. An RS485 line is logged as text in candump's style, or as pcapng if the name ends in
  // ".pcap" or ".pcapng". "-" is standard output. Throws links::LinkError. If the log fails before the line ends, for
  // example on a full disk, `on_failure` is called once.
  void log(NamedBus& bus, const std::string& path, std::function<void()> on_failure = {});
  void log(NamedEthercatBus& bus, const std::string& path, std::function<void()> on_failure = {});
  void log(NamedSerialBus& bus, const std::string& path, std::function<void()> on_failure = {});

  // Adds routes to the API, beside the line's own. The group's context must outlive the server.
  void add_routes(const api::RouteGroup& group) { routes_.push_back(group); }

  // Sends {"event": event} to all clients of the stream.
  void publish(const api::Json& event) {
    if (scope_) scope_->scope().publish(event);
  }
  // Returns nullptr if there is no recording with this number.
  std::shared_ptr<const api::Recording> recording(std::uint32_t id) const {
    return scope_ ? scope_->scope().recordings().find(id) : nullptr;
  }
  // nullptr without an API.
  api::Recordings* recordings() { return scope_ ? &scope_->scope().recordings() : nullptr; }
  // The server has a studio page to serve.
  bool has_page() const { return http_ && page_.has_page(); }

  // Serves until stop() is called. Real time begins with this call.
  void run();
  // Must be called from within run().
  void stop() {
    stopped_ = true;
    io_.stop();
  }

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
  Time now() override;
  Time frame_time() override;
  void expect(Time time) override { line_.expect(time); }
  void report(const std::string& message) override;
  void wake() override;
  // Frames are logged with the line's time: wall-clock time in real time, time since 0 in virtual time.
  Time epoch() const override { return real_ ? epoch_ : Time{}; }

  // A log of any kind of bus: the calls that maintain it and end it.
  struct Log {
    std::function<void()> flush;
    std::function<bool()> failed;
    std::function<void()> detach;
    std::function<void()> on_failure;
  };

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
  void serve_frames();
  void stay_awake(const std::vector<links::EthercatLink*>& links, Vigil& vigil, RealPace::Moment& next_turn);
  void serve_busy(const std::vector<links::EthercatLink*>& busy, bool alone);
  void serve_others(RealPace::Moment present);
  bool has_can_clients() const;
  bool has_clients() const;  // clients of CAN buses and RS485 lines
  bool has_master() const;   // an EtherCAT segment has received frames
  void schedule();
  void note_lateness(RealPace::Moment due, RealPace::Moment present);
  Time due(RealPace::Moment present);
  Time catch_up();
  void flush_logs_in_time();
  void flush_logs();
  void attend();
  void pace();
  void let_time_pass();

  Time epoch_;  // wall-clock time of the line's time 0
  boost::asio::io_context io_;
  links::DescriptorWatch watch_;
  boost::asio::steady_timer timer_;
  boost::asio::steady_timer attention_;
  boost::asio::steady_timer pacer_;
  api::Access access_;
  std::vector<std::unique_ptr<Units>> units_;  // must outlive the links, which belong to the line
  Line line_;
  std::vector<Log> logs_;
  api::StaticFiles page_;
  std::unique_ptr<bench::LineScope> scope_;
  std::unique_ptr<api::WebSockets> web_sockets_;
  bench::LineBench bench_;
  std::vector<api::RouteGroup> routes_;
  std::unique_ptr<api::HttpServer> http_;
  RealPace real_pace_;
  std::optional<RealPace::Moment> looks_at_;  // the clock, read just before the poll of the links that is in progress
  Time frame_at_{};                           // line time of the last frame that was answered immediately
  RealPace::Moment turn_due_ = RealPace::Moment::max();  // when serve_others() is due, while Asio does not wait
  Time nap_{};                                           // longest sleep without a CAN client and without a master
  std::chrono::steady_clock::time_point next_flush_{};
  bool real_ = false;  // real time has begun
  bool stopped_ = false;
  bool woken_ = false;  // catch_up() is already posted
  bool attending_ = false;
  // serve_frames() waits for frames in place of Asio and also lets the line keep up with time
  bool takes_turns_ = false;
  double pace_ = 0;  // speed of virtual time that passes by itself, as a factor of real time
  std::chrono::steady_clock::time_point paced_at_{};  // when virtual time last advanced by itself
};

}  // namespace servodrome::line
