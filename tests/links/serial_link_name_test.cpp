#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "links/link_error.hpp"
#include "links/serial/link_name.hpp"

namespace servodrome::links {
namespace {

using testing::HasSubstr;

std::string error_of(std::string_view text) {
  try {
    parse_serial_link(text);
  } catch (const LinkError& error) {
    EXPECT_EQ(error.code(), std::errc::invalid_argument);
    return error.what();
  }
  return "no error";
}

TEST(SerialLinkName, EachKind) {
  EXPECT_EQ(std::get<PtyName>(parse_serial_link("pty:/run/a:b")).path, "/run/a:b");
  EXPECT_EQ(std::get<TtyName>(parse_serial_link("serial:/dev/ttyUSB0")).device, "/dev/ttyUSB0");
  EXPECT_TRUE(std::holds_alternative<MemName>(parse_serial_link("mem:")));
  const Endpoint endpoint = std::get<ModbusTcpName>(parse_serial_link("tcp:localhost:502")).endpoint;
  EXPECT_EQ(endpoint.host, "localhost");
  EXPECT_EQ(endpoint.port, 502);
  EXPECT_EQ(std::get<ModbusTcpName>(parse_serial_link("tcp:0.0.0.0")).endpoint.port, 1502);
  EXPECT_EQ(std::get<ModbusTcpName>(parse_serial_link("tcp:[::1]:7")).endpoint.host, "::1");
}

TEST(SerialLinkName, WritesWhatItReads) {
  for (const char* text : {"pty:/tmp/x", "serial:/dev/ttyS0", "tcp:127.0.0.1:1502", "tcp:[::1]:1", "mem:"}) {
    EXPECT_EQ(to_string(parse_serial_link(text)), text);
  }
}

// What, where, and what to do.
TEST(SerialLinkName, ErrorsSayWhatWhereAndWhatToDo) {
  struct Case {
    std::string_view text;
    const char* reason;
    const char* advice;
  };
  const Case cases[] = {
      {"", "there is no \":\"", "one of pty:PATH"},
      {"/dev/ttyS0", "there is no \":\"", "serial:DEVICE"},
      {"rtu:/dev/ttyS0", "\"rtu\" is no kind of serial link", "tcp:HOST:PORT"},
      {"pty:", "there is no path", "pty:/run/servodrome/axis3"},
      {"serial:", "there is no path", "serial:/dev/ttyUSB0"},
      {std::string_view("pty:a\0b", 7), "zero byte", "pty:PATH"},
      {"tcp:", "there is no host", "tcp:127.0.0.1:1502"},
      {"tcp:localhost:70000", "port \"70000\" is not a number from 0 to 65535", "tcp:HOST:PORT"},
      {"tcp:::1:502", "brackets", "tcp:HOST:PORT"},
      {"tcp:[::1", "closing \"]\"", "tcp:HOST:PORT"},
      {"tcp:a b:1", "\"a b\" is no host name", "tcp:HOST:PORT"},
      {"mem:x", "nothing may follow", "write mem:"},
  };
  for (const Case& item : cases) {
    const std::string message = error_of(item.text);
    EXPECT_THAT(message, HasSubstr("serial link \""));
    EXPECT_THAT(message, HasSubstr(item.reason));
    EXPECT_THAT(message, HasSubstr(item.advice)) << message;
  }
}

}  // namespace
}  // namespace servodrome::links
