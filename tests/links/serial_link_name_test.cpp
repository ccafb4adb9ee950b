#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "links/link_error.hpp"
#include "links/serial/format_text.hpp"
#include "links/serial/link_name.hpp"

namespace servodrome::links {
namespace serial_link_name_test {
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

// The message names the error, its place and the remedy.
TEST(SerialLinkName, ErrorsSayWhatWhereAndWhatToDo) {
  struct Case {
    std::string_view text;
    const char* reason;
    const char* advice;
  };
  const Case cases[] = {
      {"", "there is no \":\"", "one of pty:PATH"},
      {"/dev/ttyS0", "there is no \":\"", "serial:DEVICE"},
      {"rtu:/dev/ttyS0", "\"rtu\" is not a kind of serial link", "tcp:HOST:PORT"},
      {"pty:", "there is no path", "pty:/run/servodrome/axis3"},
      {"serial:", "there is no path", "serial:/dev/ttyUSB0"},
      {std::string_view("pty:a\0b", 7), "zero byte", "pty:PATH"},
      {"tcp:", "there is no host", "tcp:127.0.0.1:1502"},
      {"tcp:localhost:70000", "port \"70000\" is not a number from 0 to 65535", "tcp:HOST:PORT"},
      {"tcp:::1:502", "brackets", "tcp:HOST:PORT"},
      {"tcp:[::1", "closing \"]\"", "tcp:HOST:PORT"},
      {"tcp:a b:1", "\"a b\" is not a host name", "tcp:HOST:PORT"},
      {"tcp:[[::1]", "\"[::1\" is not a host name", "tcp:HOST:PORT"},
      {"tcp:a]:1", "\"a]\" is not a host name", "tcp:HOST:PORT"},
      {"mem:x", "nothing may follow", "write mem:"},
  };
  for (const Case& item : cases) {
    const std::string message = error_of(item.text);
    EXPECT_THAT(message, HasSubstr("serial link \""));
    EXPECT_THAT(message, HasSubstr(item.reason));
    EXPECT_THAT(message, HasSubstr(item.advice)) << message;
  }
}

TEST(CharacterFormatText, IsReadAndWritten) {
  for (const char* text : {"8N1", "8E1", "8O1", "8N2", "8E2", "7E1"}) {
    const auto format = parse_character_format(text, 9600);
    ASSERT_TRUE(format) << text;
    EXPECT_EQ(format->bit_rate, 9600U);
    EXPECT_EQ(to_string(*format), text);
  }
  EXPECT_EQ(parse_character_format("8O2", 1)->bits(), 12U);
  EXPECT_EQ(parse_character_format("8E1", 1)->parity, modbus::Parity::even);
  for (const char* text : {"", "8N", "8N11", "9N1", "8n1", "8X1", "8N0", "8N3"}) {
    EXPECT_EQ(parse_character_format(text, 9600), std::nullopt) << text;
  }
}

}  // namespace
}  // namespace serial_link_name_test
}  // namespace servodrome::links
