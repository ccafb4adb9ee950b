#pragma once

#include "canopen/301/communication_section.hpp"
#include "canopen/node.hpp"

// A CANopen device with as many objects as a drive, for counting instructions.
namespace servodrome::bench {

struct Objects {
  canopen::CommunicationObjects<4, 4, 8, 1> communication;
  std::uint16_t controlword = 0;
  std::uint16_t statusword = 0;
  std::int32_t position_actual = 0;
  std::int32_t target_position = 0;
  std::array<std::uint32_t, 100> parameters{};  // a drive has a few hundred objects, and a look-up searches them
};

inline constexpr auto table = dictionary::make_table<[] {
  using namespace dictionary;
  using C = canopen::CommunicationObjects<4, 4, 8, 1>;
  TableBuilder<400> t;
  constexpr std::size_t base = offsetof(Objects, communication);
  t.append(canopen::general_section<C>, base).append(canopen::sdo_server_section<C>, base);
  t.append(canopen::rpdo_section<C>, base).append(canopen::tpdo_section<C>, base);
  for (std::size_t i = 0; i < 100; ++i) {
    t.add(var(static_cast<std::uint16_t>(0x2000 + i), "",
              field_at<std::uint32_t>(offsetof(Objects, parameters) + i * sizeof(std::uint32_t)), Access::rw));
  }
  t.add(var(0x6040, "", SERVODROME_FIELD(Objects, controlword), Access::rw, Pdo::both));
  t.add(var(0x6041, "", SERVODROME_FIELD(Objects, statusword), Access::ro, Pdo::tpdo));
  t.add(var(0x6064, "", SERVODROME_FIELD(Objects, position_actual), Access::ro, Pdo::tpdo));
  t.add(var(0x607A, "", SERVODROME_FIELD(Objects, target_position), Access::rw, Pdo::both));
  auto map = [&t](std::uint16_t parameter, std::int64_t first, std::int64_t second) {
    const auto mapping = static_cast<std::uint16_t>(parameter + 0x200);
    t.set_default(parameter, 2, 1).set_default(mapping, 0, 2).set_default(mapping, 1, first);
    t.set_default(mapping, 2, second);
  };
  map(0x1400, 0x60400010, 0x607A0020);
  map(0x1800, 0x60410010, 0x60640020);
  return t;
}>();

struct Events final : canopen::DeviceEvents {};

struct Device {
  Objects objects;
  canopen::Profile profile;
  Events events;
  dictionary::Dictionary dictionary{table, std::as_writable_bytes(std::span(&objects, 1))};
  canopen::NodeStorage<4, 4> storage;
  canopen::Node node{dictionary, profile, events, storage.memory()};

  Device() {
    dictionary.load_defaults(dictionary::Area::all, 1);
    objects.statusword = 0x1237;
    node.start(1, canopen::Time{0});
    canopen::Frame frame{.id = 0, .length = 2, .data = {1, 1}};
    node.receive(frame, canopen::Time{0});
    while (node.take(frame)) {
    }
  }
};

}  // namespace servodrome::bench
