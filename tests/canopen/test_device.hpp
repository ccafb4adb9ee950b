#pragma once

#include <cstdio>
#include <gtest/gtest.h>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

#include "canopen/301/communication_section.hpp"
#include "canopen/node.hpp"

// A device with objects of all kinds, and frames in the notation of the manuals.
namespace servodrome::canopen::test {

using namespace std::chrono_literals;
using dictionary::AbortCode;

template <std::size_t Pdos, std::size_t MappingEntries, std::size_t Consumers = 3>
struct TestObjects {
  CommunicationObjects<Pdos, Pdos, MappingEntries, Consumers> communication;
  std::uint16_t controlword = 0;
  std::uint16_t statusword = 0;
  std::int8_t modes_of_operation = 0;
  std::int8_t modes_of_operation_display = 0;
  std::int32_t position_actual = 0;
  std::int32_t velocity_actual = 0;
  std::int32_t target_position = 0;
  std::uint32_t profile_velocity = 0;
  std::int32_t target_velocity = 0;
  dictionary::Blob<40> name;
  dictionary::Blob<6000> big;
  std::uint64_t wide = 0;
  std::uint32_t secret = 0;
  std::int16_t ranged = 0;
  std::uint16_t owned = 0;
  std::array<bool, 8> bits{};
};

constexpr std::int64_t constant_value = 0x12345678;
constexpr const char* constant_text = "Servodrome test device";

template <typename Objects>
constexpr auto make_test_table() {
  constexpr auto build = [] {
    using namespace dictionary;
    using C = decltype(Objects::communication);
    TableBuilder<200 + 20 * (C::rpdo_count + C::tpdo_count) + C::mapping_entries*(C::rpdo_count + C::tpdo_count)> t;
    constexpr std::size_t base = offsetof(Objects, communication);
    t.append(dummy_section).append(general_section<C>, base).append(sdo_server_section<C>, base);
    t.append(rpdo_section<C>, base).append(tpdo_section<C>, base);
    const auto both = [&](std::uint16_t index, Field field) { t.add(var(index, "", field, Access::rw, Pdo::both)); };
    t.add(text_constant(0x1008, "Manufacturer device name", constant_text));
    t.add(var(0x2001, "", SERVODROME_FIELD(Objects, name), Access::rw));
    t.add(var(0x2002, "", SERVODROME_FIELD(Objects, big), Access::rw));
    both(0x2003, SERVODROME_FIELD(Objects, wide));
    t.add(var(0x2005, "", SERVODROME_FIELD(Objects, secret), Access::wo));
    t.add(var(0x2006, "", SERVODROME_FIELD(Objects, ranged), Access::rw, Pdo::both, {.minimum = -100, .maximum = 100}));
    t.add(var(0x2007, "", SERVODROME_FIELD(Objects, owned), Access::rw, Pdo::both, {.owner = Owner::drive}));
    t.add(number_constant(0x2008, 0, ObjectCode::var, "", Type::unsigned32, constant_value));
    t.at(0x2008).pdo = Pdo::tpdo;
    t.add(highest_sub(0x2010, ObjectCode::array, "", 8));
    for (std::uint8_t i = 0; i < 8; ++i) {
      t.add(element(0x2010, static_cast<std::uint8_t>(i + 1), ObjectCode::array, "",
                    field_at<bool>(offsetof(Objects, bits) + i), Access::rw, Pdo::both));
    }
    both(0x6040, SERVODROME_FIELD(Objects, controlword));
    t.add(var(0x6041, "", SERVODROME_FIELD(Objects, statusword), Access::ro, Pdo::tpdo));
    both(0x6060, SERVODROME_FIELD(Objects, modes_of_operation));
    t.add(var(0x6061, "", SERVODROME_FIELD(Objects, modes_of_operation_display), Access::ro, Pdo::tpdo));
    t.add(var(0x6064, "", SERVODROME_FIELD(Objects, position_actual), Access::ro, Pdo::tpdo));
    t.add(var(0x606C, "", SERVODROME_FIELD(Objects, velocity_actual), Access::ro, Pdo::tpdo));
    both(0x607A, SERVODROME_FIELD(Objects, target_position));
    both(0x6081, SERVODROME_FIELD(Objects, profile_velocity));
    both(0x60FF, SERVODROME_FIELD(Objects, target_velocity));
    return t;
  };
  return dictionary::make_table<build>();
}
template <typename Objects>
inline constexpr auto test_table = make_test_table<Objects>();

// "181 # 01 02", "701 RTR 1"
inline std::string text_of(const Frame& frame) {
  char text[64];
  int n = std::snprintf(text, sizeof text, "%03X", frame.id);
  std::string result(text, static_cast<std::size_t>(n));
  result += frame.remote ? " RTR" : " #";
  for (unsigned i = 0; !frame.remote && i < frame.length; ++i) {
    n = std::snprintf(text, sizeof text, " %02X", frame.data[i]);
    result.append(text, static_cast<std::size_t>(n));
  }
  return result;
}

inline Frame frame_of(const std::string& text) {
  std::istringstream in(text);
  Frame frame;
  std::string mark;
  in >> std::hex >> frame.id >> mark;
  frame.remote = mark == "RTR";
  unsigned byte = 0;
  while (in >> byte) frame.data[frame.length++] = static_cast<std::uint8_t>(byte);
  return frame;
}

using Frames = std::vector<std::string>;

struct RecordingEvents final : DeviceEvents {
  Frames log;
  LossReaction* override_reaction = nullptr;
  AbortCode store_answer = AbortCode::none;
  std::array<bool, 16> bit_timings{};
  LssStore lss_answer = LssStore::done;
  Node* node = nullptr;

