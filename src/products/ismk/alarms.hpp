#pragma once

#include <array>

#include "drive/cause_set.hpp"
#include "drive/faults.hpp"
#include "products/device.hpp"
#include "products/ismk/objects.hpp"

namespace servodrome::drive {
class Drive;
}

namespace servodrome::products::ismk {

// 2601h, 2602h, 2605h sub 7.
struct AlarmWords {
  std::uint16_t state = 0;
  std::uint16_t state_2 = 0;
  std::uint16_t extension = 0;
};

// The bits of a row of the fault table, without the summary bit 0 of 2601h.
AlarmWords words_of(const drive::FaultRow& row);

// The display's text for 2601h or 2602h: four digits with a point before the last, "080.0" (Tables 10-5 and 10-6).
std::array<char, 6> display_code(std::uint16_t word);
inline constexpr std::array<char, 6> motor_wrong_code{'F', 'F', 'F', '.', 'F', '\0'};  // Table 10-5, FFF.F

// An entry of the error history (ch. 10.1): the state of the drive and all alarm words at the time of the alarm.
struct AlarmRecord : PastFault {
  AlarmWords words{};
};

// The alarm words, the masks and the error history. The manual prints no objects for the history, so this class is the
// only access to it.
class AlarmLog {
 public:
  static constexpr std::size_t capacity = 8;

  // The causes that 2605h sub 1 and 4 mask. A detail of 2605h sub 7 is masked with the bit that it details.
  static drive::CauseSet ignored(const Alarms& alarms);

  // Sets the bits of a new alarm in `alarms`, and adds it to the history if 2605h says so.
  void raise(const drive::FaultRow& row, Alarms& alarms, const drive::Drive& drive);
  static void reset(Alarms& alarms) { alarms.state = alarms.state_2 = alarms.extension = 0; }

  std::size_t size() const { return size_; }
  const AlarmRecord& operator[](std::size_t n) const {
    return records_[(newest_ + capacity - n) % capacity];
  }  // 0: newest

 private:
  std::array<AlarmRecord, capacity> records_{};
  std::size_t newest_ = 0;
  std::size_t size_ = 0;
};

// Bytes 3 to 7 of an emergency message: 2601h and 2602h in the last four (Table 9-23); byte 3 is not defined.
std::array<std::uint8_t, 5> emergency_bytes(const Alarms& alarms);

}  // namespace servodrome::products::ismk
