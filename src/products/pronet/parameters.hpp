#pragma once

#include <array>
#include <cstdint>

#include "dictionary/table.hpp"

// The drive's own parameters Pnxxx as objects 3000h to 3100h (ProNet manual, appendix), all of them UINT16 but Pn505.
// The CANopen manual prints index and unit; names, ranges and factory values are in the series manual. Factory values
// are this project's choice, 0 where the parameter does nothing here.
namespace servodrome::products::pronet {

enum class Effect : std::uint8_t {
  at_once,
  after_restart,  // control supply off and on (ch. 8)
};

struct Parameter {
  std::uint16_t index;
  std::uint16_t number;  // xxx of Pnxxx
  const char* name;
  const char* unit;
  std::int32_t factory_value;
  Effect effect;
  std::uint16_t highest_digits = 0xFFFF;  // greatest value of each hex digit
};

inline constexpr auto parameters = std::to_array<Parameter>({
    {0x3000, 0, "Pn000", "", 0, Effect::at_once},
    {0x3001, 1, "Pn001", "", 0, Effect::at_once},
    {0x3002, 2, "Pn002", "", 0, Effect::at_once},
    {0x3003, 3, "Pn003", "", 0, Effect::at_once},
    {0x3004, 4, "Pn004", "", 0, Effect::at_once},
    {0x3005, 5, "Pn005", "", 0, Effect::at_once},
    {0x3006, 6, "Pn006", "", 0x0003, Effect::after_restart, 0x2103},
    {0x3007, 7, "Pn007", "", 0, Effect::at_once},
    {0x3010, 100, "Pn100", "", 0, Effect::at_once},
    {0x3011, 101, "Pn101", "", 0, Effect::at_once},
    {0x3012, 102, "Pn102", "Hz", 0, Effect::at_once},
    {0x3013, 103, "Pn103", "0.1ms", 0, Effect::at_once},
    {0x3014, 104, "Pn104", "1/s", 0, Effect::at_once},
    {0x3015, 105, "Pn105", "0.1ms", 0, Effect::at_once},
    {0x3016, 106, "Pn106", "", 0, Effect::at_once},
    {0x3017, 107, "Pn107", "Hz", 0, Effect::at_once},
    {0x3018, 108, "Pn108", "0.1ms", 0, Effect::at_once},
    {0x3019, 109, "Pn109", "Hz", 0, Effect::at_once},
    {0x301A, 110, "Pn110", "0.1ms", 0, Effect::at_once},
    {0x301B, 111, "Pn111", "r/min", 0, Effect::at_once},
    {0x301C, 112, "Pn112", "%", 0, Effect::at_once},
    {0x301D, 113, "Pn113", "0.1ms", 0, Effect::at_once},
    {0x301E, 114, "Pn114", "%", 0, Effect::at_once},
    {0x301F, 115, "Pn115", "0.1ms", 0, Effect::at_once},
    {0x3020, 116, "Pn116", "", 0, Effect::at_once},
    {0x3021, 117, "Pn117", "%", 0, Effect::at_once},
    {0x3022, 118, "Pn118", "", 0, Effect::at_once},
    {0x3023, 119, "Pn119", "", 0, Effect::at_once},
    {0x3024, 120, "Pn120", "", 0, Effect::at_once},
    {0x3025, 121, "Pn121", "", 0, Effect::at_once},
    {0x3026, 122, "Pn122", "0.1ms", 0, Effect::at_once},
    {0x3027, 123, "Pn123", "", 0, Effect::at_once},
    {0x3028, 124, "Pn124", "", 0, Effect::at_once},
    {0x3029, 125, "Pn125", "0.1ms", 0, Effect::at_once},
    {0x302A, 126, "Pn126", "", 0, Effect::at_once},
    {0x302B, 127, "Pn127", "0.1ms", 0, Effect::at_once},
    {0x302C, 128, "Pn128", "0.1%", 0, Effect::at_once},
    {0x302D, 129, "Pn129", "r/min", 0, Effect::at_once},
    {0x302E, 130, "Pn130", "0.1%", 0, Effect::at_once},
    {0x302F, 131, "Pn131", "r/min", 0, Effect::at_once},
    {0x3030, 132, "Pn132", "0.1%/1000rpm", 0, Effect::at_once},
    {0x3055, 305, "Pn305", "rpm", 0, Effect::at_once},
    {0x3056, 306, "Pn306", "ms", 0, Effect::at_once},
    {0x3057, 307, "Pn307", "ms", 0, Effect::at_once},
    {0x3058, 308, "Pn308", "ms", 0, Effect::at_once},
    {0x3059, 309, "Pn309", "ms", 0, Effect::at_once},
    {0x305A, 310, "Pn310", "", 0, Effect::at_once},
    {0x305B, 311, "Pn311", "", 0, Effect::at_once},
    {0x3068, 401, "Pn401", "%", 300, Effect::at_once},
    {0x3069, 402, "Pn402", "%", 300, Effect::at_once},
    {0x306A, 403, "Pn403", "%", 0, Effect::at_once},
    {0x306B, 404, "Pn404", "%", 0, Effect::at_once},
    {0x306C, 405, "Pn405", "%", 0, Effect::at_once},
    {0x306D, 406, "Pn406", "rpm", 0, Effect::at_once},
    {0x306E, 407, "Pn407", "Hz", 0, Effect::at_once},
    {0x306F, 408, "Pn408", "", 0, Effect::at_once},
    {0x3070, 409, "Pn409", "Hz", 0, Effect::at_once},
    {0x3071, 410, "Pn410", "", 0, Effect::at_once},
    {0x3072, 411, "Pn411", "0.1 Hz", 0, Effect::at_once},
    {0x3073, 412, "Pn412", "", 0, Effect::at_once},
    {0x3074, 413, "Pn413", "0.1ms", 0, Effect::at_once},
    {0x3075, 414, "Pn414", "rpm", 0, Effect::at_once},
    {0x3078, 500, "Pn500", "pulse", 0, Effect::at_once},
    {0x3079, 501, "Pn501", "rpm", 0, Effect::at_once},
    {0x307A, 502, "Pn502", "rpm", 0, Effect::at_once},
    {0x307B, 503, "Pn503", "rpm", 0, Effect::at_once},
    {0x307C, 504, "Pn504", "256pulse", 0, Effect::at_once},
    {0x307D, 505, "Pn505", "ms", 0, Effect::at_once},
    {0x307E, 506, "Pn506", "10ms", 0, Effect::at_once},
    {0x307F, 507, "Pn507", "rpm", 0, Effect::at_once},
    {0x3080, 508, "Pn508", "10ms", 0, Effect::at_once},
    {0x3081, 509, "Pn509", "", 0x3210, Effect::at_once},
    {0x3082, 510, "Pn510", "", 0x765C, Effect::at_once},
    {0x3083, 511, "Pn511", "", 0, Effect::at_once},
    {0x3084, 512, "Pn512", "", 0, Effect::at_once},
    {0x3085, 513, "Pn513", "", 0, Effect::at_once},
    {0x3086, 514, "Pn514", "0.2ms", 0, Effect::at_once},
    {0x3088, 516, "Pn516", "", 0, Effect::at_once},
    {0x3089, 517, "Pn517", "", 0, Effect::at_once},
    {0x3091, 525, "Pn525", "%", 0, Effect::at_once},
    {0x30FC, 700, "Pn700", "", 0, Effect::at_once},
    {0x30FD, 701, "Pn701", "", 0, Effect::at_once},
    {0x30FF, 703, "Pn703", "", 0x0005, Effect::after_restart, 0x0005},
    {0x3100, 704, "Pn704", "", 1, Effect::after_restart},
});

constexpr std::size_t place_of(std::uint16_t number) {
  std::size_t i = 0;
  while (i < parameters.size() && parameters[i].number != number) ++i;
  return i;
}

constexpr bool is_possible(const Parameter& parameter, unsigned value) {
  for (unsigned place = 0; place < 16; place += 4) {
    if ((value >> place & 0xFU) > (parameter.highest_digits >> place & 0xFU)) return false;
  }
  return true;
}

constexpr const Parameter* find_parameter(std::uint16_t index) {
  for (const Parameter& parameter : parameters) {
    if (parameter.index == index) return &parameter;
  }
  return nullptr;
}

// The values, in the order of the table.
struct ParameterValues {
  std::array<std::uint16_t, parameters.size()> values{};

  template <std::uint16_t number>
  constexpr std::uint16_t get() const {
    static_assert(place_of(number) < parameters.size());
    return values[place_of(number)];
  }
  template <std::uint16_t number>
  constexpr void set(std::uint16_t value) {
    static_assert(place_of(number) < parameters.size());
    values[place_of(number)] = value;
  }
  // Hex digit of a value, 0 is the lowest; the manual writes it Pnxxx.n.
  template <std::uint16_t number>
  constexpr unsigned digit(unsigned place) const {
    return get<number>() >> (4 * place) & 0xFU;
  }
};

// Checks Pn006 and Pn703. The range of Pn704 is in the object table.
constexpr bool bus_settings_are_possible(const ParameterValues& values) {
  return is_possible(parameters[place_of(6)], values.get<6>()) &&
         is_possible(parameters[place_of(703)], values.get<703>());
}

}  // namespace servodrome::products::pronet