  void note(const char* what, long a = -1, long b = -1, long c = -1) {
    std::string line = what;
    for (const long value : {a, b, c}) {
      if (value >= 0) line += " " + std::to_string(value);
    }
    log.push_back(line);
  }
  bool saw(const std::string& line) const {
    for (const std::string& one : log) {
      if (one == line) return true;
    }
    return false;
  }
  void nmt_state_changed(NmtState state) override { note("nmt", static_cast<long>(state)); }
  void reset(NmtCommand command, dictionary::Area area, std::uint8_t node_id) override {
    note("reset", static_cast<long>(command), static_cast<long>(area), node_id);
  }
  AbortCode store(dictionary::Area area) override {
    note("store", static_cast<long>(area));
    return store_answer;
  }
  AbortCode restore_defaults(dictionary::Area area) override {
    note("restore", static_cast<long>(area));
    return store_answer;
  }
  void sync(std::uint8_t counter, Time) override { note("sync", counter); }
  void rpdo_written(std::uint16_t number) override { note("rpdo", number); }
  LossReaction communication_lost(LossCause cause, LossReaction standard) override {
    note("lost", static_cast<long>(cause), standard.emergency_code, static_cast<long>(standard.behaviour));
    return override_reaction != nullptr ? *override_reaction : standard;
  }
  void communication_restored(LossCause cause) override { note("restored", static_cast<long>(cause)); }
  void heartbeat_state(std::uint8_t node_id, NmtState state) override {
    note("heartbeat", node_id, static_cast<long>(state));
  }
  void time_of_day(std::uint32_t milliseconds, std::uint16_t days) override { note("time", milliseconds, days); }
  void emergency_received(std::uint8_t entry, std::uint16_t code, std::uint8_t error_register,
                          const std::array<std::uint8_t, 5>& vendor) override {
    note("emergency", entry, code, error_register + 1000 * vendor[4]);
  }
  bool lss_bit_timing_supported(std::uint8_t index) override {
    return index < bit_timings.size() && bit_timings[index];
  }
  LssStore lss_store(std::uint8_t node_id, std::uint8_t index) override {
    note("lss store", node_id, index);
    return lss_answer;
  }
  void lss_activate_bit_timing(std::uint8_t index, Time delay, Time) override {
    note("lss activate", index, static_cast<long>(delay / 1ms));
  }
};

template <std::size_t Pdos = 4, std::size_t MappingEntries = 8, std::size_t SdoBuffer = 8192>
class TestDevice {
 public:
  using Objects = TestObjects<Pdos, MappingEntries>;
  static constexpr const auto& table = test_table<Objects>;
  static_assert(dictionary::is_valid_table(table));

  explicit TestDevice(const Profile& the_profile = {}, std::uint8_t node_id = 1,
                      dictionary::LengthAborts length_aborts = {})
      : profile(the_profile), dictionary(table, std::as_writable_bytes(std::span(&objects, 1)), length_aborts) {
    dictionary.load_defaults(dictionary::Area::all, node_id);
    objects.communication.vendor_id = 0x319;
    objects.communication.product_code = 0x10002;
    objects.communication.revision_number = 0x30004;
    objects.communication.serial_number = 0xCAFE1234;
    events.node = &node;
  }

