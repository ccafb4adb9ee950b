#include "axis/fault_report.hpp"

#include <algorithm>
#include <array>
#include <fmt/format.h>

#include "axis/axis402.hpp"
#include "axis/cia402_words.hpp"
#include "catalogue/product.hpp"

namespace servodrome::master {
namespace {

// Bits of 1001h (CiA 301 table 48).
constexpr std::array register_bits{"generic",       "current",        "voltage", "temperature",
                                   "communication", "device profile", "bit 6",   "manufacturer"};

ReportedFault of_alarm(const catalogue::FaultText& text, ObjectAddress source) {
  return {.code = text.code, .alarm = text.alarm, .source = source, .meanings = {&text}};
}

// Bit 0 of the first word only reports that the second word is not 0, so it is skipped: there is no alarm number 0.
void read_alarm_words(ObjectClient& objects, const catalogue::Product& product, std::vector<ReportedFault>& faults) {
  for (const catalogue::AlarmWord& word : product.dialect.alarm_words) {
    const unsigned bits = objects.read_if_present<std::uint16_t>(word.object.index, word.object.sub).value_or(0);
    for (unsigned bit = 0; bit < 16; ++bit) {
      const auto alarm = static_cast<std::uint16_t>(word.first_alarm + bit);
      if ((bits >> bit & 1U) == 0 || alarm == 0) continue;
      const auto* const text = catalogue::find_alarm_text(product.name, alarm);
      faults.push_back(text != nullptr ? of_alarm(*text, word.object)
                                       : ReportedFault{.alarm = alarm, .source = word.object});
    }
  }
}

void read_history(ObjectClient& objects, const catalogue::Product& product, std::vector<ReportedFault>& history) {
  const unsigned count = objects.read_if_present<std::uint8_t>(0x1003).value_or(0);
  for (unsigned sub = 1; sub <= count; ++sub) {
    const auto number = static_cast<std::uint8_t>(sub);
    const auto code = static_cast<std::uint16_t>(objects.read<std::uint32_t>(0x1003, number));
    history.push_back(fault_of_code(code, {0x1003, number}, product.name));
  }
}

void read_log(ObjectClient& objects, const catalogue::Product& product, std::vector<ReportedFault>& log) {
  for (unsigned n = 0; n < product.dialect.alarm_log_length; ++n) {
    const ObjectAddress object{static_cast<std::uint16_t>(product.dialect.alarm_log + n), 0};
    const auto entry = objects.read_if_present<std::uint16_t>(object.index).value_or(0);
    if (entry == 0) continue;
    const auto* const text = catalogue::find_alarm_text(product.name, entry);
    log.push_back(text != nullptr ? of_alarm(*text, object) : fault_of_code(entry, object, product.name));
  }
}

}  // namespace

ReportedFault fault_of_code(std::uint16_t code, ObjectAddress source, std::string_view product) {
  ReportedFault fault{.code = code, .source = source};
  for (const catalogue::FaultText& text : catalogue::fault_texts(product, code)) fault.meanings.push_back(&text);
  if (fault.meanings.empty()) {
    if (const auto* const text = catalogue::fault_class_text(code)) fault.meanings.push_back(text);
  }
  return fault;
}

FaultReport read_faults(ObjectClient& objects, const catalogue::Product& product) {
  FaultReport report;
  report.statusword = objects.read<std::uint16_t>(0x6041);
  report.mode = objects.read_if_present<std::int8_t>(0x6061).value_or(0);
  report.error_register = objects.read_if_present<std::uint8_t>(0x1001);
  const PowerState state = state_of(report.statusword);
  const bool faulty = state == PowerState::fault || state == PowerState::fault_reaction_active;
  const bool warns = (report.statusword & status_bit::warning) != 0;
  std::vector<ReportedFault> present;
  read_alarm_words(objects, product, present);
  // 603Fh keeps the last error even after it is gone, so it is read only while the drive reports a fault or a warning.
  const std::uint16_t code =
      faulty || warns ? objects.read_if_present<std::uint16_t>(0x603F).value_or(0) : std::uint16_t{0};
  const bool known = std::any_of(present.begin(), present.end(), [&](const auto& fault) { return fault.code == code; });
  if (code != 0 && !known) present.insert(present.begin(), fault_of_code(code, {0x603F, 0}, product.name));
  if (present.empty() && (faulty || warns)) present.push_back({.source = {0x6041, 0}});
  if (faulty || !warns) {
    report.active = std::move(present);
  } else {
    report.warnings = std::move(present);
  }
  read_history(objects, product, report.history);
  read_log(objects, product, report.log);
  return report;
}

void clear_fault_history(ObjectClient& objects) { objects.write<std::uint8_t>(0x1003, 0, 0); }

std::string text_of(const ReportedFault& fault, std::string_view product) {
  std::string texts;
  for (const catalogue::FaultText* meaning : fault.meanings) {
    const std::string alarm = catalogue::alarm_name(product, meaning->alarm);
    const bool class_only = meaning->code != fault.code;
    texts += fmt::format("{}{}{}{}{}", texts.empty() ? "" : " or ", alarm, alarm.empty() ? "" : " ",
                         class_only ? "class: " : "", meaning->text);
  }
  if (texts.empty()) texts = catalogue::alarm_name(product, fault.alarm);
  if (texts.empty()) texts = fault.code == 0 ? "the drive gives no code" : "manufacturer-specific code";
  return fault.code == 0 ? texts : fmt::format("{:04X}h {}", fault.code, texts);
}

std::string text_of_error_register(std::uint8_t value) {
  std::string names;
  for (std::size_t bit = 0; bit < register_bits.size(); ++bit) {
    if ((unsigned{value} >> bit & 1U) == 0) continue;
    names += fmt::format("{}{}", names.empty() ? "" : ", ", register_bits[bit]);
  }
  return names;
}

}  // namespace servodrome::master
