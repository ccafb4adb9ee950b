#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "canopen/frame.hpp"
#include "dictionary/abort_code.hpp"
#include "master/object_address.hpp"

namespace servodrome::master {

using dictionary::AbortCode;

// The SDO protocol that carries the data (CiA 301 7.2.4.2). `ordinary`: expedited for up to 4 bytes, segmented above.
enum class SdoProtocol : std::uint8_t { ordinary, block };

// Client side of one SDO transfer as a pure state machine without input, output or clock: the caller feeds in the
// server's frames, sends the client's frames and measures the time. Many transfers can run in parallel on one bus.
//
// Usage: call take() until it returns false, pass each answer to receive(), and repeat until finished(). If the server
// does not answer in time, call abort(), or first ask_again() if can_ask_again() is true.
class SdoTransfer {
 public:
  static SdoTransfer upload(ObjectAddress object, SdoProtocol protocol = SdoProtocol::ordinary);
  static SdoTransfer download(ObjectAddress object, std::span<const std::byte> data,
                              SdoProtocol protocol = SdoProtocol::ordinary);

  // Returns the next frame to send, or false if there is none. Its identifier is 0: the caller sets the COB-ID.
  bool take(canopen::Frame& frame);
  // Processes an answer of the server. Returns false for a frame that does not belong to this transfer (a late answer).
  bool receive(const canopen::Frame& answer);
  // In a block upload, segments or an acknowledgement may be lost. ask_again() acknowledges the segments that have
  // arrived, and the server continues after them.
  bool can_ask_again() const { return phase_ == Phase::block_upload_segments; }
  void ask_again() { acknowledge_sub_block(); }
  // Ends the transfer and sends the abort code to the server.
  void abort(AbortCode code);

  bool finished() const { return phase_ == Phase::done; }
  // `none` after success; otherwise the abort code, of either side.
  AbortCode result() const { return result_; }
  bool aborted_by_server() const { return aborted_by_server_; }
  ObjectAddress object() const { return object_; }
  bool is_upload() const { return is_upload_; }
  // False if the server sent four bytes without the number of valid ones.
  bool size_is_known() const { return size_is_known_; }
  // The uploaded data, or the data to download.
  const std::vector<std::byte>& data() const { return data_; }

  // Limit for the size of an upload; above it the transfer is aborted with out_of_memory.
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
    block_download_acknowledged,  // all segments sent, waiting for the confirmation
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

  // Block transfers, in sdo_transfer_block.cpp.
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
  std::optional<std::uint32_t> announced_;  // size announced by the server
  std::size_t position_ = 0;                // download: bytes acknowledged (block: confirmed)
  std::size_t in_flight_ = 0;               // download: bytes of the segment not yet acknowledged
  bool size_is_known_ = true;
  bool toggle_ = false;
  bool crc_used_ = false;
  std::uint8_t block_size_ = 0;
  std::uint8_t sequence_ = 0;  // last segment of the sub-block sent or accepted
  bool last_taken_ = false;    // block upload: all segments have arrived
};

}  // namespace servodrome::master
