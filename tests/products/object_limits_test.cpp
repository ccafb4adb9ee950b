#include <gtest/gtest.h>
#include <map>
#include <string>

#include "ethercat_rig.hpp"
#include "jmc_rig.hpp"
#include "products/generic402/generic402.hpp"
#include "products/generic402/generic402_ec.hpp"
#include "products/ismc/ismc.hpp"
#include "products/ismk/ismk.hpp"
#include "products/ismk/ismk_ea.hpp"
#include "products/pronet/pronet.hpp"

// The accepted and refused values of every object with a range, and its declared unit, in every product.
namespace servodrome::test {
namespace object_limits_test {
namespace {

using dictionary::AbortCode;
using dictionary::Entry;

template <typename DeviceType>
void check_limits() {
  Rig<DeviceType> rig;
  rig.run_ms(5);
  int limits = 0;
  for (const Entry& entry : DeviceType::table) {
    if (!entry.writable() || !entry.readable() || !entry.has_range || entry.local || !entry.fixed_size()) continue;
    if (dictionary::size_of(entry.type) > 4 || entry.type == dictionary::Type::real32) continue;
    SCOPED_TRACE(testing::Message() << std::hex << entry.index << "h:" << int{entry.sub});
    const auto outside = [&](std::int64_t value, AbortCode code) {
      ++limits;
      const std::int64_t before = rig.get(entry.index, entry.sub);
      const AbortCode answer = rig.set(entry.index, entry.sub, value);
      EXPECT_TRUE(answer == code || answer == AbortCode::value_invalid) << value;
      EXPECT_EQ(rig.get(entry.index, entry.sub), before) << value;
    };
    const auto inside = [&](std::int64_t value) {
      const AbortCode answer = rig.set(entry.index, entry.sub, value);
      EXPECT_TRUE(answer != AbortCode::value_too_low && answer != AbortCode::value_too_high) << value;
    };
    if (entry.minimum > dictionary::minimum_of(entry.type)) outside(entry.minimum - 1, AbortCode::value_too_low);
    if (entry.maximum < dictionary::maximum_of(entry.type)) outside(entry.maximum + 1, AbortCode::value_too_high);
    inside(entry.minimum);
    inside(entry.maximum);
  }
  EXPECT_GT(limits, 10);
}

TEST(Limits, Generic402) { check_limits<products::Generic402>(); }
TEST(Limits, Generic402Ec) { check_limits<products::Generic402Ec>(); }
TEST(Limits, Ismc) { check_limits<products::Ismc>(); }
TEST(Limits, Ismk) { check_limits<products::Ismk>(); }
TEST(Limits, IsmkEa) { check_limits<products::IsmkEa>(); }
TEST(Limits, JmcEc) { check_limits<products::JmcEc>(); }
TEST(Limits, Pronet) { check_limits<products::Pronet>(); }

// The unit codes of ETG.1004: power of ten, numerator, denominator. 0: a unit of the user or the maker, which has no
// code.
const std::map<std::string, std::uint32_t> unit_codes = {
    {"%", 0xFE000000},
    {"0.01 Hz", 0xFE200000},
    {"0.01/s", 0xFE000300},
    {"0.1 % of rated current", 0xFD000000},
    {"0.1 % of rated torque", 0xFD000000},
    {"0.1 % of rated torque per s", 0xFD000300},
    {"0.1%", 0xFD000000},
    {"0.1%/s", 0xFD000300},
    {"Hz", 0x00200000},
    {"V", 0x00260000},
    {"degC", 0x002D0000},
    {"encoder increment", 0x00B50000},
    {"inc", 0x00B50000},
    {"inc/ms", 0x03B50300},
    {"inc/rev", 0x00B5B400},
    {"inc/s", 0x00B50300},
    {"increment", 0x00B50000},
    {"mA", 0xFD040000},
    {"mNm", 0xFD560000},
    {"mV", 0xFD260000},
    {"ms", 0xFD030000},
    {"ns", 0xF7030000},
    {"permille", 0xFD000000},
    {"r/min", 0x00B44700},
    {"rev", 0x00B40000},
    {"revolution", 0x00B40000},
    {"rpm", 0x00B44700},
    {"s", 0x00030000},
    {"", 0},
    {"Ap", 0},
    {"Ap (DEC raw)", 0},
    {"DEC", 0},
    {"DEC (2546/Hz)", 0},
    {"DEC (Hz shown)", 0},
    {"acc", 0},
    {"code", 0},
    {"command unit", 0},
    {"command unit/s", 0},
    {"command unit/s2", 0},
    {"inc/16s (DEC)", 0},
    {"jerk", 0},
    {"pos", 0},
    {"rpm (DEC raw)", 0},
    {"rps/s (DEC raw)", 0},
    {"uA s/rad", 0},
    {"uA/rad", 0},
    {"vel", 0},
};

template <typename DeviceType>
void check_units() {
  EthercatRig<DeviceType> rig;
  rig.to_pre_operational();
  for (const Entry& entry : rig.device.bus_dictionary().table()) {
    if (entry.local) continue;
    SCOPED_TRACE(testing::Message() << std::hex << entry.index << "h:" << int{entry.sub} << " " << entry.unit);
    // Get entry description with its unit (ETG.1000.6 table 45).
    Bytes request = little_endian(std::uint16_t{8U << 12}, std::uint8_t{5}, std::uint8_t{0}, std::uint16_t{0},
                                  entry.index, entry.sub, std::uint8_t{0x08});
    rig.post(3, request);
    const Bytes mail = rig.fetch();
    ASSERT_GE(mail.size(), 22U);
    ASSERT_EQ(mail[8] & 0x7F, 6);
    const bool has_unit = (mail[15] & 0x08) != 0;
    const std::uint32_t code = has_unit ? ethercat::load_u32(&mail[22]) : 0;
    const auto expected = unit_codes.find(entry.unit);
    ASSERT_NE(expected, unit_codes.end());
    EXPECT_EQ(code, expected->second);
    EXPECT_EQ(has_unit, code != 0);
  }
}

TEST(Units, Generic402Ec) { check_units<products::Generic402Ec>(); }
TEST(Units, IsmkEa) { check_units<products::IsmkEa>(); }
TEST(Units, JmcEc) { check_units<products::JmcEc>(); }

}  // namespace
}  // namespace object_limits_test
}  // namespace servodrome::test
