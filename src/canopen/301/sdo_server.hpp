#pragma once

#include "canopen/link.hpp"
#include "canopen/profile.hpp"
#include "dictionary/dictionary.hpp"

namespace servodrome::canopen {

// One SDO server (CiA 301 7.2.4): expedited, segmented and block transfers in both directions.
//
// If a client begins a new transfer before the last one has ended, the old transfer is dropped.
class SdoServer {
 public:
  // Downloads of more than four bytes are collected in `buffer` and written when complete.
  SdoServer(Link& link, dictionary::Dictionary& dictionary, const Profile& profile, std::span<std::byte> buffer)
      : link_(link), dictionary_(dictionary), profile_(profile), buffer_(buffer) {}

  void configure(std::uint32_t request_can_id, std::uint32_t response_can_id);
  std::uint32_t request_can_id() const { return request_can_id_; }

  // Drops a transfer without an abort message, for NMT states without SDO.
  void reset() {
    state_ = State::idle;
    deadline_ = never;
  }

  void receive(const Frame& request);
  // Makes the next segment of a block upload, when the bus is free for it. Returns false if there is none.
  bool produce(Frame& frame) { return state_ == State::block_upload_sending && produce_segment(frame); }
  bool producing() const { return state_ == State::block_upload_sending; }
  void poll();

 private:
  enum class State : std::uint8_t {
    idle,
    download_segments,
    upload_segments,
    block_download_segments,
    block_download_end,
    block_upload_start,     // initiated, waits for "start upload"
    block_upload_sending,   // sends the segments of a sub-block
    block_upload_response,  // sub-block sent, waits for its acknowledgement
    block_upload_end,       // end sent, waits for its confirmation
  };

  void initiate_download(const Frame& request);
  void download_segment(const Frame& request);
  void initiate_upload(const Frame& request);
  void upload_segment(const Frame& request);
  void block_download(const Frame& request);
  void block_download_segment(const Frame& request);
  void acknowledge_sub_block();
  void end_block_download(const Frame& request);
  void block_upload(const Frame& request);
  void acknowledged(std::uint8_t segments, std::uint8_t next_block_size);
  bool produce_segment(Frame& frame);

  dictionary::AbortCode find(const Frame& request);
  dictionary::AbortCode check_announced_size(std::uint32_t size) const;
  dictionary::AbortCode check_received_size(std::uint32_t size) const;
  dictionary::AbortCode commit(std::span<const std::byte> value);
  void respond_to_upload();
  void respond(Frame& frame);
  void abort(dictionary::AbortCode code);
  void expect_more();
  Frame response(std::uint8_t command) const;
  Frame response_with_multiplexer(std::uint8_t command) const;

  Link& link_;
  dictionary::Dictionary& dictionary_;
  const Profile& profile_;
  std::span<std::byte> buffer_;
  std::uint32_t request_can_id_ = 0;
  std::uint32_t response_can_id_ = 0;

  State state_ = State::idle;
  std::uint16_t index_ = 0;
  std::uint8_t sub_ = 0;
  bool toggle_ = false;
  bool size_announced_ = false;
  bool crc_wanted_ = false;
  bool last_segment_seen_ = false;
  std::uint8_t block_size_ = 0;
  std::uint8_t sequence_ = 0;  // of the last valid segment received, or of the last one sent
  std::uint32_t announced_ = 0;
  std::uint32_t received_ = 0;  // bytes, including padding of the last segment
  std::uint32_t position_ = 0;  // upload: first byte not sent yet
  std::uint32_t block_start_ = 0;
  const dictionary::Entry* entry_ = nullptr;
  dictionary::ReadValue value_;
  std::array<std::byte*, 2> verified_{};  // date and time of 1020h
  Time deadline_ = never;
  Time repeat_at_ = never;
};

}  // namespace servodrome::canopen
