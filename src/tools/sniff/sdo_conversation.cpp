#include "tools/sniff/sdo_conversation.hpp"

#include <algorithm>
#include <fmt/format.h>

#include "canopen/301/sdo_wire.hpp"
#include "ethercat/bytes.hpp"

namespace servodrome::master {
namespace {

namespace sdo = canopen::sdo;

constexpr std::uint8_t complete_bit = 0x10;  // in initiate requests and responses, CoE only
constexpr std::size_t initiate_bytes = 8;
constexpr std::size_t most_data = 1 << 20;  // limit for the data stored of a transfer

ObjectAddress multiplexer(std::span<const std::uint8_t> message) {
  return {ethercat::load_u16(&message[1]), message[3]};
}

// The announced size of a block; 0: none was announced.
std::string size_text(std::uint32_t bytes) { return bytes != 0 ? fmt::format("{} bytes", bytes) : "size unknown"; }

void append(std::vector<std::byte>& data, std::span<const std::uint8_t> bytes) {
  if (data.size() + bytes.size() > most_data) return;
  const auto as_bytes = std::as_bytes(bytes);
  data.insert(data.end(), as_bytes.begin(), as_bytes.end());
}

}  // namespace

std::string SdoConversation::title(const ObjectCatalogue& catalogue) const {
  return all_ ? catalogue.title(object_) + " and all behind it" : catalogue.title(object_);
}

std::string SdoConversation::value(const ObjectCatalogue& catalogue) const {
  if (!all_) return value_text(object_, data_, catalogue);
  const auto* bytes = reinterpret_cast<const std::uint8_t*>(data_.data());
  return hex_text(std::span(bytes, data_.size()));
}

SdoConversation::Heard SdoConversation::hear(bool from_client, std::span<const std::uint8_t> message,
                                             const ObjectCatalogue& catalogue) {
  const bool in_block =
      (state_ == State::block_download && from_client) || (state_ == State::block_upload && !from_client);
  if (message.empty() || (message[0] == sdo::abort_transfer && message.size() < initiate_bytes))
    return {"of wrong length"};
  if (message[0] == sdo::abort_transfer) {
    object_ = multiplexer(message);
    const auto code = ethercat::load_u32(&message[4]);
    Heard heard{fmt::format("abort {}: {:04X} {:04X}h {}", catalogue.title(object_), code >> 16, code & 0xFFFF,
                            dictionary::text(static_cast<dictionary::AbortCode>(code)))};
    heard.object = object_;
    heard.abort = static_cast<dictionary::AbortCode>(code);
    state_ = State::idle;
    known_ = false;
    return heard;
  }
  if (in_block) return block_segment(message);
  return from_client ? hear_client(message, catalogue) : hear_server(message, catalogue);
}

// An initiate request or response: contains the object, and its value or size.
SdoConversation::Heard SdoConversation::initiate(std::span<const std::uint8_t> message,
                                                 const ObjectCatalogue& catalogue, const char* expedited_form,
                                                 const char* sized_form) {
  const std::uint8_t command = message[0];
  state_ = State::idle;
  object_ = multiplexer(message);
  known_ = true;
  all_ = (command & complete_bit) != 0;
  data_.clear();
  Heard heard;
  heard.object = object_;
  heard.write = write_;
  if ((command & sdo::expedited) != 0) {
    const bool sized = (command & sdo::size_indicated) != 0;
    append(data_, message.subspan(4, sized ? 4U - (command >> 2 & 3U) : 4U));
  } else {
    promised_ = ethercat::load_u32(&message[4]);
    append(data_, message.subspan(initiate_bytes, std::min<std::size_t>(message.size() - initiate_bytes, promised_)));
    if (data_.empty() || data_.size() < promised_) {
      state_ = State::segments;
      heard.text = fmt::format(fmt::runtime(sized_form), title(catalogue), promised_);
      return heard;
    }
  }
  heard.text = fmt::format(fmt::runtime(expedited_form), title(catalogue), value(catalogue));
  heard.carries_value = true;
  if (!write_) heard.complete = true, heard.value = data_;
  return heard;
}

SdoConversation::Heard SdoConversation::segment(std::span<const std::uint8_t> data, std::uint8_t unused, bool last,
                                                const ObjectCatalogue& catalogue) {
  const std::size_t used = data.size() - std::min<std::size_t>(unused, data.size());
  const std::size_t before = data_.size();
  append(data_, data.first(used));
  Heard heard;
  if (!known_) return {"segment"};
  heard.object = object_;
  heard.write = write_;
  if (!last) {
    heard.text = fmt::format("segment of {}, bytes {} to {}", title(catalogue), before, before + used);
    return heard;
  }
  state_ = State::idle;
  heard.text = fmt::format("last segment: {} {} {}", title(catalogue), write_ ? "=" : "is", value(catalogue));
  heard.carries_value = true;
  if (!write_) heard.complete = true, heard.value = data_;
  return heard;
}

SdoConversation::Heard SdoConversation::hear_client(std::span<const std::uint8_t> message,
                                                    const ObjectCatalogue& catalogue) {
  const std::uint8_t command = message[0];
  const bool names_object = message.size() >= initiate_bytes;
  Heard heard;
  switch (sdo::specifier(command)) {
    case sdo::client::initiate_upload:
      if (!names_object) break;
      object_ = multiplexer(message);
      known_ = true;
      write_ = false;
      all_ = (command & complete_bit) != 0;
      state_ = State::idle;
      heard.text = "read " + title(catalogue);
      heard.object = object_;
      return heard;
    case sdo::client::initiate_download:
      if (!names_object) break;
      write_ = true;
      return initiate(message, catalogue, "write {} = {}", "write {}, {} bytes in segments");
    case sdo::client::upload_segment:
      if (!known_) return {"next segment"};
      heard.text = "next segment of " + title(catalogue);
      heard.object = object_;
      return heard;
    case sdo::client::download_segment: {
      if (!known_ || message.size() < 2) return {"segment"};
      const auto unused = static_cast<std::uint8_t>(command >> 1 & 7U);
      const bool shortest = message.size() <= initiate_bytes;  // a longer segment is always full: ETG.1000.6 table 33
      return segment(message.subspan(1), shortest ? unused : std::uint8_t{0}, (command & sdo::last_segment) != 0,
                     catalogue);
    }
    case sdo::client::block_upload: {
      const std::uint8_t what = command & sdo::subcommand_mask;
      if (what == sdo::block_upload_subcommand::initiate && names_object) {
        object_ = multiplexer(message);
        known_ = true;
        write_ = all_ = false;
        heard.text = "block read " + title(catalogue);
        heard.object = object_;
        return heard;
      }
      if (!known_) return {"block transfer"};
      heard.object = object_;
      if (what == sdo::block_upload_subcommand::start) {
        state_ = State::block_upload;
        heard.text = "block read goes ahead";
      } else if (what == sdo::block_upload_subcommand::response && message.size() >= 2) {
        heard.text = fmt::format("block taken up to segment {}", message[1]);
        if (!acknowledge_block(message[1])) state_ = State::block_upload;
      } else {
        heard.text = "block read ends";
      }
      return heard;
    }
    case sdo::client::block_download: {
      if ((command & sdo::last_segment) == sdo::block_download_subcommand::initiate && names_object) {
        object_ = multiplexer(message);
        known_ = true;
        write_ = true;
        all_ = false;
        begin_block(command, message);
        heard.text = fmt::format("block write {}, {}", title(catalogue), size_text(promised_));
        heard.object = object_;
        return heard;
      }
      if (!known_) return {"block transfer"};
      return block_end(command >> 2 & 7U, catalogue);
    }
    default: return {fmt::format("command {:02X}h is not an SDO command", command)};
  }
  return {"of wrong length"};
}

SdoConversation::Heard SdoConversation::hear_server(std::span<const std::uint8_t> message,
                                                    const ObjectCatalogue& catalogue) {
  const std::uint8_t command = message[0];
  const bool names_object = message.size() >= initiate_bytes;
  Heard heard;
  switch (sdo::specifier(command)) {
    case 2:
      if (!names_object) break;
      write_ = false;
      return initiate(message, catalogue, "{} is {}", "{} has {} bytes");
    case 3: {
      if (!names_object) break;
      const ObjectAddress object = multiplexer(message);
      const bool same = known_ && write_ && object == object_;
      heard.object = object;
      heard.write = true;
      heard.text = "written " + (same ? title(catalogue) : catalogue.title(object));
      if (same && state_ == State::idle) heard.complete = true, heard.value = data_;
      return heard;
    }
    case 0: {
      if (message.size() < 2) break;
      const auto unused = static_cast<std::uint8_t>(command >> 1 & 7U);
      const bool shortest = message.size() <= initiate_bytes;
      return segment(message.subspan(1), shortest ? unused : std::uint8_t{0}, (command & sdo::last_segment) != 0,
                     catalogue);
    }
    case 1:
      heard.text = "segment taken";
      if (!known_) return heard;
      heard.object = object_;
      heard.write = true;
      if (write_ && state_ == State::idle) heard.complete = true, heard.value = data_;
      return heard;
    case 5: {
      if (!known_) return {"block transfer"};
      heard.object = object_;
      heard.write = true;
      if ((command & sdo::subcommand_mask) == 0) {
        state_ = State::block_download;
        heard.text = "block write goes ahead";
      } else if ((command & sdo::subcommand_mask) == 2 && message.size() >= 3) {
        heard.text = fmt::format("block taken up to segment {}", message[1]);
        if (!acknowledge_block(message[1])) state_ = State::block_download;
      } else {
        heard.text = "block written " + title(catalogue);
        heard.complete = true;
        heard.value = data_;
      }
      return heard;
    }
    case 6:
      if (!known_) return {"block transfer"};
      heard.object = object_;
      if ((command & sdo::last_segment) != 0) return block_end(command >> 2 & 7U, catalogue);
      if (!names_object) break;
      begin_block(command, message);
      heard.text = fmt::format("{} has {}, in blocks", title(catalogue), size_text(promised_));
      return heard;
    default: return {fmt::format("command {:02X}h is not an SDO command", command)};
  }
  return {"of wrong length"};
}

void SdoConversation::begin_block(std::uint8_t command, std::span<const std::uint8_t> message) {
  data_.clear();
  promised_ = (command & sdo::block_size_indicated) != 0 ? ethercat::load_u32(&message[4]) : 0;
  sub_block_begin_ = 0;
  last_segment_ = 0;
}

// The receiver has taken the segments of the sub-block up to `number`; the sender repeats the ones after it. Returns
// true if the block is complete.
bool SdoConversation::acknowledge_block(unsigned number) {
  constexpr std::size_t segment_bytes = 7;
  data_.resize(std::min(data_.size(), sub_block_begin_ + number * segment_bytes));
  sub_block_begin_ = data_.size();
  const bool complete = last_segment_ != 0 && number == last_segment_;
  last_segment_ = 0;
  return complete;
}

SdoConversation::Heard SdoConversation::block_segment(std::span<const std::uint8_t> message) {
  const bool last = (message[0] & sdo::last_block_segment) != 0;
  const unsigned number = message[0] & sdo::sequence_mask;
  append(data_, message.subspan(1));
  // The sub-block ends with its last segment, or when the other side acknowledges it.
  if (last) {
    state_ = State::idle;
    last_segment_ = number;
  }
  Heard heard{fmt::format("{}segment {} of a block", last ? "last " : "", number)};
  heard.object = object_;
  heard.write = write_;
  return heard;
}

SdoConversation::Heard SdoConversation::block_end(std::uint8_t unused, const ObjectCatalogue& catalogue) {
  state_ = State::idle;
  data_.resize(data_.size() - std::min<std::size_t>(unused, data_.size()));
  Heard heard{fmt::format("block ends: {} {} {}", title(catalogue), write_ ? "=" : "is", value(catalogue))};
  heard.object = object_;
  heard.write = write_;
  heard.carries_value = true;
  if (!write_) heard.complete = true, heard.value = data_;
  return heard;
}

}  // namespace servodrome::master
