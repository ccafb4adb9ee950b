#pragma once

#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/read.hpp>
#include <boost/asio/write.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <map>
#include <nlohmann/json.hpp>
#include <thread>

#include "line/line_server.hpp"

namespace servodrome::line::test {

using boost::asio::ip::tcp;
namespace http = boost::beast::http;

// A drive on an RS485 line with a Modbus TCP link.
inline constexpr std::string_view serial_line = R"(
clock = "virtual"
[api]
address = "127.0.0.1:0"
[[bus]]
name = "rs"
type = "rs485"
links = ["tcp:127.0.0.1:0"]
[[axis]]
name = "x"
product = "generic402"
serial = "rs"
)";

// A server in its own thread, for tests with clients.
class Running {
 public:
  explicit Running(const LineSettings& settings) : server_(settings), thread_([this] { server_.run(); }) {}
  ~Running() {
    boost::asio::post(server_.io(), [this] { server_.stop(); });
    thread_.join();
  }
  Running(const Running&) = delete;
  Running& operator=(const Running&) = delete;

  LineServer& server() { return server_; }
  std::string link() { return server_.line().buses()[0]->links[0]->name(); }

 private:
  LineServer server_;
  std::thread thread_;
};

class Client {
 public:
  explicit Client(std::uint16_t port, int receive_buffer = 0)
      : stream_(io_), host_("127.0.0.1:" + std::to_string(port)) {
    if (receive_buffer != 0) {
      stream_.socket().open(tcp::v4());
      stream_.socket().set_option(boost::asio::socket_base::receive_buffer_size(receive_buffer));
    }
    stream_.connect(tcp::endpoint(boost::asio::ip::make_address("127.0.0.1"), port));
    stream_.expires_never();
  }

  http::response<http::string_body> ask(http::verb verb, const std::string& target, const std::string& body = {},
                                        const std::map<http::field, std::string>& fields = {}) {
    http::request<http::string_body> request(verb, "/api/v1" + target, 11);
    request.set(http::field::host, host_);
    for (const auto& [field, value] : fields) request.set(field, value);
    request.body() = body;
    request.prepare_payload();
    http::write(stream_, request);
    return read();
  }

  http::response<http::string_body> read() {
    http::response<http::string_body> response;
    http::read(stream_, buffer_, response);
    return response;
  }

  void write(std::string_view bytes) { boost::asio::write(stream_, boost::asio::buffer(bytes)); }

  bool closed_by_peer() {
    char byte = 0;
    boost::system::error_code code;
    boost::asio::read(stream_, boost::asio::buffer(&byte, 1), code);
    return code == boost::asio::error::eof || code == boost::asio::error::connection_reset;
  }

 private:
  boost::asio::io_context io_;
  boost::beast::tcp_stream stream_;
  boost::beast::flat_buffer buffer_;
  std::string host_;
};

inline nlohmann::json json_of(const http::response<http::string_body>& response) {
  return nlohmann::json::parse(response.body());
}

}  // namespace servodrome::line::test
