#include "tools/sniff/can_services.hpp"

#include <array>
#include <chrono>
#include <cstring>
#include <fmt/format.h>

#include "canopen/device_events.hpp"
#include "ethercat/bytes.hpp"

namespace servodrome::master {
namespace {

using canopen::Frame;
using canopen::NmtCommand;

// Content of an LSS command after its specifier.
enum class Content : std::uint8_t { nothing, number, mode, node_id, bit_timing, delay, result, scan };

struct LssCommand {
  std::uint8_t specifier;
  bool from_master;
  const char* text;
  Content content;
};

// LSS commands (CiA 305 table 2).
constexpr auto lss_commands = std::to_array<LssCommand>({
    {4, true, "switch all", Content::mode},
    {17, true, "configure node-ID", Content::node_id},
    {17, false, "node-ID", Content::result},
    {19, true, "configure bit timing", Content::bit_timing},
    {19, false, "bit timing", Content::result},
    {21, true, "activate bit timing", Content::delay},
    {23, true, "store configuration", Content::nothing},
    {23, false, "store", Content::result},
    {64, true, "select vendor-ID", Content::number},
    {65, true, "select product code", Content::number},
    {66, true, "select revision number", Content::number},
    {67, true, "select serial number", Content::number},
    {68, false, "selected", Content::nothing},
    {70, true, "identify vendor-ID", Content::number},
    {71, true, "identify product code", Content::number},
    {72, true, "identify revision number from", Content::number},
    {73, true, "identify revision number up to", Content::number},
    {74, true, "identify serial number from", Content::number},
    {75, true, "identify serial number up to", Content::number},
    {76, true, "identify non-configured remote slave", Content::nothing},
    {79, false, "identified", Content::nothing},
    {80, false, "non-configured slave", Content::nothing},
    {81, true, "fastscan", Content::scan},
    {90, true, "inquire vendor-ID", Content::nothing},
    {90, false, "vendor-ID", Content::number},
    {91, true, "inquire product code", Content::nothing},
    {91, false, "product code", Content::number},
    {92, true, "inquire revision number", Content::nothing},
    {92, false, "revision number", Content::number},
    {93, true, "inquire serial number", Content::nothing},
    {93, false, "serial number", Content::number},
    {94, true, "inquire node-ID", Content::nothing},
    {94, false, "node-ID is", Content::node_id},
});

std::string content_text(Content content, const Frame& frame) {
  switch (content) {
    case Content::nothing: return "";
    case Content::number: return fmt::format(" {:08X}h", ethercat::load_u32(&frame.data[1]));
    case Content::mode: return frame.data[1] == 0 ? " to waiting" : " to configuration";
    case Content::node_id: return frame.data[1] == 0xFF ? " none" : fmt::format(" {}", frame.data[1]);
    case Content::bit_timing: return fmt::format(" table {} index {}", frame.data[1], frame.data[2]);
    case Content::delay: return fmt::format(" after {} ms", ethercat::load_u16(&frame.data[1]));
    case Content::result:
      return frame.data[1] == 0 ? " taken" : fmt::format(" refused: error {}, {}", frame.data[1], frame.data[2]);
    case Content::scan:
      return fmt::format(" {:08X}h, bit {}, part {}", ethercat::load_u32(&frame.data[1]), frame.data[5], frame.data[6]);
  }
  return "";
}

}  // namespace

std::string nmt_text(const Frame& frame) {
  if (frame.length != 2) return "NMT of wrong length";
  const auto word = [&]() -> const char* {
    switch (static_cast<NmtCommand>(frame.data[0])) {
      case NmtCommand::start: return "start";
      case NmtCommand::stop: return "stop";
      case NmtCommand::enter_pre_operational: return "enter pre-operational";
      case NmtCommand::reset_node: return "reset node";
      case NmtCommand::reset_communication: return "reset communication";
    }
    return "unknown command";
  }();
  return frame.data[1] == 0 ? fmt::format("NMT {}: all nodes", word)
                            : fmt::format("NMT {}: node {}", word, frame.data[1]);
}

std::string time_text(const Frame& frame) {
  if (frame.length != 6) return "TIME of wrong length";
  const std::uint32_t milliseconds = ethercat::load_u32(frame.data.data()) & 0x0FFFFFFF;
  const auto day =
      std::chrono::sys_days(std::chrono::year(1984) / 1 / 1) + std::chrono::days(ethercat::load_u16(&frame.data[4]));
  const std::chrono::year_month_day date(day);
  return fmt::format("TIME {:04}-{:02}-{:02} {:02}:{:02}:{:02}.{:03}", static_cast<int>(date.year()),
                     static_cast<unsigned>(date.month()), static_cast<unsigned>(date.day()), milliseconds / 3'600'000,
                     milliseconds / 60'000 % 60, milliseconds / 1000 % 60, milliseconds % 1000);
}

std::string lss_text(const Frame& frame) {
  if (frame.length != 8) return "LSS of wrong length";
  const bool from_master = frame.id == 0x7E5;
  for (const LssCommand& command : lss_commands) {
    if (command.specifier != frame.data[0] || command.from_master != from_master) continue;
    return fmt::format("LSS {}{}", command.text, content_text(command.content, frame));
  }
  return fmt::format("LSS command {:02X}h", frame.data[0]);
}

}  // namespace servodrome::master
