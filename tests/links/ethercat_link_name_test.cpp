#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <string>
#include <variant>

#include "links/ethercat/client.hpp"
#include "links/ethercat_rig.hpp"
#include "links/link_error.hpp"

namespace servodrome::links {
namespace ethercat_link_name_test {
namespace {

using testing::HasSubstr;

std::string error_of(std::string_view text) {
  try {
    parse_ethercat_link(text);
  } catch (const LinkError& error) {
    EXPECT_EQ(error.code(), std::errc::invalid_argument);
    return error.what();
  }
  return "no error";
}

TEST(EthercatLinkName, Raw) {
  const auto one = std::get<RawName>(parse_ethercat_link("raw:veth0"));
  EXPECT_EQ(one.interface, "veth0");
  EXPECT_EQ(one.secondary, std::nullopt);
  EXPECT_FALSE(one.busy);
  const auto ring = std::get<RawName>(parse_ethercat_link("raw:eth1+eth2,busy"));
  EXPECT_EQ(ring.interface, "eth1");
  EXPECT_EQ(ring.secondary, "eth2");
  EXPECT_TRUE(ring.busy);
}

TEST(EthercatLinkName, Udp) {
  const auto bare = std::get<EthercatUdpName>(parse_ethercat_link("udp:127.0.0.1"));
  EXPECT_EQ(bare.host, "127.0.0.1");
  EXPECT_EQ(bare.port, 34980);
  EXPECT_FALSE(bare.busy);
  const auto v6 = std::get<EthercatUdpName>(parse_ethercat_link("udp:[::1]:5000,busy"));
  EXPECT_EQ(v6.host, "::1");
  EXPECT_EQ(v6.port, 5000);
  EXPECT_TRUE(v6.busy);
}

TEST(EthercatLinkName, WritesWhatItReads) {
  for (const char* text :
       {"raw:veth0", "raw:veth0,busy", "raw:a+b", "raw:a+b,busy", "udp:127.0.0.1:34980", "udp:[::1]:1,busy", "mem:"}) {
    EXPECT_EQ(to_string(parse_ethercat_link(text)), text);
  }
}

// The message names the error, its place and the remedy.
TEST(EthercatLinkName, ErrorsSayWhatWhereAndWhatToDo) {
  struct Case {
    std::string_view text;
    const char* reason;
    const char* advice;
  };
  const Case cases[] = {
      {"", "there is no \":\"", "raw:INTERFACE, udp:HOST:PORT, mem:"},
      {"veth0", "there is no \":\"", "raw:INTERFACE, udp:HOST:PORT, mem:"},
      {"eth:veth0", "\"eth\" is not a kind of EtherCAT link", "raw:INTERFACE, udp:HOST:PORT, mem:"},
      {"raw:", "a word of 1 to 15 characters", "for example raw:eth1"},
      {"raw:0123456789abcdef", "a word of 1 to 15 characters", "for example raw:eth1"},
      {"raw:a b", "a word of 1 to 15 characters", "for example raw:eth1"},
      {"raw:a+", "a word of 1 to 15 characters", "raw:INTERFACE+INTERFACE"},
      {"raw:+a", "a word of 1 to 15 characters", "raw:INTERFACE+INTERFACE"},
      {"raw:a+a", "a ring has two interfaces", "raw:INTERFACE+INTERFACE"},
      {"raw:a+b+c/", "a word of 1 to 15 characters", "raw:INTERFACE+INTERFACE"},
      {"raw:a,bussy", "only \"busy\" may follow a comma", "\",busy\" may follow"},
      {"udp:", "there is no host", "udp:HOST:PORT"},
      {"udp:127.0.0.1:99999", "port \"99999\" is not a number", "udp:127.0.0.1:34980"},
      {"udp:127.0.0.1:34980,", "only \"busy\" may follow a comma", "udp:HOST:PORT"},
      {"udp:::1", "an IPv6 address stands in brackets", "[::1]:PORT"},
      {"mem:x", "nothing may follow the colon", "write mem:"},
  };
  for (const Case& c : cases) {
    const std::string error = error_of(c.text);
    EXPECT_THAT(error, HasSubstr("EtherCAT link \"" + std::string(c.text) + "\"")) << c.text;
    EXPECT_THAT(error, HasSubstr(c.reason)) << c.text;
    EXPECT_THAT(error, HasSubstr(c.advice)) << c.text;
  }
}

TEST(EthercatLinkName, MemIsForTheSameProcessOnly) {
  test::EthercatRig rig;
  EXPECT_THROW(open_ethercat_link(MemName{}, rig.bus, rig.io, rig.watch, rig), LinkError);
  EXPECT_THROW(open_ethercat_client("mem:"), LinkError);
}

}  // namespace
}  // namespace ethercat_link_name_test
}  // namespace servodrome::links
