#include "host/emergency.hpp"

#include <algorithm>
#include <fmt/format.h>
#include <fmt/ranges.h>

namespace servodrome::host {
namespace {

struct ErrorCode {
  std::uint16_t code;
  const char* text;
};

// A code that is not here is described by its class: the last digits replaced by zeros, one after another.
constexpr auto error_codes = std::to_array<ErrorCode>({
    {0x0000, "no error"},
    {0x1000, "generic error"},
    {0x2000, "current"},
    {0x2100, "current, device input side"},
    {0x2200, "current inside the device"},
    {0x2220, "continuous over-current inside the device"},
    {0x2230, "short circuit or earth leakage inside the device"},
    {0x2300, "current, device output side"},
    {0x2310, "continuous over-current"},
    {0x2320, "short circuit or earth leakage, device output side"},
    {0x2340, "short circuit, device output side"},
    {0x2350, "load level fault (I2t)"},
    {0x2380, "load level warning (I2t)"},
    {0x3000, "voltage"},
    {0x3100, "mains voltage"},
    {0x3110, "mains over-voltage"},
    {0x3120, "mains under-voltage"},
    {0x3130, "phase failure"},
    {0x3200, "DC link voltage"},
    {0x3210, "DC link over-voltage"},
    {0x3220, "DC link under-voltage"},
    {0x3300, "output voltage"},
    {0x4000, "temperature"},
    {0x4100, "ambient temperature"},
    {0x4200, "device temperature"},
    {0x4210, "excess device temperature"},
    {0x4300, "drive temperature"},
    {0x4310, "excess drive temperature"},
    {0x5000, "device hardware"},
    {0x5100, "device supply"},
    {0x5200, "device control"},
    {0x5300, "operating unit"},
    {0x5400, "power section"},
    {0x5440, "contacts"},
    {0x5500, "data storage"},
    {0x5530, "non-volatile data memory"},
    {0x6000, "device software"},
    {0x6100, "internal software"},
    {0x6200, "user software"},
    {0x6300, "data record"},
    {0x6320, "parameter error"},
    {0x7000, "additional modules"},
    {0x7100, "power"},
    {0x7110, "brake chopper"},
    {0x7120, "motor"},
    {0x7121, "motor blocked"},
    {0x7122, "motor error or commutation malfunction"},
    {0x7200, "measurement circuit"},
    {0x7300, "sensor"},
    {0x7303, "resolver 1 fault"},
    {0x7305, "incremental sensor 1 fault"},
    {0x7310, "speed"},
    {0x7320, "position"},
    {0x7380, "encoder"},
    {0x7500, "communication"},
    {0x7600, "data storage, external"},
    {0x8000, "monitoring"},
    {0x8100, "communication"},
    {0x8110, "CAN overrun: objects lost"},
    {0x8120, "CAN in error passive mode"},
    {0x8130, "life guard or heartbeat error"},
    {0x8140, "recovered from bus-off"},
    {0x8150, "CAN-ID collision"},
    {0x8200, "protocol error"},
    {0x8210, "PDO not processed: length error"},
    {0x8220, "PDO length exceeded"},
    {0x8240, "unexpected SYNC data length"},
    {0x8250, "RPDO timeout"},
    {0x8300, "torque control"},
    {0x8311, "excess torque"},
    {0x8400, "velocity speed controller"},
    {0x8480, "speed above its limit"},
    {0x8500, "position controller"},
    {0x8600, "positioning controller"},
    {0x8611, "following error"},
    {0x8612, "reference limit"},
    {0x8700, "sync controller"},
    {0x8800, "winding controller"},
    {0x8900, "process data monitoring"},
    {0x9000, "external error"},
    {0xF000, "additional functions"},
    {0xFF00, "device specific"},
});
static_assert(std::is_sorted(error_codes.begin(), error_codes.end(),
                             [](const ErrorCode& a, const ErrorCode& b) { return a.code < b.code; }));

const char* find(std::uint16_t code) {
  const auto found = std::lower_bound(error_codes.begin(), error_codes.end(), code,
                                      [](const ErrorCode& entry, std::uint16_t wanted) { return entry.code < wanted; });
  return found != error_codes.end() && found->code == code ? found->text : nullptr;
}

}  // namespace

std::string text_of_error_code(std::uint16_t code) {
  if (code < 0x1000) return "no error";  // 00xxh: error reset or no error
  if (const char* text = find(code)) return text;
  for (const unsigned mask : {0xFFF0U, 0xFF00U, 0xF000U}) {
    if (const char* text = find(static_cast<std::uint16_t>(code & mask))) return fmt::format("class: {}", text);
  }
  return "manufacturer's code";
}

std::string text_of(const Emergency& emergency) {
  return fmt::format("EMCY {:04X}h {}, error register {:02X}h, vendor {:02X}", emergency.code,
                     text_of_error_code(emergency.code), emergency.error_register, fmt::join(emergency.vendor, " "));
}

}  // namespace servodrome::host