  Frames sent() {
    Frames frames;
    Frame frame;
    while (node.take(frame)) frames.push_back(text_of(frame));
    return frames;
  }
  Frames start(std::uint8_t node_id = 1) {
    node.start(node_id, now);
    return sent();
  }
  Frames start_operational() {
    start();
    return send("000 # 01 00");
  }
  Frames send(const std::string& text) { return send(frame_of(text)); }
  Frames send(const Frame& frame) {
    node.receive(frame, now);
    return sent();
  }
  // Advances time like a bus: polls exactly at each deadline on the way.
  Frames advance(Time span) {
    const Time end = now + span;
    Frames frames;
    for (;;) {
      const Time next = node.next_deadline();
      if (next > end) break;
      now = std::max(now, next);
      node.poll(now);
      for (std::string& frame : sent()) frames.push_back(std::move(frame));
      EXPECT_GT(node.next_deadline(), now) << "a poll leaves nothing due";
      if (node.next_deadline() <= now) break;
    }
    now = end;
    node.poll(now);
    for (std::string& frame : sent()) frames.push_back(std::move(frame));
    return frames;
  }
  Frames image_updated() {
    node.process_image_updated(now);
    return sent();
  }
  // Writes by SDO, as a master does; returns the abort code.
  AbortCode write(std::uint16_t index, std::uint8_t sub, std::uint32_t value, unsigned size) {
    Frame frame;
    frame.id = 0x600U + node.node_id();
    frame.length = 8;
    frame.data = {static_cast<std::uint8_t>(0x23 | (4 - size) << 2),
                  static_cast<std::uint8_t>(index),
                  static_cast<std::uint8_t>(index >> 8),
                  sub,
                  static_cast<std::uint8_t>(value),
                  static_cast<std::uint8_t>(value >> 8),
                  static_cast<std::uint8_t>(value >> 16),
                  static_cast<std::uint8_t>(value >> 24)};
    node.receive(frame, now);
    AbortCode code = AbortCode::no_data;
    Frame answer;
    others.clear();
    while (node.take(answer)) {
      if (answer.id != 0x580U + node.node_id()) {
        others.push_back(text_of(answer));
      } else {
        std::uint32_t word = 0;
        std::memcpy(&word, &answer.data[4], 4);
        code = answer.data[0] == 0x80 ? static_cast<AbortCode>(word) : AbortCode::none;
      }
    }
    return code;
  }
  void map(std::uint16_t parameter, const std::vector<std::uint32_t>& objects_to_map, std::uint8_t type = 255) {
    const std::uint32_t cob_id = static_cast<std::uint32_t>(dictionary.number(parameter, 1)) & 0x7FFFFFFF;
    const auto mapping = static_cast<std::uint16_t>(parameter + 0x200);
    ASSERT_EQ(write(parameter, 1, cob_id | 0x80000000, 4), AbortCode::none);
    ASSERT_EQ(write(parameter, 2, type, 1), AbortCode::none);
    ASSERT_EQ(write(mapping, 0, 0, 1), AbortCode::none);
    std::uint8_t sub = 0;
    for (const std::uint32_t object : objects_to_map) ASSERT_EQ(write(mapping, ++sub, object, 4), AbortCode::none);
    ASSERT_EQ(write(mapping, 0, sub, 1), AbortCode::none);
    ASSERT_EQ(write(parameter, 1, cob_id, 4), AbortCode::none);
  }

  Profile profile;
  Objects objects;
  RecordingEvents events;
  NodeStorage<Pdos, Pdos, MappingEntries, 3, SdoBuffer> storage;
  dictionary::Dictionary dictionary;
  Time now{1s};
  Frames others;  // frames that write() received in addition to the SDO answer
  Node node{dictionary, profile, events, storage.memory()};
};

// Large; tests keep it on the heap.
template <std::size_t Pdos = 4, std::size_t MappingEntries = 8, std::size_t SdoBuffer = 8192>
std::unique_ptr<TestDevice<Pdos, MappingEntries, SdoBuffer>> make_device(const Profile& profile = {},
                                                                         std::uint8_t node_id = 1,
                                                                         dictionary::LengthAborts length_aborts = {}) {
  return std::make_unique<TestDevice<Pdos, MappingEntries, SdoBuffer>>(profile, node_id, length_aborts);
}

}  // namespace servodrome::canopen::test
