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

#include "line/bench/access.hpp"
#include "line/bench/http_server.hpp"
#include "line/bench/routes.hpp"
#include "line/bench/scope/line_scope.hpp"
#include "line/bench/scope/web_sockets.hpp"
#include "line/bench/static_files.hpp"
#include "line/line.hpp"
#include "line/real_pace.hpp"
#include "line/vigil.hpp"
#include "links/can/link.hpp"

namespace servodrome::line {

// A line with its doors to the outside: the links of its buses, the bench API, logs, and the clock. Everything happens
// in the thread that calls run().
//
// In real time the line follows CLOCK_MONOTONIC: it is woken for what comes next on a bus, at least once a millisecond
// while a CAN bus has clients or a segment has been used, else every ten. A request finds it at the present all
// the same. What it cannot catch up with is given up (RealPace, Line::lag).
class LineServer final : private links::LineHost {
 public:
  // Opens everything, or throws (links::LinkError, std::runtime_error) with nothing left open.
  explicit LineServer(const LineSettings& settings);
  ~LineServer() override;
  LineServer(const LineServer&) = delete;
  LineServer& operator=(const LineServer&) = delete;

  // Logs a bus: candump format, or pcap if the name ends so; an EtherCAT segment always as pcap; an RS485 line as text
  // of that form, or pcapng. "-" is standard output. Throws links::LinkError. `on_failure` is called once if the log
  // ends before the line does, as on a full disk.
  void log(NamedBus& bus, const std::string& path, std::function<void()> on_failure = {});
  void log(NamedEthercatBus& bus, const std::string& path, std::function<void()> on_failure = {});
  void log(NamedSerialBus& bus, const std::string& path, std::function<void()> on_failure = {});

  // Serves more of the API than the line's own; the group's context outlives the server.
  void add_routes(const bench::RouteGroup& group) { more_routes_.push_back(group); }

  // Tells all clients of the stream: {"event": event}.
  void publish(const bench::Json& event) {
    if (scope_) scope_->scope().publish(event);
  }
  // nullptr: there is no such recording.
  std::shared_ptr<const bench::Recording> recording(std::uint32_t id) const {
    return scope_ ? scope_->scope().recordings().find(id) : nullptr;
  }
  // There is a studio page to be served.
  bool has_page() const { return http_ && page_.has_page(); }

  // Serves until stop(). Real time begins with it.
  void run();
  // To be called from within run().
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
  // Connections of the bench API that an exception ended.
  std::uint64_t failed_connections() const { return http_ ? http_->failures() : 0; }

 private:
  // links::LineHost
  Time now() override;
  Time frame_time() override;
  void expect(Time time) override { line_.expect(time); }
  void report(const std::string& message) override;
  void wake() override;
  // Frames are shown with the line's time: of the wall in real time, from 0 on in virtual time.
  Time epoch() const override { return real_ ? epoch_ : Time{}; }

  // A log of some bus: how to look after it, and how to end it.
  struct Log {
    std::function<void()> flush;
    std::function<bool()> failed;
    std::function<void()> detach;
    std::function<void()> on_failure;
  };

  // The drives of an RS485 line for its Modbus TCP clients: a request finds the line at the moment it came.
  class Units final : public modbus::Units {
   public:
    Units(LineServer& server, const NamedSerialBus& bus) : server_(server), bus_(bus) {}
    modbus::Server* find(std::uint8_t unit) override;

   private:
    LineServer& server_;
    const NamedSerialBus& bus_;
  };

  void open_serial_links();
  bench::Response answer(const bench::Request& request);
  bool settled();
  void when_settled(std::function<void()> then, unsigned looks = 0, bool was_settled = false);
  void carry_out(std::shared_ptr<bench::Response> response, const bench::HttpHandlers::Reply& reply);
  void serve_frames();
  void stay_awake(const std::vector<links::EthercatLink*>& links, Vigil& vigil, RealPace::Moment& next_turn);
  void serve_busy(const std::vector<links::EthercatLink*>& busy, bool alone);
  void serve_others(RealPace::Moment present);
  bool has_can_clients() const;
  bool has_clients() const;  // of any bus but EtherCAT
  bool has_master() const;   // of an EtherCAT segment
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
  bench::Access access_;
  std::vector<std::unique_ptr<Units>> units_;  // outlive the links, which are the line's
  Line line_;
  std::vector<Log> logs_;
  bench::StaticFiles page_;
  std::unique_ptr<bench::LineScope> scope_;
  std::unique_ptr<bench::WebSockets> web_sockets_;
  std::vector<bench::RouteGroup> more_routes_;
  std::unique_ptr<bench::HttpServer> http_;
  RealPace real_pace_;
  std::optional<RealPace::Moment> looks_at_;  // the clock, read just before the poll of links that is under way
  Time frame_at_{};                           // of the last frame that was answered as it was read
  RealPace::Moment turn_due_ = RealPace::Moment::max();  // while frames are waited for beside Asio: of serve_others()
  Time nap_{};                                           // how long it sleeps without CAN client or master
  std::chrono::steady_clock::time_point next_flush_{};
  bool real_ = false;  // real time has begun
  bool stopped_ = false;
  bool woken_ = false;  // catching up is on its way
  bool attending_ = false;
  bool takes_turns_ = false;  // frames are waited for beside Asio, which keeps up with time as well
  double pace_ = 0;           // of virtual time that passes by itself
  std::chrono::steady_clock::time_point paced_at_{};  // when it was let pass last
};

}  // namespace servodrome::line
