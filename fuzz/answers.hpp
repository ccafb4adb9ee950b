#pragma once

#include "frame_count.hpp"
#include "links/virtual_clock.hpp"
#include "parsers.hpp"

namespace servodrome::fuzz {

inline FrameCount frames("executed_frames");  // answers of the device

// Virtual time: it advances only when a master waits, or with each answer.
class MasterClock final : public links::VirtualClock {
 public:
  links::Time now() const override { return now_; }
  void step(links::Time latest) override { now_ = std::max(now_, latest); }
  void advance(links::Time span) { now_ += std::max(span, links::Time{0}); }

 private:
  links::Time now_{std::chrono::seconds(1)};
};

// Answers of an EtherCAT segment to our master (answers_ethercat.cpp).
void scan_segment(Bytes input);
void read_memory_of_slave(Bytes input);
void access_objects_of_slave(Bytes input);
void describe_objects_of_slave(Bytes input);
void transfer_file_of_slave(Bytes input);

// Answers on a serial line or over TCP (answers_serial.cpp).
void ask_modbus_rtu(Bytes input);
void ask_modbus_tcp(Bytes input);
void ask_serial10(Bytes input);

}  // namespace servodrome::fuzz
