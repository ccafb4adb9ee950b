#pragma once

#include <cstdint>
#include <span>

#include "dictionary/abort_code.hpp"
#include "tools/sniff/decoded.hpp"

namespace servodrome::master {

// Passive observer of both sides of one SDO channel: assigns segments and blocks to their object and reassembles the
// values (CiA 301 7.2.4.3; over CoE, ETG.1000.6 clause 5.6.2, the same with longer messages).
class SdoConversation {
 public:
  // Result for one message, which is passed from its command byte on: 8 bytes on CAN, more in a mailbox.
  struct Heard {
    std::string text{};
    std::optional<ObjectAddress> object{};
    std::vector<std::byte> value{};  // valid if `complete`
    bool complete = false;           // the value has been read, or the server has accepted it
    bool carries_value = false;      // the value appears for the first time in this message
    bool write = false;
    std::optional<dictionary::AbortCode> abort{};
  };
  Heard hear(bool from_client, std::span<const std::uint8_t> message, const ObjectCatalogue& catalogue);
  // True if the last transfer uses complete access (all sub-indices).
  bool complete_access() const { return all_; }

 private:
  enum class State : std::uint8_t { idle, segments, block_download, block_upload };

  Heard hear_client(std::span<const std::uint8_t> message, const ObjectCatalogue& catalogue);
  Heard hear_server(std::span<const std::uint8_t> message, const ObjectCatalogue& catalogue);
  Heard initiate(std::span<const std::uint8_t> message, const ObjectCatalogue& catalogue, const char* expedited_form,
                 const char* sized_form);
  Heard segment(std::span<const std::uint8_t> data, std::uint8_t unused, bool last, const ObjectCatalogue& catalogue);
  void begin_block(std::uint8_t command, std::span<const std::uint8_t> message);
  Heard block_segment(std::span<const std::uint8_t> message);
  bool acknowledge_block(unsigned number);
  Heard block_end(std::uint8_t unused, const ObjectCatalogue& catalogue);
  std::string title(const ObjectCatalogue& catalogue) const;
  std::string value(const ObjectCatalogue& catalogue) const;

  State state_ = State::idle;
  ObjectAddress object_{};
  bool known_ = false;  // object_ belongs to the present transfer
  bool write_ = false;
  bool all_ = false;  // complete access
  std::vector<std::byte> data_;
  std::uint32_t promised_ = 0;       // announced size in bytes; 0: unknown
  std::size_t sub_block_begin_ = 0;  // bytes before the present sub-block
  unsigned last_segment_ = 0;        // number of the block's last segment in its sub-block; 0: not seen yet
};

}  // namespace servodrome::master
