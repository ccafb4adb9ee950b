#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "canopen/frame.hpp"
#include "dictionary/abort_code.hpp"
#include "host/object_address.hpp"

namespace servodrome::host {

using dictionary::AbortCode;

// Which SDO protocol carries the data (CiA 301 7.2.4.2). `ordinary` is expedited for up to 4 bytes, else in segments.
enum class SdoProtocol : std::uint8_t { ordinary, block };

// One SDO transfer from the client's side, sans-IO: the server's frames go in, the client's come out, time is the
// caller's business. Many run side by side on one bus.
//
// Use: take() until it returns false, receive() each answer, and so on until finished(). When the server keeps silent
// for too long, abort(), or ask_again() first where that helps.
class SdoTransfer {
 public:
  static SdoTransfer upload(ObjectAddress object, SdoProtocol protocol = SdoProtocol::ordinary);
  static SdoTransfer download(ObjectAddress object, std::span<const std::byte> data,
                              SdoProtocol protocol = SdoProtocol::ordinary);

  // The next frame to send; identifier 0: the caller fills in the COB-ID.
  bool take(canopen::Frame& frame);
  // An answer of the server. What belongs to another transfer (a late answer) is ignored; false then.
  bool receive(const canopen::Frame& answer);
  // A silent server may have lost an acknowledgement, or its segments got lost: ask_again() acknowledges what came of
  // the sub-block, which makes it go on from there.
  bool can_ask_again() const { return phase_ == Phase::block_upload_segments; }
  void ask_again() { acknowledge_sub_block(); }
  // Gives up, telling the server.
  void abort(AbortCode code);

  bool finished() const { return phase_ == Phase::done; }
  // `none` after success; else the abort code, of either side.
  AbortCode result() const { return result_; }
  bool aborted_by_server() const { return aborted_by_server_; }
  ObjectAddress object() const { return object_; }
  bool is_upload() const { return is_upload_; }
  // What was uploaded, or is to be downloaded.
  const std::vector<std::byte>& data() const { return data_; }

  // More than this is not taken from a server (out_of_memory).
  static constexpr std::size_t largest_upload = 16U << 20;

 private:
  enum class Phase : std::uint8_t {
    initiate,
    upload_segments,
    download_segments,
    block_upload_initiate,
    block_upload_segments,
    block_download_initiate,
    block_download_segments,      // sending a sub-block
    block_download_acknowledged,  // sent, the server is to confirm
    block_download_end,
    done,
  };

  SdoTransfer(ObjectAddress object, bool is_upload) : object_(object), is_upload_(is_upload) {}

  canopen::Frame& request(std::uint8_t command);
  canopen::Frame& initiate(std::uint8_t command);
  void finish();
  bool is_for_this(const canopen::Frame& answer) const;
  bool append(std::span<const std::uint8_t> bytes);
  std::size_t segment_size() const;
  void request_upload_segment();
  void send_download_segment();

  bool receive_initiated_upload(const canopen::Frame& answer);
  bool receive_upload_segment(const canopen::Frame& answer);
  bool receive_initiated_download(const canopen::Frame& answer);
  bool receive_download_confirmation(const canopen::Frame& answer);
  bool unexpected();

  // sdo_transfer_block.cpp
  bool receive_block_upload_initiated(const canopen::Frame& answer);
  bool receive_block_segment(const canopen::Frame& answer);
  bool receive_block_upload_end(const canopen::Frame& answer);
  void acknowledge_sub_block();
  bool receive_block_download_initiated(const canopen::Frame& answer);
  bool receive_sub_block_confirmation(const canopen::Frame& answer);
  void produce_block_segment(canopen::Frame& frame);
  void end_block_download();

  ObjectAddress object_;
  bool is_upload_;
  Phase phase_ = Phase::initiate;
  AbortCode result_ = AbortCode::none;
  bool aborted_by_server_ = false;
  std::vector<std::byte> data_;
  std::optional<canopen::Frame> to_send_;
  std::optional<std::uint32_t> announced_;  // size, by the server
  std::size_t position_ = 0;                // download: bytes the server has (block: has confirmed)
  std::size_t in_flight_ = 0;               // download: bytes of the segment on its way
  bool toggle_ = false;
  bool crc_used_ = false;
  std::uint8_t block_size_ = 0;
  std::uint8_t sequence_ = 0;  // last segment of the sub-block sent or taken
  bool last_taken_ = false;    // block upload: all segments are here
};

}  // namespace servodrome::host
