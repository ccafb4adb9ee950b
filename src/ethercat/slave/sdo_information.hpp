#pragma once

#include "dictionary/dictionary.hpp"
#include "ethercat/slave/mailbox_wire.hpp"
#include "ethercat/slave/profile.hpp"

namespace servodrome::ethercat {

// The SDO information server of CoE (ETG.1000.6 clause 5.6.3): lists of objects, descriptions of objects and entries.
class SdoInformation {
 public:
  SdoInformation(const dictionary::Dictionary& dictionary, const Profile& profile)
      : dictionary_(dictionary), profile_(profile) {}

  // Drops the remaining fragments of a list.
  void reset() { fragments_left_ = 0; }

  // Handles a request: the data behind the CoE header, at least 4 bytes. If a list does not fit, `next` continues it.
  void receive(std::span<const std::uint8_t> request, Message& reply);
  bool has_next() const { return fragments_left_ != 0; }
  void next(Message& reply);

 private:
  void begin(Message& reply, unsigned opcode, unsigned fragments_left) const;
  void error(dictionary::AbortCode code, Message& reply) const;
  void list(std::span<const std::uint8_t> data, Message& reply);
  void put_indices(Message& reply);
  void describe_object(std::span<const std::uint8_t> data, Message& reply) const;
  bool is_gap(std::uint16_t index, std::uint8_t sub) const;
  void describe_gap(std::span<const std::uint8_t> data, Message& reply) const;
  void describe_entry(std::span<const std::uint8_t> data, Message& reply) const;
  bool belongs(std::size_t object, unsigned list) const;
  std::size_t object_end(std::size_t object) const;
  unsigned count(unsigned list) const;

  const dictionary::Dictionary& dictionary_;
  const Profile& profile_;
  unsigned list_ = 0;
  std::size_t position_ = 0;  // index in the table of the next object to examine
  unsigned fragments_left_ = 0;
};

}  // namespace servodrome::ethercat
