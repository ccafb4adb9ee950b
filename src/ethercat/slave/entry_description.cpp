#include "ethercat/slave/entry_description.hpp"

#include <algorithm>
#include <cstring>
#include <string_view>

#include "ethercat/slave/communication_objects.hpp"

namespace servodrome::ethercat {

using dictionary::Entry;

std::uint32_t size_in_object(const Entry& entry) {
  if (entry.fixed_size()) return dictionary::size_of(entry.type);
  return entry.text != nullptr ? static_cast<std::uint32_t>(std::strlen(entry.text)) : entry.capacity;
}

std::uint32_t bit_length(const Entry& entry) {
  return entry.type == dictionary::Type::boolean ? 1 : size_in_object(entry) * 8;
}

bool written_only_in_pre_operational(const Entry& entry) {
  if (entry.index >= 0x1600 && entry.index < 0x1C00) return true;
  if (entry.index == 0x1C12 || entry.index == 0x1C13) return true;
  return (entry.index == 0x1C32 || entry.index == 0x1C33) && entry.sub == sync_parameter::type;
}

bool is_start_up_parameter(const Profile& profile, const Entry& entry) {
  return std::any_of(profile.start_up.begin(), profile.start_up.end(), [&entry](const StartUpParameter& one) {
    return one.index == entry.index && one.sub == entry.sub;
  });
}

unsigned object_access(const Profile& profile, const Entry& entry) {
  constexpr unsigned read = 0x0007;
  constexpr unsigned write = 0x0038;
  constexpr unsigned write_in_pre_operational = 0x0008;
  constexpr unsigned in_rxpdo = 0x0040;
  constexpr unsigned in_txpdo = 0x0080;
  constexpr unsigned backup = 0x0100;
  constexpr unsigned setting = 0x0200;
  const auto pdo = static_cast<unsigned>(entry.pdo);
  unsigned bits = entry.readable() ? read : 0U;
  if (entry.writable()) bits |= written_only_in_pre_operational(entry) ? write_in_pre_operational : write;
  if ((pdo & static_cast<unsigned>(dictionary::Pdo::rpdo)) != 0) bits |= in_rxpdo;
  if ((pdo & static_cast<unsigned>(dictionary::Pdo::tpdo)) != 0) bits |= in_txpdo;
  if (entry.saved) bits |= backup;
  if (is_start_up_parameter(profile, entry)) bits |= setting;
  return bits;
}

namespace {

struct Unit {
  std::string_view name;
  std::uint32_t code;
};

// Prefix (power of ten) << 24 | numerator << 16 | denominator << 8. Numerators and denominators: none 00h, second 03h,
// ampere 04h, hertz 20h, watt 24h, volt 26h, ohm 28h, henry 2Ch, degree Celsius 2Dh, degree 41h, minute 47h, newton
// metre 56h, revolution B4h, increment B5h. Per cent and per mille are powers of ten without a unit.
constexpr Unit units[] = {
    {"s", 0x00030000},
    {"ms", 0xFD030000},
    {"100 us", 0xFC030000},
    {"us", 0xFA030000},
    {"ns", 0xF7030000},
    {"A", 0x00040000},
    {"0.1 A", 0xFF040000},
    {"mA", 0xFD040000},
    {"Hz", 0x00200000},
    {"0.1 Hz", 0xFF200000},
    {"0.01 Hz", 0xFE200000},
    {"kHz", 0x03200000},
    {"W", 0x00240000},
    {"V", 0x00260000},
    {"0.1 V", 0xFF260000},
    {"mV", 0xFD260000},
    {"ohm", 0x00280000},
    {"mohm", 0xFD280000},
    {"mH", 0xFD2C0000},
    {"uH", 0xFA2C0000},
    {"degC", 0x002D0000},
    {"0.1 degC", 0xFF2D0000},
    {"deg", 0x00410000},
    {"N m", 0x00560000},
    {"Nm", 0x00560000},
    {"mNm", 0xFD560000},
    {"%", 0xFE000000},
    {"0.1%", 0xFD000000},
    {"0.1 %", 0xFD000000},
    {"0.1 % of rated torque", 0xFD000000},
    {"0.1 % of rated current", 0xFD000000},
    {"permille", 0xFD000000},
    {"0.01%", 0xFC000000},
    {"0.1%/s", 0xFD000300},
    {"0.1 % of rated torque per s", 0xFD000300},
    {"1/s", 0x00000300},
    {"0.01/s", 0xFE000300},
    {"rev", 0x00B40000},
    {"revolution", 0x00B40000},
    {"rev/s", 0x00B40300},
    {"rpm", 0x00B44700},
    {"0.1 rpm", 0xFFB44700},
    {"r/min", 0x00B44700},
    {"inc", 0x00B50000},
    {"increment", 0x00B50000},
    {"encoder increment", 0x00B50000},
    {"cnt", 0x00B50000},
    {"inc/s", 0x00B50300},
    {"cnt/s", 0x00B50300},
    {"inc/ms", 0x03B50300},
    {"inc/rev", 0x00B5B400},
};

}  // namespace

std::uint32_t unit_code(const char* unit) {
  const auto known =
      std::find_if(std::begin(units), std::end(units), [unit](const Unit& one) { return one.name == unit; });
  return known == std::end(units) ? 0 : known->code;
}

}  // namespace servodrome::ethercat
