#include "master/canopen/sdo_client.hpp"

#include <algorithm>
#include <fmt/format.h>

#include "canopen/connection_set.hpp"
#include "master/abort_text.hpp"
#include "master/canopen/emergency.hpp"

namespace servodrome::master {
namespace {

namespace connection_set = canopen::connection_set;

constexpr Time look_whether_cancelled = std::chrono::milliseconds(5);

std::string what_to_do(AbortCode code, bool from_node) {
  const char* remedy = remedy_of_failed_access(code, from_node);
  if (remedy != nullptr) return remedy;
  return "check the node-ID and the bit rate (`servodrome scan`), that the node is powered and not in NMT state "
         "stopped, or give a longer --timeout (where it is the time for each answer)";
}

}  // namespace

SdoError::SdoError(const std::string& bus, std::uint8_t node_id, ObjectAddress object, bool upload, AbortCode code,
                   bool from_node)
    : ObjectError(text_of_failed_access(upload, code, from_node),
                  fmt::format("{}, node {}, {}", bus, node_id, text_of(object)), what_to_do(code, from_node),
                  is_absent(code), from_node),
      node_id_(node_id),
      object_(object),
      code_(code),
      from_node_(from_node) {}

SdoClient::SdoClient(Bus& bus, std::uint8_t node_id, const SdoOptions& options)
    : bus_(bus), node_id_(node_id), options_(options) {
  if (node_id < 1 || node_id > 127) {
    throw MasterError(fmt::format("{} is not a node-ID", node_id), bus.name(), "give one from 1 to 127");
  }
  listening_ = bus_.listen([this](const Frame& frame) { watch(frame); });
}

void SdoClient::watch(const Frame& frame) {
  const auto emergency = parse_emergency(frame);
  if (emergency && emergency->node_id == node_id_) emergency_ = *emergency;
  if (frame.extended || frame.remote) return;
  if (frame.id == connection_set::sdo_response + node_id_) second_answer_.see(frame, others_sent());
  // The bus delivers only frames of other programs.
  if (frame.id == connection_set::sdo_request + node_id_) {
    second_answer_.doubt_until(bus_.now() + SecondAnswer::doubt);
  }
}

void SdoClient::send_waiting(SdoTransfer& transfer) {
  Frame frame;
  while (transfer.take(frame)) {
    frame.id = connection_set::sdo_request + node_id_;
    bus_.send(frame);
    ++sent_;
  }
}

// The answer to a request that is given up, or repeated, may come later.
void SdoClient::expect_late_answer(ObjectAddress object) {
  if (!LateAnswer::is_constant(object)) late_answer_.expect(bus_.now());
  second_answer_.doubt_until(bus_.now() + SecondAnswer::doubt);
}

void SdoClient::run(SdoTransfer& transfer, ObjectAddress object, SdoProtocol protocol) {
  bus_.drain();  // discards late answers to an abandoned transfer
  second_answer_.begin(object, protocol == SdoProtocol::block);
  struct Doubting {
    SdoClient& client;
    const SdoTransfer& transfer;
    ObjectAddress object;
    ~Doubting() {
      if (!transfer.finished()) client.expect_late_answer(object);
    }
  } const doubting{*this, transfer, object};
  Time deadline{};
  unsigned retries = limit_.retries(options_.retries);
  const Time timeout = limit_.timeout(options_.timeout);
  // If ask_again() can help, the deadline is half the timeout, so that the client asks again before the server's own
  // timeout.
  const auto expect_answer = [&] {
    const bool early = retries != 0 && transfer.can_ask_again();
    deadline = bus_.now() + (early ? timeout / 2 : timeout);
  };
  const Bus::Subscription listening = bus_.listen([&](const Frame& frame) {
    if (frame.id != connection_set::sdo_response + node_id_ || frame.extended || frame.remote) return;
    if (transfer.finished()) return;
    if (transfer.receive(frame)) expect_answer();
    if (transfer.finished()) second_answer_.end(frame, bus_.now(), others_sent());
    send_waiting(transfer);
  });
  send_waiting(transfer);
  expect_answer();
  while (!transfer.finished()) {
    // Each answer extends the deadline. With a cancellation callback the wait is cut into short pieces, so that
    // cancelling also works with a drive that does not answer.
    const Time until = cancelled_ ? std::min(deadline, bus_.now() + look_whether_cancelled) : deadline;
    bus_.run_until(until, [&] { return transfer.finished() || is_cancelled(); });
    if (!transfer.finished() && is_cancelled()) {
      expect_late_answer(object);
      transfer.abort(AbortCode::general_error);
      send_waiting(transfer);
      throw MasterError("interrupted", where(), "the transfer was aborted");
    }
    if (transfer.finished() || bus_.now() < deadline) continue;
    expect_late_answer(object);
    if (retries != 0 && transfer.can_ask_again()) {
      --retries;
      transfer.ask_again();
    } else {
      transfer.abort(AbortCode::protocol_timed_out);
    }
    send_waiting(transfer);
    expect_answer();
  }
}

bool SdoClient::drain_late_answer() {
  const ObjectAddress constant = late_answer_.next_object();
  SdoTransfer other = SdoTransfer::upload(constant);
  run(other, constant, SdoProtocol::ordinary);
  const bool answered = other.result() == AbortCode::none || other.aborted_by_server();
  if (answered) late_answer_.rule_out();
  return answered;
}

std::vector<std::byte> SdoClient::upload(ObjectAddress object, SdoProtocol protocol) {
  for (unsigned attempt = 0;; ++attempt) {
    SdoTransfer transfer = SdoTransfer::upload(object, protocol);
    if (late_answer_.is_expected(bus_.now()) && !LateAnswer::is_constant(object) && !drain_late_answer()) {
      transfer.abort(AbortCode::protocol_timed_out);  // not sent
    } else {
      run(transfer, object, protocol);
    }
    if (second_answer_.take()) {
      throw ObjectError("two devices answer", where(),
                        "give each device a node-ID of its own: switch one of them off, and change that of the other",
                        false);
    }
    size_is_known_ = transfer.size_is_known();
    if (transfer.result() == AbortCode::none) return transfer.data();
    // The timeout may have occurred at the client or at the server.
    const bool timed_out = transfer.result() == AbortCode::protocol_timed_out;
    if (!timed_out || attempt >= limit_.retries(options_.retries)) {
      throw SdoError(bus_.name(), node_id_, object, true, transfer.result(), transfer.aborted_by_server());
    }
  }
}

void SdoClient::download(ObjectAddress object, std::span<const std::byte> data, SdoProtocol protocol) {
  SdoTransfer transfer = SdoTransfer::download(object, data, protocol);
  run(transfer, object, protocol);
  if (transfer.result() != AbortCode::none) {
    throw SdoError(bus_.name(), node_id_, object, false, transfer.result(), transfer.aborted_by_server());
  }
}

std::string SdoClient::where() const { return fmt::format("{}, node {}", bus_.name(), node_id_); }

}  // namespace servodrome::master
