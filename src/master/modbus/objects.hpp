#pragma once

#include "dictionary/entry.hpp"
#include "master/modbus/client.hpp"
#include "master/object_client.hpp"
#include "modbus/register_map.hpp"

namespace servodrome::master {

// The objects of a product's Modbus registers. The product's server uses the same tables.
struct RegisterList {
  std::span<const modbus::Register> registers;
  std::span<const dictionary::Entry> table;  // types and limits of the objects
  modbus::WordOrder word_order = modbus::WordOrder::high_word_first;
};

// Access to a drive's objects by Modbus registers. An object without a register counts as absent.
class ModbusObjects final : public ObjectClient {
 public:
  // `client` and the tables of the list must outlive this.
  ModbusObjects(ModbusClient& client, std::uint8_t unit, const RegisterList& list)
      : client_(client), unit_(unit), list_(list) {}

  std::vector<std::byte> upload(ObjectAddress object) override;
  // Groups objects in neighbouring registers.
  std::vector<std::vector<std::size_t>> read_together(std::span<const ObjectAddress> objects) const override;
  std::vector<std::vector<std::byte>> upload_together(std::span<const ObjectAddress> objects) override;
  void download(ObjectAddress object, std::span<const std::byte> data) override;
  Time now() const override { return client_.now(); }
  void wait(Time span) override { client_.wait(span); }
  std::uint16_t address() const override { return unit_; }
  std::string where() const override;

 private:
  struct Place {
    const modbus::Register* row;
    const dictionary::Entry* entry;
  };

  void set_wait_limit(std::optional<Time> longest) override { client_.limit_wait(longest); }
  Place find(ObjectAddress object) const;
  // Which 16 bits of a number are in register `word` of `words`; 0: the lowest.
  std::size_t significance(std::size_t word, std::size_t words) const;
  std::vector<std::byte> bytes_of(const Place& place, std::span<const std::uint16_t> registers) const;

  ModbusClient& client_;
  std::uint8_t unit_;
  RegisterList list_;
};

}  // namespace servodrome::master
