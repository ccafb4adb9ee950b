#pragma once

#include <functional>

#include "master/canopen/bus.hpp"
#include "master/canopen/sdo_transfer.hpp"
#include "master/canopen/second_answer.hpp"
#include "master/late_answer.hpp"
#include "master/object_client.hpp"
#include "master/wait_limit.hpp"

namespace servodrome::master {

// An SDO transfer failed: the node refused it (from_node), or the client gave up (protocol_timed_out and others).
class SdoError : public ObjectError {
 public:
  SdoError(const std::string& bus, std::uint8_t node_id, ObjectAddress object, bool upload, AbortCode code,
           bool from_node);

  std::uint8_t node_id() const { return node_id_; }
  std::uint16_t index() const { return object_.index; }
  std::uint8_t sub() const { return object_.sub; }
  AbortCode code() const { return code_; }
  bool from_node() const { return from_node_; }

 private:
  std::uint8_t node_id_;
  ObjectAddress object_;
  AbortCode code_;
  bool from_node_;
};

struct SdoOptions {
  Time timeout = std::chrono::seconds(1);  // for each answer
  // Number of retries of an upload without answer. Before a retry, and before the next upload, the client reads a
  // constant object, so that a late answer is not taken for the new one (LateAnswer). If this read gets no answer, it
  // counts as the retry or as the upload. A download is never repeated, because it may have taken effect. In a block
  // transfer this is also the number of retries of a sub-block's acknowledgement.
  unsigned retries = 1;
};

// SDO client of one node, over the default channel (600h and 580h + node-ID). One transfer at a time; frames to other
// listeners are delivered meanwhile. All calls throw SdoError, or MasterError if the link is lost. An upload also
// throws ObjectError if two devices answer (SecondAnswer); a download does not, since it may be the command that stops
// an axis.
class SdoClient final : public ObjectClient {
 public:
  SdoClient(Bus& bus, std::uint8_t node_id, const SdoOptions& options = {});
  SdoClient(const SdoClient&) = delete;
  SdoClient& operator=(const SdoClient&) = delete;

  std::vector<std::byte> upload(ObjectAddress object) override { return upload(object, SdoProtocol::ordinary); }
  void download(ObjectAddress object, std::span<const std::byte> data) override {
    download(object, data, SdoProtocol::ordinary);
  }
  std::vector<std::byte> upload(ObjectAddress object, SdoProtocol protocol);
  bool size_is_known() const override { return size_is_known_; }
  void download(ObjectAddress object, std::span<const std::byte> data, SdoProtocol protocol);

  Time now() const override { return bus_.now(); }
  void wait(Time span) override { bus_.run_for(span); }
  std::uint16_t address() const override { return node_id_; }
  std::string where() const override;
  // Receives the node's EMCYs as long as this object exists.
  std::optional<Emergency> latest_emergency() override { return emergency_; }

  std::uint8_t node_id() const { return node_id_; }
  Bus& bus() { return bus_; }
  // Cancellation callback, called after each frame and every 5 ms during a transfer. If it returns true, the transfer
  // is aborted and throws MasterError. It may carry out transfers with other nodes. Meant for long transfers. A caller
  // that moves an axis must not use it, but cancel between transfers, because it needs transfers to stop the axis.
  void cancel_when(std::function<bool()> cancelled) { cancelled_ = std::move(cancelled); }

 private:
  void set_wait_limit(std::optional<Time> longest) override { limit_.set(longest); }
  void run(SdoTransfer& transfer, ObjectAddress object, SdoProtocol protocol);
  void expect_late_answer(ObjectAddress object);
  // Returns false if the node does not answer.
  bool drain_late_answer();
  void watch(const Frame& frame);
  std::uint64_t others_sent() const { return bus_.sent() - sent_; }
  void send_waiting(SdoTransfer& transfer);
  bool is_cancelled() const { return cancelled_ && cancelled_(); }

  Bus& bus_;
  std::uint8_t node_id_;
  SdoOptions options_;
  WaitLimit limit_{};
  std::function<bool()> cancelled_;
  std::optional<Emergency> emergency_;
  bool size_is_known_ = true;
  LateAnswer late_answer_{};  // to a request that was given up or repeated
  SecondAnswer second_answer_;
  std::uint64_t sent_ = 0;  // frames of this client
  Bus::Subscription listening_;
};

}  // namespace servodrome::master
