#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/read.hpp>
#include <boost/asio/read_until.hpp>
#include <boost/asio/write.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>
#include <filesystem>
#include <fmt/format.h>
#include <fstream>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <mutex>
#include <nlohmann/json.hpp>
#include <sys/resource.h>
#include <thread>
#include <unistd.h>

#include "api/http_server.hpp"
#include "api/scope/frame.hpp"
#include "api/scope/stream_session.hpp"
#include "line/bench/line_bench.hpp"
#include "line/line_server.hpp"
#include "support.hpp"

// The bench API's server with any client: files, WebSockets, and invalid requests.
namespace servodrome::line {
namespace bench_http_test {
namespace {

using namespace test;
using namespace api;
using boost::asio::ip::tcp;
using boost::system::error_code;
using nlohmann::json;
using testing::HasSubstr;
namespace beast = boost::beast;
namespace http = boost::beast::http;
namespace websocket = boost::beast::websocket;

using Fields = std::map<std::string, std::string>;

constexpr std::string_view one_axis = R"(
clock = "virtual"
[api]
address = "127.0.0.1:0"
[[bus]]
name = "can0"
[[axis]]
name = "x"
product = "ismc"
)";

// A built page, with files outside its folder that must not be served.
class Page {
 public:
  Page() : root_(testing::TempDir() + "servodrome_bench_http_test_" + std::to_string(::getpid())) {
    std::filesystem::create_directories(folder() + "/assets");
    write("page/index.html", "<!DOCTYPE html><title>studio</title>");
    write("page/assets/index-1.js", "let a;");
    write("page/favicon.svg", "<svg/>");
    write("page/.secret", "secret");
    write("secret.txt", "secret");
    std::filesystem::create_directories(root_ + "/page-2");
    write("page-2/secret.txt", "secret");
    std::filesystem::create_symlink("../secret.txt", folder() + "/link.txt");
    std::filesystem::create_symlink("../page-2", folder() + "/other");
    std::filesystem::create_symlink("favicon.svg", folder() + "/inside.svg");
  }
  ~Page() { std::filesystem::remove_all(root_); }
  Page(const Page&) = delete;
  Page& operator=(const Page&) = delete;
  std::string folder() const { return root_ + "/page"; }

 private:
  void write(const std::string& name, const std::string& text) { std::ofstream(root_ + "/" + name) << text; }
  std::string root_;
};

class Running {
 public:
  explicit Running(const std::string& page = {}, const std::vector<api::RouteGroup>& more = {})
      : server_(settings(page)) {
    for (const api::RouteGroup& group : more) server_.add_routes(group);
    thread_ = std::thread([this] { server_.run(); });
  }
  ~Running() {
    boost::asio::post(server_.io(), [this] { server_.stop(); });
    thread_.join();
  }
  Running(const Running&) = delete;
  Running& operator=(const Running&) = delete;
  std::uint16_t port() { return server_.api_port(); }
  std::string host() { return "127.0.0.1:" + std::to_string(port()); }
  LineServer& server() { return server_; }

 private:
  static LineSettings settings(const std::string& page) {
    LineSettings settings = settings_of(one_axis);
    settings.api.page = page;
    return settings;
  }
  LineServer server_;
  std::thread thread_;
};

// Sends bytes and reads an answer, on its own connection.
class Client {
 public:
  explicit Client(std::uint16_t port) : stream_(io_) {
    stream_.connect(tcp::endpoint(boost::asio::ip::make_address("127.0.0.1"), port));
    stream_.expires_after(30s);
  }
  http::response<http::string_body> raw(const std::string& bytes) {
    boost::asio::write(stream_, boost::asio::buffer(bytes));
    http::response_parser<http::string_body> parser;
    parser.body_limit(64 * 1024 * 1024);
    http::read(stream_, buffer_, parser);
    return parser.release();
  }
  http::response<http::string_body> ask(const std::string& method, const std::string& target, Fields fields = {},
                                        const std::string& body = {}) {
    fields.emplace("Host", "127.0.0.1");
    if (!body.empty()) fields.emplace("Content-Length", std::to_string(body.size()));
    std::string text = method + " " + target + " HTTP/1.1\r\n";
    for (const auto& [name, value] : fields) text += name + ": " + value + "\r\n";
    return raw(text + "\r\n" + body);
  }
  // Sends bytes, and reads up to and including `ending`.
  std::string until(const std::string& bytes, const std::string& ending) {
    boost::asio::write(stream_, boost::asio::buffer(bytes));
    std::string text = beast::buffers_to_string(buffer_.data());
    buffer_.consume(buffer_.size());
    const std::size_t size = boost::asio::read_until(stream_.socket(), boost::asio::dynamic_buffer(text), ending);
    // The next call reads the bytes behind it.
    const auto rest = boost::asio::buffer(text) + size;
    buffer_.commit(boost::asio::buffer_copy(buffer_.prepare(rest.size()), rest));
    return text.substr(0, size);
  }
  bool closed_by_peer() {
    char byte = 0;
    error_code code;
    boost::asio::read(stream_.socket(), boost::asio::buffer(&byte, 1), code);
    return code == boost::asio::error::eof || code == boost::asio::error::connection_reset;
  }
  beast::tcp_stream& stream() { return stream_; }

