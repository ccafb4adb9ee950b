#include "line/line_server.hpp"

#include <algorithm>
#include <boost/asio/post.hpp>
#include <fmt/format.h>
#include <thread>

#include "api/upgrade.hpp"
#include "line/bench/line_bench.hpp"
#include "links/can/link_name.hpp"
#include "links/can/log.hpp"
#include "links/ethercat/link_name.hpp"
#include "links/ethercat/log.hpp"
#include "links/serial/link_name.hpp"
#include "links/serial/log.hpp"

namespace servodrome::line {
namespace {

using namespace std::chrono_literals;

constexpr Time longest_sleep = 1ms;  // a frame that an axis sends by itself is late by at most this time
constexpr Time longest_nap = 10ms;   // the same, while no CAN client and no master is connected
constexpr Time most_late = 5ms;      // a timer that fires later than this counts as lag
constexpr auto log_flush_time = 100ms;
// While serve_frames() waits for EtherCAT frames, Asio is polled at these intervals. They limit the delay of the
// API ...
constexpr Time longest_between_turns = 1ms;
constexpr Time attentive_between_turns = 250us;  // ... and of other links, while a client or a master is connected
constexpr auto attention_period = 20ms;
constexpr auto breath = 1ms;           // interval between two checks whether readers of the stream have caught up
constexpr unsigned most_looks = 200;   // checks after which an advance starts although a client keeps writing
constexpr auto pacing_period = 5ms;    // interval between two steps of virtual time that passes by itself
constexpr Time longest_pause = 100ms;  // of real time that one such step catches up with at most
constexpr auto longest_pacing = 20ms;  // of real time that one such step may take
constexpr Time pacing_stride = 10ms;   // of line time, between two checks of longest_pacing

std::string file_of(const std::string& path) { return path == "-" ? "/dev/stdout" : path; }

template <typename Logs, typename File, typename Bus>
void attach_log(Logs& logs, std::shared_ptr<File> file, Bus& bus, std::function<void()> on_failure) {
  bus.add_observer(*file);
  logs.push_back({[file] { file->flush(); }, [file] { return file->failed(); },
                  [file, &bus] { bus.remove_observer(*file); }, std::move(on_failure)});
}

}  // namespace

LineServer::LineServer(const LineSettings& settings)
    : epoch_(links::wall_now()),
      timer_(io_),
      attention_(io_),
      pacer_(io_),
      access_{api::make_token()},
      line_(settings),
      page_(settings.api.page),
      bench_(line_),
      routes_{api::bench_routes(bench_)} {
  for (const auto& bus : line_.buses()) {
    for (const std::string& link : bus->settings.links) {
      const links::CanLinkName name = links::parse_can_link(link);
      if (std::holds_alternative<links::MemName>(name)) continue;  // for masters in this process
      bus->links.push_back(links::open_can_link(name, bus->bus, io_, *this));
    }
  }
  open_serial_links();
  for (const auto& bus : line_.ethercat_buses()) {
    for (const std::string& link : bus->settings.links) {
      const links::EthercatLinkName name = links::parse_ethercat_link(link);
      if (std::holds_alternative<links::MemName>(name)) continue;  // for masters in this process
      bus->links.push_back(links::open_ethercat_link(name, bus->bus, io_, watch_, *this));
    }
  }
  if (settings.api.enabled) {
    scope_ = std::make_unique<bench::LineScope>(line_);
    web_sockets_ = std::make_unique<api::WebSockets>(
        scope_->scope(), [this](const std::exception& error) { http_->count_failure(error); });
    routes_.push_back({api::recording_routes(), &scope_->scope()});
    api::HttpHandlers handlers;
    handlers.answer = [this](api::Request&& request, const api::HttpHandlers::Reply& reply) {
      const auto response = std::make_shared<api::Response>(answer(request));
      if (response->piece) {
        when_settled([this, response, reply] { carry_out(response, reply); });
      } else {
        carry_out(response, reply);
      }
    };
    handlers.upgrade_address = api::WebSockets::address;
    handlers.refuse_upgrade = [this] { return web_sockets_->refuse(); };
    handlers.upgrade = [this](api::Upgrade&& upgrade) {
      web_sockets_->accept(std::move(upgrade));
      if (!attending_) attend();
    };
    handlers.report = [this](const std::string& message) { report(message); };
    http_ =
        std::make_unique<api::HttpServer>(io_, settings.api.address, settings.api.port, access_, std::move(handlers));
  }
}

void LineServer::open_serial_links() {
  for (const auto& bus : line_.serial_buses()) {
    units_.push_back(std::make_unique<Units>(*this, *bus));
    for (const std::string& link : bus->settings.links) {
      const links::SerialLinkName name = links::parse_serial_link(link);
      if (std::holds_alternative<links::MemName>(name)) continue;  // for masters in this process
      bus->links.push_back(links::open_serial_link(name, bus->line, *units_.back(), io_, *this));
    }
  }
}

modbus::Server* LineServer::Units::find(std::uint8_t unit) {
  server_.catch_up();
  return server_.line_.find_unit(bus_, unit);
}

LineServer::~LineServer() {
  for (const Log& log : logs_) log.detach();
  logs_.clear();
}

void LineServer::log(NamedBus& bus, const std::string& path, std::function<void()> on_failure) {
  const auto format = path.ends_with(".pcap") ? links::CanLog::Format::pcap : links::CanLog::Format::candump;
  attach_log(logs_, std::make_shared<links::CanLog>(file_of(path), format, bus.settings.name, epoch_), bus.bus,
             std::move(on_failure));
}

void LineServer::log(NamedEthercatBus& bus, const std::string& path, std::function<void()> on_failure) {
  attach_log(logs_, std::make_shared<links::EthercatLog>(file_of(path), epoch_), bus.bus, std::move(on_failure));
}

void LineServer::log(NamedSerialBus& bus, const std::string& path, std::function<void()> on_failure) {
  const bool pcap = path.ends_with(".pcap") || path.ends_with(".pcapng");
  const auto file = std::make_shared<links::SerialLog>(
      file_of(path), pcap ? links::SerialLog::Format::pcapng : links::SerialLog::Format::text, bus.settings.name,
      bus.line, epoch_);
  logs_.push_back({[file] { file->flush(); }, [file] { return file->failed(); }, [] {}, std::move(on_failure)});
}

void LineServer::run() {
  real_pace_.begin(std::chrono::steady_clock::now(), line_.now());
  epoch_ = links::wall_now() - line_.now();
  real_ = line_.clock_mode() == ClockMode::real;
  const auto looks = [](const auto& link) { return link->busy(); };
  takes_turns_ = !watch_.empty() ||
                 std::any_of(line_.ethercat_buses().begin(), line_.ethercat_buses().end(), [looks](const auto& bus) {
                   return std::any_of(bus->links.begin(), bus->links.end(), looks);
                 });
  schedule();
  const auto keep_serving = boost::asio::make_work_guard(io_);
  serve_frames();
  io_.run();
  flush_logs();
}

Time LineServer::now() { return real_ ? due(std::chrono::steady_clock::now()) : line_.now(); }

void LineServer::wake() {
  line_.changed();
  if (!real_ || woken_) return;
  woken_ = true;
  boost::asio::post(io_, [this] {
    woken_ = false;
    catch_up();
    schedule();
  });
}

Time LineServer::due(RealPace::Moment present) {
  const Time due = real_pace_.due(present, std::max(line_.now(), frame_at_), nap_);
  if (real_pace_.given_up() > Time{}) line_.add_lag(real_pace_.given_up());
  return due;
}

Time LineServer::frame_time() {
  if (!real_) return line_.now();
  frame_at_ = due(looks_at_ ? *looks_at_ : std::chrono::steady_clock::now());
  line_.keep_up(frame_at_);
  return frame_at_;
}

Time LineServer::catch_up() {
  if (!real_) return line_.now();
  line_.run_until(due(std::chrono::steady_clock::now()));
  flush_logs_in_time();
  return line_.now();
}

void LineServer::report(const std::string& message) { fmt::print(stderr, "servodrome: {}\n", message); }

// Serves the links that Asio does not wait for: `raw:` links, which DescriptorWatch waits for, and `busy` links, which
// are polled without sleeping. Asio and everything it serves are polled at intervals (serve_others). Returns at stop(),
// or immediately if there are no such links.
void LineServer::serve_frames() {
  std::vector<links::EthercatLink*> all;
  std::vector<links::EthercatLink*> busy;
  for (const auto& bus : line_.ethercat_buses()) {
    for (const auto& link : bus->links) {
      all.push_back(link.get());
      if (link->busy()) busy.push_back(link.get());
    }
  }
  if (!takes_turns_) return;
  if (!busy.empty()) return serve_busy(busy, busy.size() == all.size());
  Vigil vigil;
  Time between{};  // the period of the watch's timer
  auto next_turn = std::chrono::steady_clock::now();
  while (!stopped_) {
    const Time wanted = has_clients() || has_master() ? attentive_between_turns : longest_between_turns;
    if (wanted != between) watch_.tick_every(between = wanted);
    const bool tick = watch_.wait();
    const auto present = std::chrono::steady_clock::now();
    if (!tick) vigil.served(present);
    if (tick || present >= next_turn) {
      serve_others(present);
      next_turn = present + between;
    }
    if (!vigil.worthwhile()) continue;
    stay_awake(all, vigil, next_turn);
    between = Time{};
  }
}

// Busy-waits while frames keep coming. It yields the processor between polls, because the master may run on the same
// one.
void LineServer::stay_awake(const std::vector<links::EthercatLink*>& links, Vigil& vigil, RealPace::Moment& next_turn) {
  auto present = std::chrono::steady_clock::now();
  const auto look = [&] {
    looks_at_ = present;
    bool any = false;
    for (links::EthercatLink* link : links) any = link->poll() || any;
    looks_at_.reset();
    if (any) vigil.answered(present = std::chrono::steady_clock::now());
    return any;
  };
  watch_.tick_every(Time{});  // this loop reads the clock itself
  watch_.pause();             // and polls the links itself
  while (vigil.worthwhile() && !stopped_) {
    if (!look()) {
      std::this_thread::yield();
      const auto before = std::exchange(present, std::chrono::steady_clock::now());
      vigil.lent(present - before);
      if (!look() && vigil.over(present)) vigil.in_vain();  // serves frames that came while others had the processor
    }
    if (present < next_turn) continue;
    serve_others(present);
    for (links::EthercatLink* link : links) link->check();
    present = std::chrono::steady_clock::now();
    next_turn = present + (has_clients() ? attentive_between_turns : longest_between_turns);
  }
  watch_.resume();
}

// Polls the `busy` links without sleeping. It also runs the line in real time tick by tick, so that a frame has at most
// one tick to catch up with. `alone`: there are no EtherCAT links other than `busy`.
void LineServer::serve_busy(const std::vector<links::EthercatLink*>& busy, bool alone) {
  constexpr auto looks_between = 20us;
  constexpr unsigned frames_between = 32;
  auto next_tick = std::chrono::steady_clock::now();
  auto next_turn = next_tick;
  unsigned frames = 0;
  while (!stopped_) {
    bool any = false;
    for (links::EthercatLink* link : busy) any = link->poll() || any;
    if (any && ++frames < frames_between) continue;
    frames = 0;
    const auto present = std::chrono::steady_clock::now();
    if (present >= next_tick) {
      catch_up();
      next_tick = real_ ? real_pace_.moment_of((line_.now() / tick_length + 1) * tick_length) : present + tick_length;
    }
    if (present < next_turn) continue;
    next_turn = present + (alone ? attentive_between_turns : Time{looks_between});
    serve_others(present);
    if (!alone) watch_.wait(Time{});
    for (links::EthercatLink* link : busy) link->check();
  }
}

// Lets the line keep up with real time and polls Asio once, without waiting: the API, other links and timers.
void LineServer::serve_others(RealPace::Moment present) {
  if (real_) {
    note_lateness(turn_due_, present);
    turn_due_ = present + longest_between_turns;
    line_.keep_up(due(present));
    flush_logs_in_time();
  }
  if (io_.poll() > 0) line_.changed();
}

namespace {
template <typename Buses>
bool any_link(const Buses& buses, bool (*is)(const links::LinkCounters& counters)) {
  return std::any_of(buses.begin(), buses.end(), [is](const auto& bus) {
    return std::any_of(bus->links.begin(), bus->links.end(), [is](const auto& link) { return is(link->counters()); });
  });
}
bool is_connected(const links::LinkCounters& counters) { return counters.clients > 0; }
bool was_used(const links::LinkCounters& counters) { return counters.to_bus > 0; }
}  // namespace

bool LineServer::has_can_clients() const { return any_link(line_.buses(), is_connected); }

bool LineServer::has_clients() const { return has_can_clients() || any_link(line_.serial_buses(), is_connected); }

// A segment has no connections, so a master is assumed as soon as a frame has come. The line is then woken more often:
// the less it has to catch up with before it answers a frame, the sooner the answer leaves.
bool LineServer::has_master() const { return any_link(line_.ethercat_buses(), was_used); }

void LineServer::schedule() {
  if (!real_ || takes_turns_) return;
  // Only on CAN does an axis send without a request; other buses do not need the short interval.
  nap_ = has_can_clients() || has_master() ? Time{} : longest_nap;
  const Time longest = std::max(longest_sleep, nap_);
  timer_.expires_at(real_pace_.moment_of(std::min(line_.next_bus_event(), line_.now() + longest)));
  timer_.async_wait([this](const boost::system::error_code& code) {
    if (code) return;  // cancelled: schedule() has set the timer again
    note_lateness(timer_.expiry(), std::chrono::steady_clock::now());
    catch_up();
    schedule();
  });
}

// Counts a late timer as lag although the line catches up: clients of its buses had to wait. due() counts the time that
// the line drops.
void LineServer::note_lateness(RealPace::Moment due, RealPace::Moment present) {
  if (const Time late = present - due; late > most_late && late <= RealPace::most_behind + nap_) line_.add_lag(late);
}

api::Response LineServer::answer(const api::Request& request) {
  constexpr std::string_view api = "/api";
  const std::string_view target = request.target;
  if (!target.starts_with("/api/") && target.substr(0, target.find('?')) != api) return page_.answer(request);
  catch_up();
  api::Response response = api::begin(request, routes_);
  if (real_) {
    wake();
  } else {
    flush_logs();
    if (line_.speed() != pace_) pace();
  }
  return response;
}

// Returns true if no client of a link has written data that the link could take and has not taken yet.
bool LineServer::settled() {
  const auto all = [](const auto& buses) {
    return std::all_of(buses.begin(), buses.end(), [](const auto& bus) {
      return std::all_of(bus->links.begin(), bus->links.end(), [](const auto& link) { return link->settled(); });
    });
  };
  // EtherCAT frames are served by polling their links.
  bool served = false;
  for (const auto& bus : line_.ethercat_buses()) {
    for (const auto& link : bus->links) served = link->poll() || served;
  }
  return !served && all(line_.buses()) && all(line_.serial_buses());
}

// Calls `then` when the links have taken everything that clients wrote before they requested that virtual time
// advances. Such frames act at the instant before the advance. It checks twice in a row, because data that Asio had
// read before the first check may still be in a handler that has not run yet.
void LineServer::when_settled(std::function<void()> then, unsigned looks, bool was_settled) {
  const bool is_settled = settled();
  if ((is_settled && was_settled) || looks == most_looks) {
    then();
    return;
  }
  auto again = [this, then = std::move(then), looks, is_settled] { when_settled(then, looks + 1, is_settled); };
  if (is_settled) {
    boost::asio::post(io_, std::move(again));
    return;
  }
  const auto timer = std::make_shared<boost::asio::steady_timer>(io_, breath);
  timer->async_wait([timer, again = std::move(again)](const boost::system::error_code& code) {
    if (!code) again();
  });
}

// Carries out a long request piece by piece, and handles other events between the pieces. If readers of the stream have
// not received the last piece yet, it waits for them before the next one.
void LineServer::carry_out(std::shared_ptr<api::Response> response, const api::HttpHandlers::Reply& reply) {
  if (!response->piece) {
    reply(std::move(*response));
    return;
  }
  if (scope_->scope().waits_for_readers(std::chrono::steady_clock::now())) {
    const auto timer = std::make_shared<boost::asio::steady_timer>(io_, breath);
    timer->async_wait([this, timer, response, reply](const boost::system::error_code& code) {
      if (!code) carry_out(response, reply);
    });
    return;
  }
  api::carry_out_piece(*response);
  flush_logs();
  boost::asio::post(io_, [this, response, reply] { carry_out(response, reply); });
}

// Periodically sends the clients of the stream what depends on wall-clock time, as long as there are clients.
void LineServer::attend() {
  attending_ = web_sockets_->any();
  if (!attending_) return;
  attention_.expires_after(attention_period);
  attention_.async_wait([this](const boost::system::error_code& code) {
    if (code) return;
    catch_up();
    scope_->scope().attend(std::chrono::steady_clock::now());
    attend();
  });
}

// Called when the speed of virtual time has changed.
void LineServer::pace() {
  pace_ = line_.speed();
  paced_at_ = std::chrono::steady_clock::now();
  if (pace_ > 0) {
    let_time_pass();
  } else {
    pacer_.cancel();
  }
}

void LineServer::let_time_pass() {
  pacer_.expires_after(pacing_period);
  pacer_.async_wait([this](const boost::system::error_code& code) {
    if (code) return;
    const auto began = std::chrono::steady_clock::now();
    const auto passed = std::min<Time>(began - paced_at_, longest_pause);
    const Time target = line_.now() + std::chrono::duration_cast<Time>(passed * pace_);
    // Time that the processor cannot simulate within longest_pacing is dropped, to leave time for requests.
    while (line_.now() < target && std::chrono::steady_clock::now() - began < longest_pacing) {
      line_.run_until(std::min(target, line_.now() + pacing_stride));
    }
    paced_at_ = began;
    flush_logs();
    let_time_pass();
  });
}

void LineServer::flush_logs_in_time() {
  const auto moment = real_pace_.moment_of(line_.now());
  if (moment < next_flush_) return;
  next_flush_ = moment + log_flush_time;
  flush_logs();
}

void LineServer::flush_logs() {
  for (Log& log : logs_) {
    log.flush();
    if (log.failed() && log.on_failure) std::exchange(log.on_failure, {})();
  }
}

}  // namespace servodrome::line
