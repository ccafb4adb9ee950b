#pragma once

#include "dictionary/dictionary.hpp"
#include "ethercat/slave/mailbox_wire.hpp"

namespace servodrome::ethercat {

// The SDO server of CoE (ETG.1000.6 clause 5.6.2): expedited, normal, segmented, complete access.
class SdoServer {
 public:
  // Transfers that do not fit into the mailbox, and complete access, use `buffer`.
  SdoServer(dictionary::Dictionary& dictionary, bool complete_access, std::span<std::byte> buffer)
      : dictionary_(dictionary), complete_access_(complete_access), buffer_(buffer) {}

  void reset() { state_ = State::idle; }

  // Handles an SDO request: the 8 bytes behind the CoE header and what follows them. Puts the answer into `reply`,
  // which must have room for at least 10 bytes. An abort request gets no answer.
  void receive(std::span<const std::uint8_t> request, Message& reply);

 private:
  enum class State : std::uint8_t { idle, download, upload };

  void initiate_download(std::span<const std::uint8_t> request, Message& reply);
  void download_segment(std::span<const std::uint8_t> request, Message& reply);
  void initiate_upload(std::span<const std::uint8_t> request, Message& reply);
  void upload_segment(std::span<const std::uint8_t> request, Message& reply);
  void respond_to_download(Message& reply);
  void abort(dictionary::AbortCode code, Message& reply);

  dictionary::AbortCode find(std::span<const std::uint8_t> request);
  // The entries of the object that complete access addresses, from `sub_` on.
  std::span<const dictionary::Entry> object() const;
  dictionary::AbortCode commit(std::span<const std::byte> value);
  dictionary::AbortCode commit_object(std::span<const std::byte> value);
  dictionary::AbortCode gather_object();

  dictionary::Dictionary& dictionary_;
  bool complete_access_;
  std::span<std::byte> buffer_;

  State state_ = State::idle;
  std::uint16_t index_ = 0;
  std::uint8_t sub_ = 0;
  bool complete_ = false;
  bool toggle_ = false;
  std::uint32_t size_ = 0;      // bytes of the whole transfer
  std::uint32_t position_ = 0;  // bytes received or sent
  const dictionary::Entry* entry_ = nullptr;
  dictionary::ReadValue value_;
  std::span<const std::byte> upload_;
};

}  // namespace servodrome::ethercat