 private:
  boost::asio::io_context io_;
  beast::tcp_stream stream_;
  beast::flat_buffer buffer_;
};

std::string field(const http::response<http::string_body>& response, const std::string& name) {
  const auto value = response[name];
  return {value.data(), value.size()};
}

TEST(BenchRates, MoreRequestsThanTheLineHasTimeForWaitForTheirTurn) {
  constexpr int many = 1000;
  Running running;
  Client client(running.port());
  const auto begin = std::chrono::steady_clock::now();
  for (int i = 0; i < many; ++i) ASSERT_EQ(client.ask("GET", "/api/v1/version").result_int(), 200U);
  EXPECT_GE(std::chrono::steady_clock::now() - begin, (many - 200) * 500us);
}

TEST(BenchFiles, ServesThePageAndItsPlaces) {
  const Page page;
  Running running(page.folder());
  Client client(running.port());
  const auto index = client.ask("GET", "/");
  EXPECT_EQ(index.result_int(), 200U);
  EXPECT_THAT(index.body(), HasSubstr("studio"));
  EXPECT_EQ(field(index, "Content-Type"), "text/html; charset=utf-8");
  EXPECT_EQ(field(index, "Content-Security-Policy"),
            "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; connect-src 'self'; "
            "font-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'");
  EXPECT_EQ(field(index, "X-Content-Type-Options"), "nosniff");
  EXPECT_EQ(field(index, "Cache-Control"), "no-cache");
  EXPECT_EQ(client.ask("GET", "/axis/x/scope?zoom=2").body(), index.body()) << "a place within the page";
  const auto script = client.ask("GET", "/assets/index-1.js");
  EXPECT_EQ(script.body(), "let a;");
  EXPECT_EQ(field(script, "Content-Type"), "text/javascript; charset=utf-8");
  EXPECT_THAT(field(script, "Cache-Control"), HasSubstr("immutable"));
  EXPECT_EQ(client.ask("GET", "/favicon.svg").body(), "<svg/>");
  EXPECT_EQ(client.ask("GET", "/inside.svg").body(), "<svg/>");
  const auto again = client.ask("GET", "/", {{"If-None-Match", field(index, "ETag")}});
  EXPECT_EQ(again.result_int(), 304U);
  EXPECT_EQ(again.body(), "");
  EXPECT_EQ(client.ask("POST", "/").result_int(), 405U);
  EXPECT_EQ(client.ask("GET", "/api").result_int(), 404U);
  EXPECT_EQ(client.ask("GET", "/api/v1/version").result_int(), 200U);
}

TEST(BenchFiles, NothingBesideThePageIsServed) {
  const Page page;
  Running running(page.folder());
  for (const char* target : {"/../secret.txt",
                             "/assets/../../secret.txt",
                             "/%2e%2e/secret.txt",
                             "/%252e%252e/secret.txt",
                             "/..%2fsecret.txt",
                             "/..\\secret.txt",
                             "//etc/passwd.txt",
                             "/./favicon.svg",
                             "/.secret",
                             "/assets/.secret",
                             "/link.txt",
                             "/other/secret.txt",
                             "/../page-2/secret.txt",
                             "/favicon.svg%00.js",
                             "/missing.js",
                             "/assets/index-1.js/x.js",
                             "/assets.x",
                             "secret.txt",
                             "*",
                             "http://127.0.0.1/secret.txt",
                             "/~root/x.txt"}) {
    Client client(running.port());
    const auto response = client.ask("GET", target);
    EXPECT_GE(response.result_int(), 400U) << target;
    EXPECT_LT(response.result_int(), 500U) << target;
    EXPECT_THAT(response.body(), testing::Not(HasSubstr("secret\n"))) << target;
    EXPECT_TRUE(json::accept(response.body())) << target;
  }
}

TEST(BenchFiles, WithoutAPageThereIsANote) {
  Running running("/nonexistent");
  Client client(running.port());
  EXPECT_FALSE(running.server().has_page());
  EXPECT_THAT(client.ask("GET", "/").body(), HasSubstr("not built"));
  EXPECT_EQ(client.ask("GET", "/assets/x.js").result_int(), 404U);
}

TEST(BenchHttp, AbuseIsAnsweredAndEndsNothing) {
  Running running;
  const auto status = [&](const std::string& bytes) { return Client(running.port()).raw(bytes).result_int(); };
  const std::string get = "GET /api/v1/version HTTP/1.1\r\n";
  EXPECT_EQ(status(get + "Host: 127.0.0.1\r\nHost: x.org\r\n\r\n"), 400U);
  EXPECT_EQ(status(get + "Host: 127.0.0.1\r\nAuthorization: Bearer a\r\nAuthorization: Bearer b\r\n\r\n"), 400U);
  EXPECT_EQ(status(get + "Host: x.org\r\n\r\n"), 403U);
  EXPECT_EQ(status(get + "\r\n"), 403U) << "no Host at all";
  EXPECT_EQ(status(get + "Host: 127.0.0.1\r\nX: a\n b\0c\r\n\r\n"), 400U);
  EXPECT_EQ(status(get + "Host: 127.0.0.1\r\nContent-Length: -1\r\n\r\n"), 400U);
  EXPECT_EQ(status(get + "Host: 127.0.0.1\r\nContent-Length: 1\r\nContent-Length: 2\r\n\r\n"), 400U);
  EXPECT_EQ(status("POST /api/v1/clock/advance HTTP/1.1\r\nHost: 127.0.0.1\r\nTransfer-Encoding: chunked\r\n"
                   "Content-Length: 4\r\n\r\n0\r\n\r\n"),
            400U)
      << "two lengths are a way to smuggle";
  EXPECT_EQ(status(get + "Host: 127.0.0.1\r\nX: " + std::string(9000, 'x') + "\r\n\r\n"), 431U);
  EXPECT_EQ(status("GET /" + std::string(3000, 'x') + " HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"), 414U);
  EXPECT_EQ(status("\x16\x03\x01\x02 this is TLS\r\n\r\n"), 400U);
  EXPECT_EQ(Client(running.port()).ask("GET", "/api/v1/version").result_int(), 200U);
}

// Beast throws for a field of more than 64 KiB. A trailer may have one, because the limit of the header does not apply
// to it.
TEST(BenchHttp, ATrailerOfAnyLengthEndsNothing) {
  Running running;
  const std::string chunked =
      "POST /api/v1/clock/advance HTTP/1.1\r\nHost: x.org\r\nTransfer-Encoding: chunked\r\n\r\n";
  const std::string much(70'000, 'x');
  for (const std::string& body :
       {"0\r\nX: " + much + "\r\n\r\n", "0\r\n" + much + ": x\r\n\r\n", "0;a=" + much + "\r\n\r\n",
        "1;a=\"" + much + "\"\r\nz\r\n0\r\n\r\n", std::string("0\r\nX: y\r\n\r\n")}) {
    const unsigned status = Client(running.port()).raw(chunked + body).result_int();
    EXPECT_TRUE(status == 400 || status == 403 || status == 431) << status << " for " << body.substr(0, 10);
    EXPECT_EQ(Client(running.port()).ask("GET", "/api/v1/version").result_int(), 200U);
  }
}

// If a handler throws, its request is refused or its connection ends. The server and the other connections continue.
TEST(BenchHttp, AnExceptionEndsItsConnectionAndNothingElse) {
  using api::Call;
  using api::Json;
  using api::Method;
  static constexpr std::array routes{
      api::Route{Method::get, "/api/v1/test/throws", [](Call&) -> Json { throw std::runtime_error("of a route"); }},
      api::Route{Method::get, "/api/v1/test/piece",
                 [](Call& call) -> Json {
                   call.piece = []() -> Json { throw std::runtime_error("of a piece"); };
                   return nullptr;
                 }},
      api::Route{Method::get, "/api/v1/test/more",
                 [](Call& call) -> Json {
                   call.content = api::Content{"text/csv", "begin",
                                               []() -> std::string { throw std::runtime_error("of what follows"); }};
                   return nullptr;
                 }},
  };
  Running running({}, {{routes}});
  Client other(running.port());
  EXPECT_EQ(other.ask("GET", "/api/v1/version").result_int(), 200U);
  for (const char* target : {"/api/v1/test/throws", "/api/v1/test/piece"}) {
    const auto answer = Client(running.port()).ask("GET", target);
    EXPECT_EQ(answer.result_int(), 500U) << target;
    EXPECT_THAT(answer.body(), HasSubstr("of a")) << target;
  }
  EXPECT_EQ(running.server().failed_connections(), 0U);
  Client cut(running.port());
  EXPECT_THROW(cut.ask("GET", "/api/v1/test/more"), boost::system::system_error) << "the answer is cut short";
  EXPECT_EQ(other.ask("GET", "/api/v1/version").result_int(), 200U);
  EXPECT_EQ(running.server().failed_connections(), 1U);
}

// RFC 9112: with an unknown transfer coding the end of the body is unknown; a whole address overrides the Host field.
TEST(BenchHttp, CodingsAndAddressesAreTakenAsTheStandardHasThem) {
  Running running;
  const auto status = [&](const std::string& bytes) { return Client(running.port()).raw(bytes).result_int(); };
  const std::string post = "POST /api/v1/clock/advance HTTP/1.1\r\nHost: 127.0.0.1\r\nTransfer-Encoding: ";
  for (const char* coding : {"xchunked", "gzip, chunked", "chunked, gzip", "chunked\r\nTransfer-Encoding: chunked"}) {
    Client client(running.port());
    const unsigned answer = client.raw(post + coding + "\r\n\r\n8\r\n{\"ms\":1}\r\n0\r\n\r\n").result_int();
    EXPECT_TRUE(answer == 501 || answer == 400) << coding << ": " << answer;
    EXPECT_TRUE(client.closed_by_peer()) << "what follows is no request of its own";
  }
  EXPECT_EQ(status(post + "Chunked\r\n\r\n8\r\n{\"ms\":1}\r\n0\r\n\r\n"), 200U);
  const auto get = [&](const std::string& target, const std::string& host) {
    return status("GET " + target + " HTTP/1.1\r\nHost: " + host + "\r\n\r\n");
  };
  EXPECT_EQ(get("http://127.0.0.1/api/v1/version", "x.org"), 200U) << "the address goes before the field";
  EXPECT_EQ(get("HTTP://localhost:8402/api/v1/axes/x/values?objects=6041:00", "x.org"), 200U);
  EXPECT_EQ(get("http://x.org/api/v1/version", "127.0.0.1"), 403U);
  EXPECT_EQ(get("http://user@127.0.0.1/api/v1/version", "127.0.0.1"), 403U);
  EXPECT_EQ(get("http:///api/v1/version", "127.0.0.1"), 403U);
  for (const char* host :
       {"[127.0.0.1]evil", "[127.0.0.1]", "[::1]evil", "[::1]:80evil", "127.0.0.1:evil", "[::1", "127.0.0.1:80:80"}) {
    EXPECT_EQ(get("/api/v1/version", host), 403U) << host;
  }
  for (const char* host : {"[::1]", "[::1]:80", "127.0.0.1:80", "127.0.0.1", "localhost:8402", "localhost:"}) {
    EXPECT_EQ(get("/api/v1/version", host), 200U) << host;
  }
}

// A list of a thousand objects takes milliseconds. It is generated in parts, so that a master's frames are served in
// between.
TEST(BenchHttp, AListOfObjectsIsMadeInParts) {
  Line line(settings_of(one_axis));
  const auto response = bench::begin(line, {.target = "/api/v1/axes/x/objects"});
  ASSERT_TRUE(response.more);
  std::string whole = response.body;
  std::size_t longest = 0;
  for (std::string part = response.more(); !part.empty(); part = response.more()) {
    longest = std::max(longest, part.size());
    whole += part;
  }
  EXPECT_LE(longest, 16U * 1024);
  const auto table = line.axes()[0]->device().dictionary().table();
  EXPECT_EQ(json::parse(whole)["objects"].size(), table.size());
  EXPECT_EQ(bench::handle(line, {.target = "/api/v1/axes/x/objects"}).body, whole);
  Running running;
  const auto answer = Client(running.port()).ask("GET", "/api/v1/axes/x/objects");
  EXPECT_EQ(answer.body(), whole);
  EXPECT_EQ(field(answer, "Content-Type"), "application/json");
}

// Requests use at most half of the time: the time of a request beyond its turn delays those that follow.
TEST(BenchRates, RequestsThatTakeLongWaitLonger) {
  static constexpr std::array routes{api::Route{api::Method::get, "/api/v1/test/slow", [](api::Call&) -> api::Json {
                                                  std::this_thread::sleep_for(20ms);
                                                  return api::Json::object();
                                                }}};
  constexpr int many = 20;
  Running running({}, {{routes}});
  const auto begin = std::chrono::steady_clock::now();
  for (int i = 0; i < many; ++i) ASSERT_EQ(Client(running.port()).ask("GET", "/api/v1/test/slow").result_int(), 200U);
  EXPECT_GE(std::chrono::steady_clock::now() - begin, (many - 1) * 40ms - 100ms);
}

// The order in which the handlers of these routes were called.
class Order {
 public:
  std::vector<api::RouteGroup> group() { return {{routes, this}}; }
  std::vector<std::string> calls() {
    const std::lock_guard lock(mutex_);
    return calls_;
  }

 private:
  static api::Json note(api::Call& call, const char* name) {
    Order& order = *static_cast<Order*>(call.context);
    const std::lock_guard lock(order.mutex_);
    order.calls_.emplace_back(name);
    return api::Json::object();
  }
  static api::Json slow(api::Call& call) {
    std::this_thread::sleep_for(500ms);
    return note(call, "slow");
  }
  static constexpr std::array routes{
      api::Route{api::Method::get, "/api/v1/test/slow", slow},
      api::Route{api::Method::post, "/api/v1/test/slow", slow, 200, api::urgent},
      api::Route{api::Method::post, "/api/v1/test/usual", [](api::Call& call) { return note(call, "usual"); }},
      api::Route{api::Method::post, "/api/v1/test/stop", [](api::Call& call) { return note(call, "stop"); }, 200,
                 api::urgent},
      api::Route{api::Method::delete_, "/api/v1/test/stop", [](api::Call& call) { return note(call, "end"); }, 200,
                 api::urgent},
      api::Route{api::Method::post, "/api/v1/test/halt",
                 [](api::Call& call) {
                   call.halts = true;
                   return note(call, "halt");
                 },
                 200, api::urgent},
  };
  std::mutex mutex_;
  std::vector<std::string> calls_;
};

constexpr const char* usual_post = "POST /api/v1/test/usual HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 2\r\n\r\n{}";

TEST(BenchRates, AStopDoesNotWaitForTheRequestsBeforeIt) {
  Order order;
  Running running({}, order.group());
  Client slow(running.port());
  Client usual(running.port());
  Client stop(running.port());
  ASSERT_EQ(slow.ask("GET", "/api/v1/test/slow").result_int(), 200U);
  std::thread waits([&] { EXPECT_EQ(usual.raw(usual_post).result_int(), 200U); });
  EXPECT_EQ(stop.ask("POST", "/api/v1/test/stop", {}, R"({"a":1})").result_int(), 200U);
  EXPECT_EQ(stop.ask("DELETE", "/api/v1/test/stop").result_int(), 200U);
  EXPECT_EQ(stop.ask("POST", "/api/v1/test/usual").result_int(), 200U);
  waits.join();
  EXPECT_THAT(order.calls(), testing::ElementsAre("slow", "stop", "end", "usual", "usual"));
}

// The server is busy while a client sends a request and gives it up.
TEST(BenchRates, ARequestThatItsClientHasGivenUpIsNotCarriedOut) {
  Order order;
  Running running({}, order.group());
  Client slow(running.port());
  std::thread waits([&] { EXPECT_EQ(slow.ask("GET", "/api/v1/test/slow").result_int(), 200U); });
  std::this_thread::sleep_for(100ms);
  for (const std::string request : {"POST /api/v1/test/usual", "POST /api/v1/test/stop"}) {
    Client gone(running.port());
    boost::asio::write(gone.stream(),
                       boost::asio::buffer(request + " HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 0\r\n\r\n"));
  }
  waits.join();
  EXPECT_EQ(Client(running.port()).ask("POST", "/api/v1/test/usual").result_int(), 200U);
  EXPECT_THAT(order.calls(), testing::UnorderedElementsAre("slow", "stop", "usual"));
}

TEST(BenchRates, AHaltRefusesTheRequestsThatWaitedForTheirTurn) {
  Order order;
  Running running({}, order.group());
  Client slow(running.port());
  Client usual(running.port());
  Client halt(running.port());
  ASSERT_EQ(slow.ask("GET", "/api/v1/test/slow").result_int(), 200U);
  std::thread waits([&] { EXPECT_EQ(usual.raw(usual_post).result_int(), 409U); });
  std::this_thread::sleep_for(100ms);
  EXPECT_EQ(halt.ask("POST", "/api/v1/test/halt").result_int(), 200U);
  waits.join();
  EXPECT_EQ(usual.raw(usual_post).result_int(), 200U) << "a later one";
  EXPECT_THAT(order.calls(), testing::ElementsAre("slow", "halt", "usual"));
}

// A refused request, a long one, and one that is only like an urgent one wait for their turn.
TEST(BenchRates, OnlyUrgentRequestsComeBeforeTheirTurn) {
  for (const std::string& request :
       {std::string("POST /api/v1/test/stop HTTP/1.1\r\nHost: x.org\r\n\r\n"),
        std::string("POST /api/v1/test/missing HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"),
        std::string("POST / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"),
        "POST /api/v1/test/stop HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 1024\r\n\r\n" +
            std::string(1024, ' ')}) {
    Order order;
    Running running({}, order.group());
    Client slow(running.port());
    Client other(running.port());
    const auto begin = std::chrono::steady_clock::now();
    ASSERT_EQ(slow.ask("GET", "/api/v1/test/slow").result_int(), 200U);
    other.raw(request);
    EXPECT_GE(std::chrono::steady_clock::now() - begin, 500ms + 800ms) << request.substr(0, 40);
  }
}

// Urgent requests are limited among themselves, and later requests wait for the time that they took.
TEST(BenchRates, UrgentRequestsHaveTheirOwnLimit) {
  Order order;
  Running running({}, order.group());
  Client client(running.port());
  const auto begin = std::chrono::steady_clock::now();
  ASSERT_EQ(client.ask("GET", "/api/v1/test/slow").result_int(), 200U);
  ASSERT_EQ(client.ask("POST", "/api/v1/test/slow").result_int(), 200U);  // before its turn
  ASSERT_EQ(client.ask("POST", "/api/v1/test/stop").result_int(), 200U);
  EXPECT_GE(std::chrono::steady_clock::now() - begin, 1000ms + 800ms) << "the time of the urgent request before it";
  Client(running.port()).raw(usual_post);
  EXPECT_GE(std::chrono::steady_clock::now() - begin, 500ms + 1800ms) << "the time of both";
}

// A limit by its own clock: a request waits twice the time of the requests before it, less the burst.
TEST(BenchRates, TurnsFollowTheTimeOfRequests) {
  Turns turns;
  const Turns::Clock::time_point now{1h};
  for (int i = 0; i < 200; ++i) EXPECT_LE(turns.take(now), now);
  EXPECT_EQ(turns.next(now), now + Turns::length);
  EXPECT_EQ(turns.next(now + 1s), now + 1s - Turns::burst + Turns::length);
  turns.charge(now, 500ms);
  EXPECT_EQ(turns.next(now), now + 1s);
}

TEST(BenchHttp, BracketsWithinBracketsAreRefused) {
  Running running;
  for (const char* bracket : {"[", "{\"a\":", "[{\"a\":"}) {
    std::string body;
    while (body.size() < 250 * 1024) body += bracket;
    const auto response = Client(running.port()).ask("PUT", "/api/v1/axes/x/objects/6081/0", {}, body);
    EXPECT_EQ(response.result_int(), 400U);
    EXPECT_THAT(response.body(), HasSubstr("nested deeper"));
  }
  const std::string in_text = R"({"value":")" + std::string(1000, '[') + R"(\"[[[["})";
  EXPECT_THAT(Client(running.port()).ask("PUT", "/api/v1/axes/x/objects/6081/0", {}, in_text).body(),
              HasSubstr("wrong type"));
  // Nested values in a line file.
  for (const std::string& nested :
       {std::string(500'000, '['), "a = " + std::string(500'000, '['), "a" + std::string(3, '\n') + [] {
          std::string key = "a";
          for (int i = 0; i < 400'000; ++i) key += ".a";
          return key + " = 1";
        }()}) {
    EXPECT_FALSE(parse_line_file(nested, "deep.toml", all_products()).diagnostics.empty());
  }
  for (const char* nameless : {"[[[a]]]", "[=]", "x = 1\n [[ . ]]", "[\xC3\xA4]", "[[]]", "[", "[["}) {
    EXPECT_FALSE(parse_line_file(nameless, "nameless.toml", all_products()).diagnostics.empty()) << nameless;
  }
  const LineFile lists = parse_line_file("x = [\n[[[1]]],\n[{a = 1}]\n]\ny = '''\n[=]\n'''", "f", all_products());
  for (const auto& diagnostic : lists.diagnostics) EXPECT_THAT(diagnostic.what, testing::Not(HasSubstr("no name")));
  const LineFile dots = parse_line_file("# ...................... \nx = \"..................\"", "f", all_products());
  for (const auto& diagnostic : dots.diagnostics) EXPECT_THAT(diagnostic.what, testing::Not(HasSubstr("many parts")));
}

TEST(BenchHttp, ALongCsvComesInChunks) {
  Running running;
  Client client(running.port());
  EXPECT_EQ(client
                .ask("POST", "/api/v1/recordings", {},
                     R"({"channels":[{"axis":"x","signal":"velocity_rpm"}],"rate_hz":16000,"duration_ms":1000})")
                .result_int(),
            201U);
  EXPECT_EQ(client.ask("POST", "/api/v1/clock/advance", {}, R"({"ms":1100})").result_int(), 200U);
  const auto csv = client.ask("GET", "/api/v1/recordings/1/data.csv");
  EXPECT_EQ(csv.result_int(), 200U);
  EXPECT_EQ(field(csv, "Transfer-Encoding"), "chunked");
  EXPECT_EQ(field(csv, "Content-Type"), "text/csv; charset=utf-8");
  EXPECT_EQ(std::count(csv.body().begin(), csv.body().end(), '\n'), 16001);
  const auto data = client.ask("GET", "/api/v1/recordings/1/data");
  EXPECT_EQ(field(data, "Transfer-Encoding"), "chunked");
  EXPECT_EQ(data.body().size(), 24U + 16000 * 8);
  // HTTP 1.0 has no chunks.
  const auto whole = client.raw("GET /api/v1/recordings/1/data.csv HTTP/1.0\r\nHost: 127.0.0.1\r\n\r\n");
  EXPECT_EQ(whole.body(), csv.body());
}

TEST(BenchHttp, DataInPartsIsEachChannelInOrder) {
  Running running;
  Client client(running.port());
  client.ask("PUT", "/api/v1/axes/x/plant", {}, R"({"position_counts":-70000})");
  client.ask("POST", "/api/v1/recordings", {},
             R"({"channels":[{"axis":"x","signal":"supply_v"},{"axis":"x","signal":"position_counts"},)"
             R"({"axis":"x","object":"6041:00"}],"rate_hz":16000,"duration_ms":1000})");
  client.ask("POST", "/api/v1/clock/advance", {}, R"({"ms":1100})");
  const std::string data = client.ask("GET", "/api/v1/recordings/1/data").body();
  api::FrameHeader header;
  ASSERT_GE(data.size(), sizeof header);
  std::memcpy(&header, data.data(), sizeof header);
  EXPECT_EQ(header.samples, 16000U);
  EXPECT_EQ(header.channels, 3U);
  ASSERT_EQ(data.size(), sizeof header + std::size_t{16000} * 3 * sizeof(double));
  std::vector<double> values(std::size_t{16000} * 3);
  std::memcpy(values.data(), data.data() + sizeof header, values.size() * sizeof(double));
  std::string expected;
  for (std::size_t n = 0; n < 16000; ++n) {
    expected += fmt::format("{},{},{}\n", values[n], values[16000 + n], values[32000 + n]);
  }
  // The table has the samples in rows, after tick and time.
  std::istringstream csv(client.ask("GET", "/api/v1/recordings/1/data.csv").body());
  std::string row;
  std::string found;
  std::getline(csv, row);
  while (std::getline(csv, row)) {
    row.pop_back();  // CR
    found += row.substr(row.find(',', row.find(',') + 1) + 1) + "\n";
  }
  EXPECT_TRUE(found == expected) << found.substr(0, 200) << expected.substr(0, 200);
}

TEST(BenchHttp, AHeadIsAnAnswerWithoutItsBody) {
  const Page page;
  Running running(page.folder());
  Client client(running.port());
  for (const char* target : {"/api/v1/version", "/", "/api/v1/nothing"}) {
    const auto whole = client.ask("GET", target);
    const std::string head =
        client.until(fmt::format("HEAD {} HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n", target), "\r\n\r\n");
    EXPECT_THAT(head, HasSubstr(fmt::format("Content-Length: {}\r\n", whole.body().size()))) << target;
    EXPECT_THAT(head, testing::StartsWith(fmt::format("HTTP/1.1 {} ", whole.result_int())));
    // No bytes follow the body: the next answer begins with its own header.
    EXPECT_EQ(client.ask("GET", "/api/v1/version").result_int(), 200U) << target;
  }
}

TEST(BenchHttp, WhoAsksWhetherItsBodyIsWantedIsToldToSendIt) {
  Running running;
  Client client(running.port());
  const std::string head = "POST /api/v1/clock/advance HTTP/1.1\r\nHost: 127.0.0.1\r\nExpect: 100-continue\r\n";
  EXPECT_EQ(client.until(head + "Content-Length: 8\r\n\r\n", "\r\n\r\n"), "HTTP/1.1 100 Continue\r\n\r\n");
  EXPECT_EQ(client.raw(R"({"ms":5})").result_int(), 200U);
  EXPECT_EQ(json::parse(client.ask("GET", "/api/v1/clock").body())["ticks"], 80);
  // A body that is too long is refused before it is sent.
  EXPECT_EQ(client.raw(head + "Content-Length: 1000000\r\n\r\n").result_int(), 413U);
}

TEST(BenchHttp, ADownloadIsNotCutToMakeRoom) {
  Running running;
  Client first(running.port());
  first.ask("POST", "/api/v1/recordings", {},
            R"({"channels":[{"axis":"x","signal":"velocity_rpm"}],"rate_hz":16000,"duration_ms":30000})");
  first.ask("POST", "/api/v1/clock/advance", {}, R"({"ms":30100})");
  // This client has waited longest and reads nothing yet. Its response does not fit into the system's buffers.
  const std::string status =
      first.until("GET /api/v1/recordings/1/data.csv HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n", "\r\n");
  EXPECT_EQ(status, "HTTP/1.1 200 OK\r\n");
  std::vector<std::unique_ptr<Client>> others;
  for (int n = 0; n < 80; ++n) {
    others.push_back(std::make_unique<Client>(running.port()));
    EXPECT_EQ(others.back()->ask("GET", "/api/v1/version").result_int(), 200U);
  }
  EXPECT_TRUE(others.front()->closed_by_peer());
  const std::string rest = first.until("", "\r\n0\r\n\r\n");
  EXPECT_EQ(std::count(rest.begin(), rest.end(), '\r'), std::count(rest.begin(), rest.end(), '\n'));
  EXPECT_GT(std::count(rest.begin(), rest.end(), '\n'), 480'000);
}

TEST(BenchHttp, ClientsAreServedAgainAfterFileDescriptorsRanOut) {
  Running running;
  EXPECT_EQ(Client(running.port()).ask("GET", "/api/v1/version").result_int(), 200U);
  std::vector<int> taken;
  rlimit before{};
  ASSERT_EQ(::getrlimit(RLIMIT_NOFILE, &before), 0);
  {
    boost::asio::io_context io;
    tcp::socket waiting(io);
    waiting.open(tcp::v4());
    rlimit few = before;
    const int next = ::dup(0);  // the lowest free descriptor
    ::close(next);
    few.rlim_cur = static_cast<rlim_t>(next);
    ASSERT_EQ(::setrlimit(RLIMIT_NOFILE, &few), 0);
    waiting.connect(tcp::endpoint(boost::asio::ip::make_address("127.0.0.1"), running.port()));
    // The server cannot accept the connection. It retries periodically, but does not busy-wait.
    const std::string get = "GET /api/v1/version HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n";
    boost::asio::write(waiting, boost::asio::buffer(get));
    std::this_thread::sleep_for(150ms);
    ASSERT_EQ(::setrlimit(RLIMIT_NOFILE, &before), 0);
    beast::flat_buffer buffer;
    http::response<http::string_body> response;
    http::read(waiting, buffer, response);
    EXPECT_EQ(response.result_int(), 200U);
  }
  EXPECT_EQ(Client(running.port()).ask("GET", "/api/v1/version").result_int(), 200U);
}

// --- WebSockets

class Socket {
 public:
  explicit Socket(std::uint16_t port) : socket_(io_) {
    beast::get_lowest_layer(socket_).connect(tcp::endpoint(boost::asio::ip::make_address("127.0.0.1"), port));
    beast::get_lowest_layer(socket_).expires_after(30s);
    host_ = "127.0.0.1:" + std::to_string(port);
  }
  // Returns the status of the handshake; 101 is success.
  unsigned open(const Fields& fields = {}, const std::string& target = "/api/v1/stream") {
    socket_.set_option(websocket::stream_base::decorator([&fields](websocket::request_type& request) {
      for (const auto& [name, value] : fields) request.set(name, value);
    }));
    websocket::response_type response;
    error_code refused;
    socket_.handshake(response, host_, target, refused);
    return response.result_int();
  }
  json text() {
    while (true) {
      const std::string message = read();
      if (message.empty() || socket_.got_text()) return message.empty() ? json() : json::parse(message);
    }
  }
  std::string read() {
    beast::flat_buffer buffer;
    code = {};
    socket_.read(buffer, code);
    return beast::buffers_to_string(buffer.data());
  }
  bool is_text() const { return socket_.got_text(); }
  void write(const std::string& message) { socket_.write(boost::asio::buffer(message)); }
  void write_raw(const std::string& bytes) {
    boost::asio::write(beast::get_lowest_layer(socket_), boost::asio::buffer(bytes));
  }
  websocket::stream<beast::tcp_stream>& socket() { return socket_; }

  error_code code;

 private:
  boost::asio::io_context io_;
  websocket::stream<beast::tcp_stream> socket_;
  std::string host_;
};

TEST(BenchSocket, StreamsToItsClient) {
  Running running;
  Socket socket(running.port());
  ASSERT_EQ(socket.open({{"Origin", "http://" + running.host()}}), 101U);
  EXPECT_TRUE(socket.text().contains("hello"));
  socket.write(R"({"subscribe":{"id":5,"channels":[{"axis":"x","signal":"supply_v"}],"rate_hz":16000}})");
  EXPECT_EQ(socket.text()["subscribed"]["id"], 5);
  Client(running.port()).ask("POST", "/api/v1/clock/advance", {}, R"({"ms":100})");
  std::uint64_t expected = 1;
  while (expected < 1601) {
    const std::string frame = socket.read();
    ASSERT_FALSE(socket.code) << socket.code.message();
    if (socket.is_text()) continue;
    api::FrameHeader header;
    std::memcpy(&header, frame.data(), sizeof header);
    EXPECT_EQ(header.id, 5U);
    EXPECT_EQ(header.first_tick, expected);
    expected += header.samples;
  }
  EXPECT_EQ(expected, 1601U);
  // A client that sends nothing receives events.
  socket.write(R"({"watch":{"axes":50}})");
  EXPECT_EQ(socket.text()["axes"][0]["name"], "x");
  Client(running.port()).ask("POST", "/api/v1/axes/x/power", {}, R"({"action":"off"})");
  while (true) {
    const json message = socket.text();
    ASSERT_FALSE(message.is_null());
    if (message.contains("axes") && !message["axes"].empty() && message["axes"][0]["powered"] == false) break;
  }
}

// Returns the status of a handshake with any fields.
unsigned handshake_status(Running& running, Fields fields, const std::string& target = "/api/v1/stream") {
  fields.emplace("Host", running.host());
  fields.emplace("Upgrade", "websocket");
  fields.emplace("Connection", "Upgrade");
  fields.emplace("Sec-WebSocket-Key", "dGhlIHNhbXBsZSBub25jZQ==");
  fields.emplace("Sec-WebSocket-Version", "13");
  return Client(running.port()).ask("GET", target, fields).result_int();
}

TEST(BenchSocket, OnlyThoseMayOpenItWhoMayWrite) {
  Running running;
  const std::string token = "Bearer " + running.server().token();
  const auto status = [&](const Fields& fields, const std::string& target = "/api/v1/stream") {
    return handshake_status(running, fields, target);
  };
  EXPECT_EQ(status({}), 101U);
  EXPECT_EQ(status({{"Origin", "http://x.org"}}), 403U);
  EXPECT_EQ(status({{"Origin", "null"}}), 403U);
  EXPECT_EQ(status({{"Origin", "http://127.0.0.1:1"}}), 403U);
  EXPECT_EQ(status({{"Origin", "https://" + running.host()}}), 403U);
  EXPECT_EQ(status({{"Host", "x.org"}, {"Origin", "http://x.org"}}), 403U) << "a name that was pointed here";
  EXPECT_EQ(status({{"Authorization", "Bearer no"}}), 401U);
  EXPECT_EQ(status({{"Origin", "http://x.org"}, {"Authorization", token}}), 101U);
  EXPECT_EQ(status({}, "/api/v1/axes"), 404U);
  EXPECT_EQ(status({}, "/"), 404U);
  EXPECT_EQ(status({{"Sec-WebSocket-Version", "12"}}), 426U);
  EXPECT_EQ(Client(running.port()).ask("GET", "/api/v1/stream").result_int(), 404U) << "no WebSocket";
}

TEST(BenchSocket, APageTellsTheTokenAsASubprotocol) {
  Running running;
  const std::string token = running.server().token();
  const auto handshake = [&](const std::string& protocols) {
    return Client(running.port())
        .ask("GET", "/api/v1/stream",
             {{"Host", running.host()},
              {"Upgrade", "websocket"},
              {"Connection", "Upgrade"},
              {"Sec-WebSocket-Key", "dGhlIHNhbXBsZSBub25jZQ=="},
              {"Sec-WebSocket-Version", "13"},
              {"Origin", "http://x.org"},
              {"Sec-WebSocket-Protocol", protocols}});
  };
  const auto taken = handshake("servodrome, token." + token);
  EXPECT_EQ(taken.result_int(), 101U);
  EXPECT_EQ(field(taken, "Sec-WebSocket-Protocol"), "servodrome");
  EXPECT_EQ(handshake("servodrome, token.%" + fmt::format("{:02x}", token.front()) + token.substr(1)).result_int(),
            101U);
  EXPECT_EQ(handshake("servodrome, token.no").result_int(), 401U);
  EXPECT_EQ(handshake("servodrome, token.").result_int(), 403U) << "none: it counts where the page is from";
  EXPECT_EQ(handshake("servodrome").result_int(), 403U);
}

TEST(BenchSocket, WhatIsNoFrameEndsTheConnectionAlone) {
  Running running;
  const auto ends = [&](const std::string& bytes) {
    Socket socket(running.port());
    EXPECT_EQ(socket.open(), 101U);
    socket.text();
    socket.write_raw(bytes);
    socket.text();
    return socket.code.failed();
  };
  EXPECT_TRUE(ends(std::string("\x81\x02{}", 4))) << "not masked (RFC 6455 5.1)";
  EXPECT_TRUE(ends(std::string(64, '\xff'))) << "garbage";
  EXPECT_TRUE(ends(std::string("\xc1\x80\0\0\0\0", 6))) << "reserved bits";
  EXPECT_TRUE(ends(std::string("\x81\xff\x7f\xff\xff\xff\xff\xff\xff\xff\0\0\0\0", 14))) << "of 2^63 bytes";
  EXPECT_TRUE(ends(std::string("\x89\xfe\x01\0\0\0\0\0", 8))) << "a ping of 256 bytes";
  EXPECT_TRUE(ends(std::string("\x82\x81\0\0\0\0x", 7))) << "binary";
  EXPECT_TRUE(ends(std::string("\x81\x82\0\0\0\0\xc3\x28", 8))) << "no UTF-8";
  {
    Socket socket(running.port());
    ASSERT_EQ(socket.open(), 101U);
    socket.text();
    error_code ignored;
    socket.socket().write(boost::asio::buffer(std::string(100'000, ' ')), ignored);
    socket.text();
    EXPECT_TRUE(socket.code.failed()) << "a message too long";
  }
  // Sends half a frame and disconnects.
  {
    Socket socket(running.port());
    ASSERT_EQ(socket.open(), 101U);
    socket.write_raw(std::string("\x81\xfe\x10", 3));
  }
  {
    Socket socket(running.port());
    ASSERT_EQ(socket.open(), 101U);
    socket.text();
    socket.write(std::string(15'000, '['));
    EXPECT_THAT(socket.text()["error"]["what"].get<std::string>(), HasSubstr("nested deeper"));
    for (int n = 0; n < 300; ++n) {
      error_code ignored;
      socket.socket().write(boost::asio::buffer(std::string("{}")), ignored);
    }
    while (!socket.text().is_null()) {
    }
    EXPECT_EQ(socket.code, websocket::error::closed);
    EXPECT_THAT(std::string(socket.socket().reason().reason.c_str()), HasSubstr("messages in a second"));
  }
  EXPECT_EQ(Client(running.port()).ask("GET", "/api/v1/version").result_int(), 200U);
}

TEST(BenchSocket, ThirtyTwoClientsAtMost) {
  Running running;
  std::vector<std::unique_ptr<Socket>> sockets;
  for (int n = 0; n < 32; ++n) {
    sockets.push_back(std::make_unique<Socket>(running.port()));
    ASSERT_EQ(sockets.back()->open(), 101U);
    sockets.back()->text();
  }
  EXPECT_EQ(handshake_status(running, {}), 503U);
  EXPECT_EQ(Client(running.port()).ask("GET", "/api/v1/version").result_int(), 200U);
  sockets.erase(sockets.begin(), sockets.begin() + 4);
  unsigned status = 0;
  for (int n = 0; n < 500 && status != 101; ++n) {
    status = handshake_status(running, {});
    if (status != 101) std::this_thread::sleep_for(10ms);
  }
  EXPECT_EQ(status, 101U);
}

TEST(BenchSocket, AClientThatReadsNothingDelaysNobody) {
  Running running;
  Socket stuck(running.port());
  ASSERT_EQ(stuck.open(), 101U);
  stuck.text();
  std::string channels;
  for (int n = 0; n < 16; ++n) channels += std::string(n == 0 ? "" : ",") + R"({"axis":"x","signal":"velocity_rpm"})";
  stuck.write(R"({"subscribe":{"id":1,"channels":[)" + channels + R"(],"rate_hz":16000}})");
  EXPECT_TRUE(stuck.text().contains("subscribed"));
  Client client(running.port());
  for (int n = 0; n < 20; ++n) {
    ASSERT_EQ(client.ask("POST", "/api/v1/clock/advance", {}, R"({"ms":1000})").result_int(), 200U);
  }
  // The client reads again: some samples were left out, but those sent are in order.
  std::uint64_t next = 0;
  std::uint32_t coarsest = 1;
  while (next < 300'000) {
    const std::string frame = stuck.read();
    ASSERT_FALSE(stuck.code) << stuck.code.message();
    if (stuck.is_text()) continue;
    api::FrameHeader header;
    std::memcpy(&header, frame.data(), sizeof header);
    ASSERT_GE(header.first_tick, next);
    next = header.first_tick + std::uint64_t{header.samples - 1} * header.stride + 1;
    coarsest = std::max(coarsest, header.stride);
  }
  EXPECT_GT(coarsest, 1U);
}

TEST(BenchSocket, ALongAdvanceIsSeenInFullByWhoReadsIt) {
  Running running;
  Socket socket(running.port());
  ASSERT_EQ(socket.open(), 101U);
  socket.text();
  std::string channels;
  for (int n = 0; n < 16; ++n) channels += std::string(n == 0 ? "" : ",") + R"({"axis":"x","signal":"velocity_rpm"})";
  socket.write(R"({"subscribe":{"id":1,"channels":[)" + channels + R"(],"rate_hz":16000}})");
  EXPECT_TRUE(socket.text().contains("subscribed"));
  std::thread advances([&] { Client(running.port()).ask("POST", "/api/v1/clock/advance", {}, R"({"ms":10000})"); });
  std::uint64_t next = 1;
  while (next <= 160'000) {
    const std::string frame = socket.read();
    if (socket.code) break;
    if (socket.is_text()) continue;
    api::FrameHeader header;
    std::memcpy(&header, frame.data(), sizeof header);
    EXPECT_EQ(header.stride, 1U);
    if (header.first_tick != next || header.stride != 1) break;
    next += header.samples;
  }
  advances.join();
  EXPECT_EQ(next, 160'001U);
}

TEST(BenchSocket, WhoIsSentAwayAndReadsNothingIsCutHoweverMuchItSends) {
  Running running;
  Socket socket(running.port());
  ASSERT_EQ(socket.open(), 101U);
  socket.text();
  std::string channels;
  for (int n = 0; n < 16; ++n) channels += std::string(n == 0 ? "" : ",") + R"({"axis":"x","signal":"velocity_rpm"})";
  socket.write(R"({"subscribe":{"id":1,"channels":[)" + channels + R"(],"rate_hz":16000}})");
  EXPECT_TRUE(socket.text().contains("subscribed"));
  // More data than the system's buffers hold.
  Client(running.port()).ask("POST", "/api/v1/clock/advance", {}, R"({"ms":15000})");
  const std::string end = R"({"unsubscribe":{"id":99}})";
  // More messages than allowed, so the server closes the connection.
  for (int n = 0; n < 300; ++n) socket.socket().write(boost::asio::buffer(end), socket.code);
  // The client does not read the close frame and keeps sending.
  const auto began = std::chrono::steady_clock::now();
  while (!socket.code && std::chrono::steady_clock::now() - began < 60s) {
    socket.socket().write(boost::asio::buffer(end), socket.code);
    std::this_thread::sleep_for(20ms);
  }
  EXPECT_TRUE(socket.code) << "it is still connected";
}

TEST(BenchClock, VirtualTimePassesAtTheSpeedThatWasSet) {
  Running running;
  Client client(running.port());
  const auto ticks = [&] { return json::parse(client.ask("GET", "/api/v1/clock").body())["ticks"].get<int>(); };
  EXPECT_EQ(json::parse(client.ask("GET", "/api/v1/clock").body())["speed"], 0);
  EXPECT_EQ(client.ask("PUT", "/api/v1/clock", {}, R"({"speed":1001})").result_int(), 422U);
  EXPECT_EQ(client.ask("PUT", "/api/v1/clock", {}, R"({"speed":-1})").result_int(), 422U);
  EXPECT_EQ(json::parse(client.ask("PUT", "/api/v1/clock", {}, R"({"speed":0.5})").body())["speed"], 0.5);
  const auto began = std::chrono::steady_clock::now();
  while (ticks() < 1600) std::this_thread::sleep_for(1ms);
  EXPECT_GE(std::chrono::steady_clock::now() - began, 190ms) << "100 ms at half the speed";
  client.ask("PUT", "/api/v1/clock", {}, R"({"speed":1000})");
  while (ticks() < 16000) {
  }
  client.ask("PUT", "/api/v1/clock", {}, R"({"speed":0})");
  const int stands = ticks();
  std::this_thread::sleep_for(20ms);
  EXPECT_EQ(ticks(), stands);
}

}  // namespace
}  // namespace bench_http_test
}  // namespace servodrome::line
