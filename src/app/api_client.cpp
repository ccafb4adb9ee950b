#include "app/api_client.hpp"

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/core/tcp_stream.hpp>
#include <boost/beast/http.hpp>
#include <cstdlib>
#include <fmt/format.h>
#include <future>
#include <thread>

#include "app/commands.hpp"

namespace servodrome::app {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;

constexpr auto patience = std::chrono::seconds(10);

using Message = http::request<http::string_body>;
using Answer = http::response<http::string_body>;

// The addresses of `host`. A look-up cannot be interrupted, so a thread of its own does it, which outlives this call if
// no answer comes in time. Throws boost::system::system_error.
asio::ip::tcp::resolver::results_type resolve(const std::string& host, const std::string& port) {
  using Results = asio::ip::tcp::resolver::results_type;
  std::packaged_task<Results()> task([host, port] {
    asio::io_context io;
    return asio::ip::tcp::resolver(io).resolve(host, port);
  });
  std::future<Results> found = task.get_future();
  std::thread(std::move(task)).detach();
  if (found.wait_for(patience) == std::future_status::ready) return found.get();
  throw boost::system::system_error(asio::error::timed_out);
}

// Sends the message to `host` and returns the answer. Throws boost::system::system_error.
Answer exchange(const std::string& host, const std::string& port, const Message& message) {
  asio::io_context io;
  beast::tcp_stream stream(io);
  beast::flat_buffer buffer;
  http::response_parser<http::string_body> parser;
  parser.body_limit(std::uint64_t{64} << 20);
  boost::system::error_code failed = asio::error::timed_out;
  const auto read = [&](boost::system::error_code error, std::size_t) {
    failed = error;
    if (error) return;
    http::async_read(stream, buffer, parser,
                     [&](boost::system::error_code its_error, std::size_t) { failed = its_error; });
  };
  const auto write = [&](boost::system::error_code error, const asio::ip::tcp::endpoint&) {
    failed = error;
    if (!error) http::async_write(stream, message, read);
  };
  const auto addresses = resolve(host, port);
  stream.expires_after(patience);  // for all steps together
  stream.async_connect(addresses, write);
  io.run();
  if (failed) throw boost::system::system_error(failed);
  return parser.release();
}

Failure refusal(const Answer& answer) {
  const auto json = nlohmann::json::parse(answer.body(), nullptr, false);
  if (!json.is_object() || !json.contains("error")) {
    return Failure::did_not_work(fmt::format("the server answered with HTTP status {}", answer.result_int()));
  }
  const auto& error = json["error"];
  const auto text = [&error](const char* key) { return error.value(key, std::string()); };
  const std::string hint = text("hint");
  return Failure::did_not_work(fmt::format("{}: {}{}{}", text("where"), text("what"), hint.empty() ? "" : "; ", hint));
}

}  // namespace

void add_api_options(CLI::App& command, ApiOptions& options) {
  command.add_option("--server", options.server, "ADDRESS:PORT of `servodrome up` or `servodrome studio`")
      ->capture_default_str();
  command.add_option("--token", options.token, "Token of a server on another machine; if not given $SERVODROME_TOKEN");
}

nlohmann::ordered_json ask_api(const ApiOptions& options, const char* method, const std::string& path,
                               const nlohmann::ordered_json& body) {
  const std::size_t colon = options.server.rfind(':');
  if (colon == std::string::npos) {
    throw Failure::wrong_use(
        fmt::format("--server {}: the port is missing; write --server 127.0.0.1:8402", options.server));
  }
  std::string host = options.server.substr(0, colon);
  if (host.starts_with('[') && host.ends_with(']')) host = host.substr(1, host.size() - 2);  // IPv6
  constexpr unsigned http_1_1 = 11;
  Message message{http::string_to_verb(method), "/api/v1/" + path, http_1_1};
  message.set(http::field::host, options.server);
  message.set(http::field::user_agent, "servodrome");
  message.set(http::field::connection, "close");
  const char* const variable = std::getenv("SERVODROME_TOKEN");
  const std::string token = options.token.empty() && variable != nullptr ? variable : options.token;
  if (!token.empty()) message.set(http::field::authorization, "Bearer " + token);
  if (!body.is_null()) message.body() = body.dump();
  message.prepare_payload();
  try {
    const Answer answer = exchange(host, options.server.substr(colon + 1), message);
    if (answer.result_int() >= 300) throw refusal(answer);
    return answer.body().empty() ? nlohmann::ordered_json() : nlohmann::ordered_json::parse(answer.body());
  } catch (const boost::system::system_error& error) {
    throw Failure::did_not_work(
        fmt::format("{}: the server does not answer ({}); start `servodrome up`, or name its "
                    "address with --server",
                    options.server, error.code().message()));
  } catch (const nlohmann::json::exception&) {
    throw Failure::did_not_work(
        fmt::format("{}: the answer is not JSON; is this a server of servodrome?", options.server));
  }
}

}  // namespace servodrome::app
