#include "products/ismk/alarms.hpp"

#include "drive/drive.hpp"
#include "products/ismk/faults.hpp"

namespace servodrome::products::ismk {

namespace {

constexpr std::uint16_t extended_error = 1;  // 2601h bit 0

void set_place(AlarmWords& words, unsigned place) {
  const auto bit = static_cast<std::uint16_t>(1u << (place & 15u));
  (place < 16 ? words.state : place < 32 ? words.state_2 : words.extension) |= bit;
}

}  // namespace

AlarmWords words_of(const drive::FaultRow& row) {
  AlarmWords words;
  set_place(words, row.alarm & 0xFFU);
  if ((row.alarm & 0xFF00) != 0) set_place(words, row.alarm >> 8U);
  return words;
}

std::array<char, 6> display_code(std::uint16_t word) {
  constexpr const char* digits = "0123456789ABCDEF";
  return {digits[word >> 12], digits[word >> 8 & 15], digits[word >> 4 & 15], '.', digits[word & 15], '\0'};
}

drive::CauseSet AlarmLog::ignored(const Alarms& alarms) {
  drive::CauseSet causes;
  for (const drive::FaultRow& row : faults) {
    const AlarmWords words = words_of(row);
    if ((words.state & alarms.mask) == 0 && (words.state_2 & alarms.mask_2) == 0) causes.set(row.cause);
  }
  return causes;
}

void AlarmLog::raise(const drive::FaultRow& row, Alarms& alarms, const drive::Drive& drive) {
  const AlarmWords words = words_of(row);
  alarms.state |= words.state;
  alarms.state_2 |= words.state_2;
  alarms.extension |= words.extension;
  // Every bit of 2602h sets the summary (Table 10-1, bit 0), unless that is masked itself (Table 10-4, 2605.01).
  if (words.state_2 != 0) alarms.state |= static_cast<std::uint16_t>(alarms.mask & extended_error);

  const bool on = drive.energised();
  const bool kept = (words.state & (on ? alarms.store_on : alarms.store_off)) != 0 ||
                    (words.state_2 & (on ? alarms.store_on_2 : alarms.store_off_2)) != 0;
  if (!kept) return;
  const drive::Axis& axis = drive.axis();
  newest_ = (newest_ + 1) % capacity;
  size_ = std::min(size_ + 1, capacity);
  AlarmRecord& record = records_[newest_];
  record.fault = &row;
  record.dc_link_v = drive.dc_link_v();
  record.velocity_rpm = static_cast<float>(axis.velocity() * 60.0 / axis.units.counts_per_revolution);
  record.current_a = drive.loops().current_q_a;
  record.temperature_c = drive.winding_temperature_c();
  record.mode = axis.objects.modes_of_operation;
  record.power_stage_on = on;
  record.words = {alarms.state, alarms.state_2, alarms.extension};
}

std::array<std::uint8_t, 5> emergency_bytes(const Alarms& alarms) {
  const auto low = [](std::uint16_t word) { return static_cast<std::uint8_t>(word); };
  const auto high = [](std::uint16_t word) { return static_cast<std::uint8_t>(word >> 8); };
  return {0, low(alarms.state), high(alarms.state), low(alarms.state_2), high(alarms.state_2)};
}

}  // namespace servodrome::products::ismk
