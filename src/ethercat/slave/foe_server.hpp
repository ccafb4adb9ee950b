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

// The files of a device. One transfer at a time; `position` counts from 0 and goes up without gaps.
class FoeFiles {
 public:
  // Before a transfer.
  virtual FoeError open(std::string_view /*name*/, std::uint32_t /*password*/, bool /*writes*/) {
    return FoeError::not_found;
  }
  // The next bytes of the opened file; `count` fewer than `into` is the end of it.
  virtual FoeError read(std::uint32_t /*position*/, std::span<std::uint8_t> /*into*/, std::size_t& /*count*/) {
    return FoeError::not_defined;
  }
  // The next bytes for the opened file; `last` when it is complete.
  virtual FoeError write(std::uint32_t /*position*/, std::span<const std::uint8_t> /*data*/, bool /*last*/) {
    return FoeError::not_defined;
  }
  // Why the last call failed, for people; goes out with the error, as much of it as there is room for.
  virtual std::string_view reason() const { return {}; }

 protected:
  ~FoeFiles() = default;
};

// File access over EtherCAT (ETG.1000.6 clause 5.8), the server's side.
class FoeServer {
 public:
  void set_files(FoeFiles* files) { files_ = files; }
  bool offered() const { return files_ != nullptr; }
  void reset() { state_ = State::idle; }

  // A message, at least `least_request` bytes. `packet_size` is what a data message of the master can carry: one that
  // carries less is its last. The answer, if there is one, goes to `reply`.
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
  std::uint32_t packet_ = 0;    // last one sent or received
  std::uint32_t position_ = 0;  // in the file
  bool last_ = false;           // the packet sent was the last one
};

}  // namespace servodrome::ethercat
