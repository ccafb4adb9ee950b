#include "studio/real_server.hpp"

#include <algorithm>
#include <array>
#include <fmt/format.h>
#include <system_error>

#include "api/request.hpp"
#include "api/upgrade.hpp"
#include "scenario/routes.hpp"
#include "studio/bode_routes.hpp"
#include "studio/real_traffic.hpp"
#include "studio/trial_routes.hpp"

namespace servodrome::studio {
namespace {

using namespace std::chrono_literals;
using api::Request;
using api::Response;

constexpr master::Time shortest_sleep = 200us;
constexpr master::Time view_period = 10ms;       // period of updates from the drives
constexpr master::Time attention_period = 20ms;  // period of time-based messages to clients
constexpr master::Time longest_stop = 2s;        // longest time to stop an axis at the end
constexpr master::Time longest_absence = 60s;    // without clients, until TPDOs of waiting recordings are restored

}  // namespace

RealServer::RealServer(RealDrives& drives, const Settings& settings)
    : drives_(drives),
      bench_(drives),
      timer_(io_),
      access_{api::make_token()},
      page_(settings.page),
      scope_(drives),
      web_sockets_(scope_, [this](const std::exception& error) { http_->count_failure(error); }),
      jobs_(drives),
      change_routes_(drives.changes(), drives),
      project_(settings.project),
      traffic_([&drives](const api::Call& call) { return find_real_traffic(drives, call); },
               [&drives] { return drives.wall_epoch(); }),
      refused_(api::refused({scenario::Routes::table(), TrialRoutes::table(), BodePlots::table()})),
      groups_{api::bench_routes(bench_),
              jobs_.routes(),
              parameter_routes(drives),
              pdo_routes(drives),
              change_routes_.group(),
              project_.group(),
              traffic_.routes(),
              {api::recording_routes(), &scope_},
              {refused_}} {
  const auto publish = [this](const api::Json& event) { scope_.publish(event); };
  jobs_.on_event(publish);
  project_.on_event(publish);
  api::HttpHandlers handlers;
  handlers.answer = [this](Request&& request, api::HttpHandlers::Reply reply) {
    answer(std::move(request), std::move(reply));
  };
  handlers.upgrade_address = api::WebSockets::address;
  handlers.refuse_upgrade = [this] { return web_sockets_.refuse(); };
  handlers.upgrade = [this](api::Upgrade&& upgrade) { web_sockets_.accept(std::move(upgrade)); };
  handlers.report = [](const std::string& message) { fmt::print(stderr, "servodrome: {}\n", message); };
  http_ = std::make_unique<api::HttpServer>(io_, settings.address, settings.port, access_, std::move(handlers));
}

RealServer::~RealServer() { pending_.clear(); }

void RealServer::run() {
  schedule();
  try {
    io_.run();
  } catch (...) {
    shut_down();  // stop all axes, whatever ended the server
    throw;
  }
  shut_down();
}

// Answers requests for pages at once, and requests to the API when the drive has answered.
void RealServer::answer(Request&& request, api::HttpHandlers::Reply reply) {
  const std::string_view target = request.target;
  if (!target.starts_with("/api/") && target.substr(0, target.find('?')) != "/api") {
    reply(page_.answer(request));
    return;
  }
  client_at_ = drives_.now();
  Pending& pending = pending_.emplace_back(Pending{std::move(request), std::move(reply)});
  pending.task = std::make_unique<Task>([this, &pending] { carry_out(pending); });
  resume(pending);
  schedule();
}

void RealServer::carry_out(Pending& pending) {
  Response response = api::begin(pending.request, groups_);
  pending.response = std::move(response);
}

void RealServer::resume(Pending& pending) {
  drives_.set_wait([this, &pending](master::Time until) {
    pending.due = until;
    do {
      pending.task->pause();
    } while (drives_.now() < until);
  });
  try {
    pending.task->resume();
  } catch (const std::system_error&) {
    pending.response = api::error_response({503, "no thread could be created", pending.request.target,
                                            "stop other programs, or raise the limit of threads"});
    pending.task->end();
  }
  if (!pending.task->over()) return;
  const api::HttpHandlers::Reply reply = std::move(pending.reply);
  Response response = std::move(pending.response);
  pending_.remove_if([&pending](const Pending& its) { return &its == &pending; });
  reply(std::move(response));
}

void RealServer::schedule() {
  const master::Time now = drives_.now();
  // Relative to the last look, not to now: otherwise requests in quick succession would postpone it for ever.
  master::Time next = std::min(next_view_, jobs_.next_deadline());
  for (const Pending& pending : pending_) next = std::min(next, pending.due);
  timer_.expires_after(std::max(next, looked_ + shortest_sleep) - now);
  timer_.async_wait([this](const boost::system::error_code& code) {
    if (code) return;  // a new timer was set
    look();
    schedule();
  });
}

void RealServer::look() {
  const master::Time now = drives_.now();
  looked_ = now;
  jobs_.reached(now);
  std::vector<Pending*> due;
  for (Pending& pending : pending_) {
    if (pending.due <= now) due.push_back(&pending);
  }
  for (Pending* pending : due) resume(*pending);
  if (now >= next_view_) {
    next_view_ = now + view_period;
    const std::int64_t end = drives_.tick() + 1;
    note_events();
    for (std::int64_t reached = 0; reached < end;) scope_.advance(reached = drives_.take_samples(end));
    traffic_.flush();
  }
  if (now >= next_attention_) {
    next_attention_ = now + attention_period;
    scope_.attend(std::chrono::steady_clock::now());
    if (scope_.anyone() || !pending_.empty()) client_at_ = now;
    if (now - client_at_ > longest_absence) end_set_ups();
  }
}

// All clients have left: a recording that waits for its trigger must not change the drives' TPDOs for ever.
void RealServer::end_set_ups() {
  for (const auto& recording : scope_.recordings().all()) {
    if (recording->state() == api::RecordingState::armed && recording->plan().held) recording->stop();
  }
}

void RealServer::note_events() {
  for (const api::Json& event : drives_.events()) {
    scope_.publish(event);
    if (event["kind"] != "power" || event["powered"] != false) continue;
    const auto name = event["axis"].get<std::string>();
    const RealDrives::Axis& axis = *drives_.find(name);
    if (drives_.may_move(axis)) drives_.stop_when_back(name);
  }
}

void RealServer::shut_down() {
  drives_.set_wait([this](master::Time until) {
    std::this_thread::sleep_for(std::max<master::Time>(until - drives_.now(), 100us));
  });
  std::vector<const RealDrives::Axis*> left;
  for (const RealDrives::Axis& axis : drives_.all()) {
    const bool is_silent = drives_.state_of(axis).problem.has_value();
    if (drives_.was_operated(axis) && !is_silent && !drives_.is_idle(axis)) left.push_back(&axis);
  }
  for (const RealDrives::Axis* axis : left) {
    if (Job* job = jobs_.running(axis->name)) jobs_.end(*job, "the server was stopped");
  }
  drives_.quick_stop(left);  // all brake at once; the loop below waits for the standstill of one after the other
  for (const RealDrives::Axis* axis : left) {
    try {
      const auto objects = drives_.open(*axis);
      master::AxisOptions options = drives_.options(axis->name);
      options.state_timeout = longest_stop;
      master::Axis402 master_axis(*objects, options);
      master_axis.quick_stop();
      master_axis.disable();
    } catch (const std::exception&) {
      // The drive does not answer, or has stopped for another reason. No client is left for a report.
    }
  }
}

}  // namespace servodrome::studio
