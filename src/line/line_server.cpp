#include "line/line_server.hpp"

#include <algorithm>
#include <boost/asio/post.hpp>
#include <fmt/format.h>

#include "api/upgrade.hpp"
#include "line/bench/line_bench.hpp"
#include "links/can/link_name.hpp"
#include "links/ethercat/link_name.hpp"
#include "links/serial/link_name.hpp"

namespace servodrome::line {
namespace {

using namespace std::chrono_literals;

constexpr auto attention_period = 20ms;
constexpr auto breath = 1ms;          // interval between two checks whether readers of the stream have caught up
constexpr unsigned most_looks = 200;  // checks after which an advance starts although a client keeps writing

}  // namespace

LineServer::LineServer(const LineSettings& settings)
    : epoch_(links::wall_now()),
      attention_(io_),
      access_{api::make_token()},
      line_(settings),
      clock_(line_, logs_),
      virtual_pace_(io_, line_, logs_),
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
    scope_ = std::make_unique<bench::LineScope>(line_, [this] { return epoch_; });
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
  server_.clock_.catch_up();
  return server_.line_.find_unit(bus_, unit);
}

void LineServer::run() {
  if (line_.clock_mode() == ClockMode::real) clock_.begin(std::chrono::steady_clock::now());
  epoch_ = links::wall_now() - line_.now();
  logs_.set_epoch(epoch_);
  const auto keep_serving = boost::asio::make_work_guard(io_);
  waiting_ = make_waiting({io_, watch_, line_, clock_});
  waiting_->run();
  logs_.flush();
}

void LineServer::wake() {
  if (!clock_.is_real() || woken_) return;
  woken_ = true;
  boost::asio::post(io_, [this] {
    woken_ = false;
    clock_.catch_up();
    waiting_->look_again();
  });
}

void LineServer::report(const std::string& message) { fmt::print(stderr, "servodrome: {}\n", message); }

api::Response LineServer::answer(const api::Request& request) {
  constexpr std::string_view api = "/api";
  const std::string_view target = request.target;
  if (!target.starts_with("/api/") && target.substr(0, target.find('?')) != api) return page_.answer(request);
  clock_.catch_up();
  api::Response response = api::begin(request, routes_);
  if (clock_.is_real()) {
    wake();
  } else {
    logs_.flush();
    virtual_pace_.follow();
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
  logs_.flush();
  boost::asio::post(io_, [this, response, reply] { carry_out(response, reply); });
}

// Periodically sends the clients of the stream what depends on wall-clock time, as long as there are clients.
void LineServer::attend() {
  attending_ = web_sockets_->any();
  if (!attending_) return;
  attention_.expires_after(attention_period);
  attention_.async_wait([this](const boost::system::error_code& code) {
    if (code) return;
    clock_.catch_up();
    scope_->scope().attend(std::chrono::steady_clock::now());
    attend();
  });
}

}  // namespace servodrome::line
