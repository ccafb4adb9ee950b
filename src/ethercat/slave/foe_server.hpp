#pragma once

#include <string_view>

#include "ethercat/slave/mailbox_wire.hpp"

namespace servodrome::ethercat {

// ETG.1000.6 table 93.
enum class FoeError : std::uint32_t {
  none = 0,
  not_defined = 0x8000,
  not_found = 0x8001,
  access_denied = 0x8002,
  disk_full = 0x8003,
  illegal = 0x8004,
  packet_number_wrong = 0x8005,
  already_exists = 0x8006,
  no_user = 0x8007,
  bootstrap_only = 0x8008,
  not_in_bootstrap = 0x8009,
  no_rights = 0x800A,
  program_error = 0x800B,
};

// The files of a device. Only one transfer at a time; `position` starts at 0 and increases without gaps.
class FoeFiles {
 public:
  // Called before a transfer.
  virtual FoeError open(std::string_view /*name*/, std::uint32_t /*password*/, bool /*writes*/) {
    return FoeError::not_found;
  }
  // Reads the next bytes of the opened file; a `count` smaller than `into` marks its end.
  virtual FoeError read(std::uint32_t /*position*/, std::span<std::uint8_t> /*into*/, std::size_t& /*count*/) {
    return FoeError::not_defined;
  }
  // Writes the next bytes of the opened file; `last` marks the final ones.
  virtual FoeError write(std::uint32_t /*position*/, std::span<const std::uint8_t> /*data*/, bool /*last*/) {
    return FoeError::not_defined;
  }
  // A text for the user that explains why the last call failed. It is sent with the error, cut to the available room.
  virtual std::string_view reason() const { return {}; }

 protected:
  ~FoeFiles() = default;
};

// Server side of file access over EtherCAT (ETG.1000.6 clause 5.8).
class FoeServer {
 public:
  void set_files(FoeFiles* files) { files_ = files; }
  bool offered() const { return files_ != nullptr; }
  void reset() { state_ = State::idle; }

  // Handles a message of at least `least_request` bytes. `packet_size` is the number of bytes that a data message of
  // the master can carry: a message with fewer is the last. If there is an answer, it is put into `reply`.
  static constexpr std::size_t least_request = 6;
  void receive(std::span<const std::uint8_t> request, std::size_t packet_size, Message& reply);

 private:
  enum class State : std::uint8_t { idle, reading, writing };

  void open(std::span<const std::uint8_t> request, bool writes, Message& reply);
  void send_packet(Message& reply);
  void take_packet(std::span<const std::uint8_t> request, std::size_t packet_size, Message& reply);
  void acknowledge(Message& reply) const;
  void fail(FoeError error, Message& reply, std::string_view reason = {});

  FoeFiles* files_ = nullptr;
  State state_ = State::idle;
  std::uint32_t packet_ = 0;    // number of the last packet sent or received
  std::uint32_t position_ = 0;  // in the file
  bool last_ = false;           // the packet that was sent is the last one
};

}  // namespace servodrome::ethercat
