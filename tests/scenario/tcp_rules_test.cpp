// Rules on the answers of Modbus TCP, as a client receives them.
#include <cerrno>
#include <gmock/gmock.h>

#include "scenario/serial_support.hpp"

namespace servodrome::scenario::test {
namespace tcp_rules_test {
namespace {

using links::test::hex_of_text;
using links::test::RawClient;
using links::test::text_of;

const std::string request = "12 34 00 00 00 06 01 06 00 01 00 03";  // 6060h = 3; the answer is the same

std::string received(const RawClient& client) { return hex_of_text(client.text()); }

// The answer that a client receives for one request, with one rule on answers.
std::string answer_with(const std::string& rule, const std::string& expected) {
  TcpScene scene("[[rule]]\non = { message = \"answer\", function = 6 }\n" + rule);
  const RawClient client = scene.client();
  client.write(text_of(request));
  scene.until([&] { return received(client).size() >= expected.size() || client.ended(); });
  scene.pass(20ms);
  EXPECT_EQ(scene.line.axes().front()->device().dictionary().number(0x6060), 3);
  return received(client);
}

TEST(TcpRules, AnswersAreChanged) {
  for (const auto& [rule, expected] : std::vector<std::pair<std::string, std::string>>{
           {"do = \"alter\"\nbyte = 1\nxor = 0x80\n", "12 B4" + request.substr(5)},
           {"do = \"alter\"\nbyte = 0\nswap = 1\n", "34 12" + request.substr(5)},
           {"do = \"alter\"\nbyte = 5\nadd = 20\n", "12 34 00 00 00 1A" + request.substr(17)},
           {"do = \"truncate\"\nlength = 9\nchecksum = true\n", "12 34 00 00 00 03 01 06 00"},
           {"do = \"abort\"\ncode = 0x0A\n", "12 34 00 00 00 03 01 86 0A"},
           {"do = \"repeat\"\n", request + " " + request},
           {"do = \"close\"\nlength = 5\n", "12 34 00 00 00"}}) {
    EXPECT_EQ(answer_with(rule, expected), expected) << rule;
  }
}

TEST(TcpRules, AConnectionIsClosedInTheMiddleOfAnAnswer) {
  TcpScene scene("[[rule]]\non = { message = \"answer\" }\ndo = \"close\"\nlength = 5\ntimes = 1\n");
  const RawClient one = scene.client();
  one.write(text_of(request));
  ASSERT_TRUE(scene.until([&] { return one.ended(); }));
  EXPECT_EQ(received(one), request.substr(0, 14));
  const RawClient other = scene.client();
  other.write(text_of(request));
  ASSERT_TRUE(scene.until([&] { return received(other) == request; }));
}

TEST(TcpRules, AnAnswerIsLateOrWithheld) {
  TcpScene scene(R"(
[[rule]]
on = { message = "answer" }
do = "delay"
ms = 100
times = 1
[[rule]]
on = { message = "answer" }
do = "withhold"
skip = 1
times = 1
)");
  const RawClient client = scene.client();
  const auto began = std::chrono::steady_clock::now();
  client.write(text_of(request));
  ASSERT_TRUE(scene.until([&] { return received(client) == request; }));
  EXPECT_GE(std::chrono::steady_clock::now() - began, 100ms);
  client.write(text_of(request));
  scene.pass(50ms);
  EXPECT_EQ(received(client), request);
  client.write(text_of("00 02" + request.substr(5)));
  ASSERT_TRUE(scene.until([&] { return received(client) == request + " 00 02" + request.substr(5); }));
}

TEST(TcpRules, AnAnswerComesByteByByte) {
  TcpScene scene("[[rule]]\non = { message = \"answer\" }\ndo = \"slow\"\ngap_ms = 10\ntimes = 1\n");
  const RawClient client = scene.client();
  const auto began = std::chrono::steady_clock::now();
  client.write(text_of(request + " 00 02" + request.substr(5)));
  ASSERT_TRUE(scene.until([&] { return !client.text().empty(); }));
  EXPECT_LT(client.text().size(), 12U);
  ASSERT_TRUE(scene.until([&] { return client.text().size() >= 12; }));
  EXPECT_GE(std::chrono::steady_clock::now() - began, 110ms);
  ASSERT_TRUE(scene.until([&] { return client.text().size() >= 24; }));
  EXPECT_EQ(received(client), request + " 00 02" + request.substr(5)) << "the next answer waits behind the slow one";
}

bool is_reset(const RawClient& client) {
  char byte = 0;
  return ::recv(client.descriptor(), &byte, 1, MSG_DONTWAIT) < 0 && errno == ECONNRESET;
}

TEST(TcpRules, ConnectionsEndAndNewOnesAreRefused) {
  TcpScene scene(R"(
[[rule]]
bus = "rs"
when = { message = { message = "request" }, count = 2 }
for_ms = 100
do = "accept"
on = false
)");
  const RawClient one = scene.client();
  one.write(text_of(request));
  ASSERT_TRUE(scene.until([&] { return received(one) == request; }));
  EXPECT_FALSE(one.ended());
  one.write(text_of(request));
  ASSERT_TRUE(scene.until([&] { return one.ended(); }));
  EXPECT_EQ(scene.director->rules().front().acts, 1U);
  const RawClient refused = scene.client();
  ASSERT_TRUE(scene.until([&] { return is_reset(refused); }));
  while (scene.line.now() < 1s) scene.step();
  const RawClient served = scene.client();
  served.write(text_of(request));
  ASSERT_TRUE(scene.until([&] { return received(served) == request; }));
}

}  // namespace
}  // namespace tcp_rules_test
}  // namespace servodrome::scenario::test
