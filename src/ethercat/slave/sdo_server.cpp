#include "ethercat/slave/sdo_server.hpp"

#include "ethercat/slave/entry_description.hpp"

namespace servodrome::ethercat {

using dictionary::AbortCode;
using dictionary::Entry;

namespace {

// The first byte of requests and responses (ETG.1000.6 tables 29 to 39).
constexpr std::uint8_t specifier_mask = 0xE0;
constexpr std::uint8_t download_segment_request = 0x00;
constexpr std::uint8_t initiate_download_request = 0x20;
constexpr std::uint8_t initiate_upload_request = 0x40;
constexpr std::uint8_t upload_segment_request = 0x60;
constexpr std::uint8_t abort_transfer = 0x80;
constexpr std::uint8_t upload_segment_response = 0x00;
constexpr std::uint8_t download_segment_response = 0x20;
constexpr std::uint8_t initiate_upload_response = 0x40;
constexpr std::uint8_t initiate_download_response = 0x60;

constexpr std::uint8_t complete_bit = 0x10;
constexpr std::uint8_t toggle_bit = 0x10;
constexpr std::uint8_t expedited_bit = 0x02;
constexpr std::uint8_t size_bit = 0x01;
constexpr std::uint8_t last_bit = 0x01;

constexpr std::size_t least_request = 8;
constexpr std::size_t least_segment = 7;  // bytes of data, padded

}  // namespace

void SdoServer::abort(AbortCode code, Message& reply) {
  state_ = State::idle;
  begin_coe(reply, CoeService::sdo_request);  // the protocol sends an abort as a request, from either side
  reply.u8(abort_transfer);
  reply.u16(index_);
  reply.u8(sub_);
  reply.u32(static_cast<std::uint32_t>(code));
}

void SdoServer::receive(std::span<const std::uint8_t> request, Message& reply) {
  switch (request[0] & specifier_mask) {
    case initiate_download_request: initiate_download(request, reply); break;
    case initiate_upload_request: initiate_upload(request, reply); break;
    case download_segment_request: download_segment(request, reply); break;
    case upload_segment_request: upload_segment(request, reply); break;
    case abort_transfer: reset(); break;
    default:
      index_ = load_u16(&request[1]);
      sub_ = request[3];
      abort(AbortCode::command_specifier_unknown, reply);
  }
}

AbortCode SdoServer::find(std::span<const std::uint8_t> request) {
  state_ = State::idle;
  index_ = load_u16(&request[1]);
  sub_ = request[3];
  complete_ = (request[0] & complete_bit) != 0;
  AbortCode code{};
  entry_ = dictionary_.find(index_, complete_ ? 0 : sub_, code);
  if (entry_ == nullptr || !complete_) return code;
  if (!complete_access_ || entry_->code == dictionary::ObjectCode::var) return AbortCode::complete_access_not_supported;
  return sub_ > 1 ? AbortCode::unsupported_access : AbortCode::none;
}

std::span<const Entry> SdoServer::object() const {
  const std::span<const Entry> table = dictionary_.table();
  const auto first = static_cast<std::size_t>(entry_ - table.data());
  std::size_t end = first;
  while (end < table.size() && table[end].index == index_) ++end;
  return table.subspan(first, end - first);
}

// ---- Download ----

void SdoServer::initiate_download(std::span<const std::uint8_t> request, Message& reply) {
  if (const AbortCode code = find(request); code != AbortCode::none) return abort(code, reply);
  const std::uint8_t command = request[0];
  if ((command & expedited_bit) != 0) {
    // Without a size in the request, the object's size is used, up to 4 bytes.
    const unsigned own = std::min<unsigned>(complete_ ? 4 : dictionary::size_of(entry_->type), 4);
    const unsigned size = (command & size_bit) != 0 ? 4U - (command >> 2 & 3U) : own != 0 ? own : 4U;
    const AbortCode code = commit(std::as_bytes(request.subspan(4, size)));
    return code == AbortCode::none ? respond_to_download(reply) : abort(code, reply);
  }
  size_ = load_u32(&request[4]);
  const std::span<const std::uint8_t> data = request.subspan(least_request);
  if (data.size() >= size_) {
    const AbortCode code = commit(std::as_bytes(data.first(size_)));
    return code == AbortCode::none ? respond_to_download(reply) : abort(code, reply);
  }
  // More segments follow. Errors that the table shows are reported at once.
  if (!complete_) {
    const std::uint32_t own = dictionary::size_of(entry_->type);
    if (!entry_->writable()) return abort(AbortCode::read_only, reply);
    if (size_ > (own != 0 ? own : entry_->capacity)) return abort(dictionary_.length_aborts().too_long, reply);
  }
  if (size_ > buffer_.size()) return abort(AbortCode::out_of_memory, reply);
  if (!data.empty()) std::memcpy(buffer_.data(), data.data(), data.size());
  position_ = static_cast<std::uint32_t>(data.size());
  toggle_ = false;
  state_ = State::download;
  respond_to_download(reply);
}

void SdoServer::respond_to_download(Message& reply) {
  begin_coe(reply, CoeService::sdo_response);
  reply.u8(initiate_download_response | (complete_ ? complete_bit : 0U));
  reply.u16(index_);
  reply.u8(sub_);
  reply.u32(0);
}

void SdoServer::download_segment(std::span<const std::uint8_t> request, Message& reply) {
  if (state_ != State::download) return abort(AbortCode::command_specifier_unknown, reply);
  const std::uint8_t command = request[0];
  if (((command & toggle_bit) != 0) != toggle_) return abort(AbortCode::toggle_bit_not_alternated, reply);
  std::size_t count = request.size() - 1;
  if (count == least_segment) count -= command >> 1 & 7U;
  if (count > size_ - position_) return abort(dictionary_.length_aborts().too_long, reply);
  if (count != 0) std::memcpy(buffer_.data() + position_, &request[1], count);
  position_ += static_cast<std::uint32_t>(count);
  if ((command & last_bit) != 0) {
    if (position_ < size_) return abort(dictionary_.length_aborts().too_short, reply);
    state_ = State::idle;
    const AbortCode code = commit(buffer_.first(size_));
    if (code != AbortCode::none) return abort(code, reply);
  }
  begin_coe(reply, CoeService::sdo_response);
  reply.u8(download_segment_response | (toggle_ ? toggle_bit : 0U));
  std::fill_n(reply.add(7), 7, std::uint8_t{0});
  toggle_ = !toggle_;
}

AbortCode SdoServer::commit(std::span<const std::byte> value) {
  return complete_ ? commit_object(value) : dictionary_.write(*entry_, value);
}

// Mappings require that sub-index 0 is 0 while the other sub-indices change. Therefore a writable sub-index 0 is set to
// 0 first and to its new value at the end. If a later entry refuses its value, the earlier ones stay written.
AbortCode SdoServer::commit_object(std::span<const std::byte> value) {
  const std::span<const Entry> entries = object();
  const Entry& count_entry = entries[0];
  ObjectLayout layout;
  unsigned last = entries.back().sub;
  if (sub_ == 0) {
    if (value.size() < 2) return dictionary_.length_aborts().too_short;
    layout.place(count_entry, 1);
    last = static_cast<unsigned>(value[0]);
    if (last > entries.back().sub) return AbortCode::value_too_high;
  }
  ObjectLayout total = layout;
  for (const Entry& entry : entries.subspan(1)) {
    if (entry.sub <= last) total.place(entry, size_in_object(entry));
  }
  // If the transfer starts at sub-index 1, the data may end after any entry.
  if (value.size() > total.bytes()) return dictionary_.length_aborts().too_long;
  if (sub_ == 0 && value.size() < total.bytes()) return dictionary_.length_aborts().too_short;

  const auto set_count = [&](unsigned count) {
    const auto byte = static_cast<std::byte>(count);
    return dictionary_.write(count_entry, std::span(&byte, 1));
  };
  const bool counts = sub_ == 0 && count_entry.writable();
  if (counts) {
    if (const AbortCode code = set_count(0); code != AbortCode::none) return code;
  }
  for (const Entry& entry : entries.subspan(1)) {
    if (entry.sub > last) break;
    const std::uint32_t size = size_in_object(entry);
    const std::uint32_t bit = layout.place(entry, size);
    if (bit / 8 + size > value.size()) break;
    std::byte single = value[bit / 8] >> bit % 8 & std::byte{1};
    const bool boolean = entry.type == dictionary::Type::boolean;
    const AbortCode code =
        dictionary_.write(entry, boolean ? std::span<const std::byte>(&single, 1) : value.subspan(bit / 8, size));
    if (code != AbortCode::none) return code;
  }
  return counts ? set_count(last) : AbortCode::none;
}

// ---- Upload ----

AbortCode SdoServer::gather_object() {
  const std::span<const Entry> entries = object();
  const auto last = static_cast<unsigned>(dictionary_.number(entries[0]));
  ObjectLayout layout;
  std::fill(buffer_.begin(), buffer_.end(), std::byte{0});
  for (const Entry& entry : entries) {
    if (entry.sub < sub_ || (entry.sub != 0 && entry.sub > last)) continue;
    dictionary::ReadValue value;
    const AbortCode code = entry.readable() ? dictionary_.read(entry, value) : AbortCode::none;
    if (code != AbortCode::none) return code;
    const std::uint32_t size = size_in_object(entry);
    const std::uint32_t bit = layout.place(entry, size);
    if (layout.bytes() > buffer_.size()) return AbortCode::out_of_memory;
    if (value.bytes.empty()) continue;  // write-only entry: zeros
    if (entry.type == dictionary::Type::boolean) {
      if (value.bytes[0] != std::byte{0}) buffer_[bit / 8] |= std::byte{1} << bit % 8;
    } else {
      std::copy(value.bytes.begin(), value.bytes.end(), buffer_.begin() + bit / 8);
    }
  }
  upload_ = buffer_.first(layout.bytes());
  return AbortCode::none;
}

void SdoServer::initiate_upload(std::span<const std::uint8_t> request, Message& reply) {
  AbortCode code = find(request);
  if (code == AbortCode::none) {
    if (complete_) {
      code = gather_object();
    } else {
      code = dictionary_.read(*entry_, value_);
      upload_ = value_.bytes;
    }
  }
  if (code != AbortCode::none) return abort(code, reply);
  size_ = static_cast<std::uint32_t>(upload_.size());
  const unsigned complete = complete_ ? complete_bit : 0U;
  begin_coe(reply, CoeService::sdo_response);
  if (size_ >= 1 && size_ <= 4) {
    reply.u8(initiate_upload_response | complete | expedited_bit | size_bit | (4 - size_) << 2);
    reply.u16(index_);
    reply.u8(sub_);
    reply.bytes(upload_);
    std::fill_n(reply.add(4 - size_), 4 - size_, std::uint8_t{0});
    return;
  }
  reply.u8(initiate_upload_response | complete | size_bit);
  reply.u16(index_);
  reply.u8(sub_);
  reply.u32(size_);
  position_ = static_cast<std::uint32_t>(std::min<std::size_t>(reply.left(), size_));
  reply.bytes(upload_.first(position_));
  if (position_ == size_) return;
  toggle_ = false;
  state_ = State::upload;
}

void SdoServer::upload_segment(std::span<const std::uint8_t> request, Message& reply) {
  if (state_ != State::upload) return abort(AbortCode::command_specifier_unknown, reply);
  if (((request[0] & toggle_bit) != 0) != toggle_) return abort(AbortCode::toggle_bit_not_alternated, reply);
  begin_coe(reply, CoeService::sdo_response);
  const auto count = static_cast<std::uint32_t>(std::min<std::size_t>(reply.left() - 1, size_ - position_));
  const bool last = position_ + count == size_;
  const unsigned unused = count < least_segment ? static_cast<unsigned>(least_segment) - count : 0U;
  reply.u8(upload_segment_response | (toggle_ ? toggle_bit : 0U) | unused << 1 | (last ? last_bit : 0U));
  reply.bytes(upload_.subspan(position_, count));
  std::fill_n(reply.add(unused), unused, std::uint8_t{0});
  position_ += count;
  toggle_ = !toggle_;
  if (last) state_ = State::idle;
}

}  // namespace servodrome::ethercat
