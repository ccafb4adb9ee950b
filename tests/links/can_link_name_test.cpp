#include <boost/asio/io_context.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <string>
#include <variant>

#include "links/can/client.hpp"
#include "links/can/link.hpp"
#include "links/can/link_name.hpp"
#include "links/link_error.hpp"

namespace servodrome::links {
namespace can_link_name_test {
namespace {

using testing::HasSubstr;

std::string error_of(std::string_view text) {
  try {
    parse_can_link(text);
  } catch (const LinkError& error) {
    EXPECT_EQ(error.code(), std::errc::invalid_argument);
    return error.what();
  }
  return "no error";
}

TEST(CanLinkName, Socketcand) {
  const auto name = std::get<SocketcandName>(parse_can_link("socketcand:127.0.0.1:29537/vcan3"));
  EXPECT_EQ(name.host, "127.0.0.1");
  EXPECT_EQ(name.port, 29537);
  EXPECT_EQ(name.bus, "vcan3");
  const auto bare = std::get<SocketcandName>(parse_can_link("socketcand:localhost"));
  EXPECT_EQ(bare.port, 29536);
  EXPECT_EQ(bare.bus, "can0");
  const auto v6 = std::get<SocketcandName>(parse_can_link("socketcand:[::1]:1/can0"));
  EXPECT_EQ(v6.host, "::1");
  EXPECT_EQ(v6.port, 1);
}

TEST(CanLinkName, TheOthers) {
  EXPECT_EQ(std::get<SlcanName>(parse_can_link("slcan:/run/a:b")).path, "/run/a:b");
  EXPECT_EQ(std::get<SocketcanName>(parse_can_link("socketcan:vcan0")).interface, "vcan0");
  EXPECT_TRUE(std::holds_alternative<MemName>(parse_can_link("mem:")));
}

TEST(CanLinkName, WritesWhatItReads) {
  for (const char* text :
       {"socketcand:127.0.0.1:29536/can0", "socketcand:[::1]:1/x", "slcan:/tmp/x", "socketcan:can1", "mem:"}) {
    EXPECT_EQ(to_string(parse_can_link(text)), text);
  }
}

// The message names the error, its place and the remedy.
TEST(CanLinkName, ErrorsSayWhatWhereAndWhatToDo) {
  struct Case {
    std::string_view text;
    const char* reason;
    const char* advice;
  };
  const Case cases[] = {
      {"", "there is no \":\"", "one of socketcand:HOST:PORT/BUS"},
      {"can0", "there is no \":\"", "socketcan:INTERFACE"},
      {"usb:0", "\"usb\" is not a kind of CAN link", "slcan:PATH"},
      {"socketcand:", "there is no host", "socketcand:127.0.0.1:29536/can0"},
      {"socketcand:/can0", "there is no host", "socketcand:127.0.0.1"},
      {"socketcand:localhost:70000/can0", "port \"70000\" is not a number from 0 to 65535", "HOST:PORT/BUS"},
      {"socketcand:localhost:-1/can0", "port \"-1\"", "HOST:PORT/BUS"},
      {"socketcand:localhost:/can0", "port \"\"", "HOST:PORT/BUS"},
      {"socketcand:localhost:80x/can0", "port \"80x\"", "HOST:PORT/BUS"},
      {"socketcand:localhost:80/", "bus after \"/\"", "HOST:PORT/BUS"},
      {"socketcand:localhost:80/a b", "bus after \"/\"", "HOST:PORT/BUS"},
      {"socketcand:localhost:80/12345678901234567", "1 to 16 characters", "HOST:PORT/BUS"},
      {"socketcand:::1:80/can0", "brackets", "HOST:PORT/BUS"},
      {"socketcand:[::1/can0", "closing \"]\"", "HOST:PORT/BUS"},
      {"socketcand:[::1]80/can0", "only \":PORT\"", "HOST:PORT/BUS"},
      {"slcan:", "there is no path", "slcan:PATH"},
      {"socketcan:", "interface must be a word", "socketcan:vcan0"},
      {"socketcan:abcdefghijklmnop", "1 to 15 characters", "socketcan:vcan0"},
      {"mem:x", "nothing may follow", "write mem:"},
  };
  for (const Case& item : cases) {
    const std::string message = error_of(item.text);
    EXPECT_THAT(message, HasSubstr("\"" + std::string(item.text) + "\""));
    EXPECT_THAT(message, HasSubstr(item.reason));
    EXPECT_THAT(message, HasSubstr(item.advice)) << message;
  }
}

TEST(CanLink, MemIsNotForOthers) {
  struct Host : LineHost {
    Time now() override { return Time{}; }
    void wake() override {}
  } host;
  CanBus bus;
  boost::asio::io_context io;
  EXPECT_THROW(open_can_link(MemName{}, bus, io, host), LinkError);
  EXPECT_THROW(open_can_client("mem:"), LinkError);
}

}  // namespace
}  // namespace can_link_name_test
}  // namespace servodrome::links
