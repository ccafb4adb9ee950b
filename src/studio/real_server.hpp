#pragma once

#include <boost/asio/io_context.hpp>
#include <boost/asio/steady_timer.hpp>
#include <list>
#include <memory>
#include <string>

#include "api/http_server.hpp"
#include "api/scope/scope.hpp"
#include "api/scope/web_sockets.hpp"
#include "api/static_files.hpp"
#include "studio/change_routes.hpp"
#include "studio/jobs.hpp"
#include "studio/project/routes.hpp"
#include "studio/real_bench.hpp"
#include "studio/traffic.hpp"

namespace servodrome::studio {

// Serves the web page, and those parts of the bench API that need no plant, for drives on buses. Requests and jobs that
// wait for a drive are tasks: one thread serves all clients, and each bus has its own thread.
class RealServer {
 public:
  struct Settings {
    std::string address = "127.0.0.1";
    std::uint16_t port = 8402;
    std::string page{};          // folder; empty: no page
    Project* project = nullptr;  // must outlive the server; nullptr: none
  };

  // `drives` must outlive this object. Throws links::LinkError if it cannot listen.
  RealServer(RealDrives& drives, const Settings& settings);
  ~RealServer();
  RealServer(const RealServer&) = delete;
  RealServer& operator=(const RealServer&) = delete;

  // Serves until stop(). Then stops and disables every axis that a client has operated and that may have torque.
  void run();
  void stop() { io_.stop(); }

  boost::asio::io_context& io() { return io_; }
  std::uint16_t port() const { return http_->port(); }
  const std::string& token() const { return access_.token; }
  bool has_page() const { return page_.has_page(); }
  api::Recordings& recordings() { return scope_.recordings(); }
  const ProjectRoutes& project() const { return project_; }

 private:
  struct Pending {
    api::Request request;
    api::HttpHandlers::Reply reply;
    api::Response response{};
    master::Time due{};
    std::unique_ptr<Task> task{};
  };

  void answer(api::Request&& request, api::HttpHandlers::Reply reply);
  void carry_out(Pending& pending);
  void resume(Pending& pending);
  void look();
  void schedule();
  void note_events();
  void end_set_ups();
  void shut_down();

  RealDrives& drives_;
  RealBench bench_;
  boost::asio::io_context io_;
  boost::asio::steady_timer timer_;
  api::Access access_;
  api::StaticFiles page_;
  api::Scope scope_;
  api::WebSockets web_sockets_;
  Jobs jobs_;
  ChangeRoutes change_routes_;
  ProjectRoutes project_;
  Traffic traffic_;
  std::vector<api::Route> refused_;  // they need simulated drives
  std::vector<api::RouteGroup> groups_;
  std::list<Pending> pending_;
  master::Time looked_{};  // time of the last look()
  master::Time next_view_{};
  master::Time next_attention_{};
  master::Time client_at_{};  // last time at which a client had a stream or a request
  std::unique_ptr<api::HttpServer> http_;
};

}  // namespace servodrome::studio
