#pragma once

#include <cstdint>
#include <span>

#include "dictionary/abort_code.hpp"
#include "host/sniff/decoded.hpp"

namespace servodrome::host {

// Both sides of one SDO channel heard from outside, so that segments and blocks are known by their object and their
// values are put together (CiA 301 7.2.4.3; over CoE, ETG.1000.6 clause 5.6.2, the same with longer messages).
class SdoConversation {
 public:
  // A message from the command byte on: 8 bytes on CAN, more in a mailbox.
  struct Heard {
    std::string text{};
    std::optional<ObjectAddress> object{};
    std::vector<std::byte> value{};  // when `complete`
    bool complete = false;           // the value was read, or the server has taken it
    bool carries_value = false;      // this message shows the value for the first time
    bool write = false;
    std::optional<dictionary::AbortCode> abort{};
  };
  Heard hear(bool from_client, std::span<const std::uint8_t> message, const ObjectCatalogue& catalogue);
  // The last transfer is one of all sub-indices.
  bool complete_access() const { return all_; }

 private:
  enum class State : std::uint8_t { idle, segments, block_download, block_upload };

  Heard hear_client(std::span<const std::uint8_t> message, const ObjectCatalogue& catalogue);
  Heard hear_server(std::span<const std::uint8_t> message, const ObjectCatalogue& catalogue);
  Heard initiate(std::span<const std::uint8_t> message, const ObjectCatalogue& catalogue, const char* expedited_form,
                 const char* sized_form);
  Heard segment(std::span<const std::uint8_t> data, std::uint8_t unused, bool last, const ObjectCatalogue& catalogue);
  Heard block_segment(std::span<const std::uint8_t> message);
  Heard block_end(std::uint8_t unused, const ObjectCatalogue& catalogue);
  std::string title(const ObjectCatalogue& catalogue) const;
  std::string value(const ObjectCatalogue& catalogue) const;

  State state_ = State::idle;
  ObjectAddress object_{};
  bool known_ = false;  // object_ is that of the transfer under way
  bool write_ = false;
  bool all_ = false;  // complete access
  std::vector<std::byte> data_;
  std::uint32_t promised_ = 0;  // bytes, 0: not said
};

}  // namespace servodrome::host
