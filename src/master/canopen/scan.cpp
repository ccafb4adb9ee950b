#include "master/canopen/scan.hpp"

#include <algorithm>
#include <fmt/format.h>
#include <list>

#include "canopen/connection_set.hpp"
#include "master/canopen/sdo_transfer.hpp"

namespace servodrome::master {
namespace {

namespace connection_set = canopen::connection_set;

// Read from each node in this order; a node that does not answer the first request is absent.
constexpr auto questions = std::to_array<ObjectAddress>(
    {{0x1000, 0}, {0x1018, 1}, {0x1018, 2}, {0x1018, 3}, {0x1018, 4}, {0x1008, 0}, {0x100A, 0}});

constexpr Time known_node_timeout = std::chrono::seconds(2);

// State machine that reads these objects from one node.
class Interview {
 public:
  Interview(Bus& bus, std::uint8_t node_id, Time timeout) : bus_(bus), timeout_(timeout) {
    node_.node_id = node_id;
    ask();
  }

  void receive(const Frame& frame) {
    if (finished() || !transfer_.receive(frame)) return;
    answered_ = true;
    deadline_ = bus_.now() + patience();
    send();  // perhaps the abort of a wrong answer
    if (!transfer_.finished()) return;
    if (transfer_.result() == AbortCode::none) take_answer();
    next();
  }

  void poll() {
    if (finished() || bus_.now() < deadline_) return;
    transfer_.abort(AbortCode::protocol_timed_out);
    if (!answered_) {
      question_ = questions.size();  // no node has this address: the abort is not sent
      return;
    }
    send();
    next();
  }

  bool finished() const { return question_ == questions.size(); }
  bool answered() const { return answered_; }
  Time deadline() const { return finished() ? canopen::never : deadline_; }
  FoundNode& node() { return node_; }

 private:
  // Timeout for one request. A node that has answered once is present, so it gets a longer timeout: the node or the
  // link may be slow.
  Time patience() const { return answered_ ? std::max(timeout_, known_node_timeout) : timeout_; }

  void ask() {
    transfer_ = SdoTransfer::upload(questions[question_]);
    send();
    deadline_ = bus_.now() + patience();
  }

  void next() {
    if (++question_ < questions.size()) ask();
  }

  void send() {
    Frame frame;
    while (transfer_.take(frame)) {
      frame.id = connection_set::sdo_request + node_.node_id;
      bus_.send(frame);
    }
  }

  std::uint32_t number() const {
    std::uint32_t value = 0;
    for (std::size_t i = 0; i < std::min(transfer_.data().size(), sizeof value); ++i) {
      value |= std::to_integer<std::uint32_t>(transfer_.data()[i]) << (8 * i);
    }
    return value;
  }
  std::string text() const {
    std::string text(reinterpret_cast<const char*>(transfer_.data().data()), transfer_.data().size());
    text.erase(text.find_last_not_of('\0') + 1);
    return text;
  }

  void take_answer() {
    const auto identity = [this]() -> LssAddress& {
      return node_.identity ? *node_.identity : node_.identity.emplace();
    };
    switch (question_) {
      case 0: node_.device_type = number(); break;
      case 1: identity().vendor_id = number(); break;
      case 2: identity().product_code = number(); break;
      case 3: identity().revision_number = number(); break;
      case 4: identity().serial_number = number(); break;
      case 5: node_.name = text(); break;
      default: node_.software_version = text(); break;
    }
  }

  Bus& bus_;
  Time timeout_;
  FoundNode node_;
  std::size_t question_ = 0;
  SdoTransfer transfer_ = SdoTransfer::upload(questions[0]);
  Time deadline_{};
  bool answered_ = false;
};

}  // namespace

std::vector<FoundNode> scan(Bus& bus, const ScanOptions& options) {
  bus.drain();
  Master listener(bus);
  std::list<Interview> interviews;
  const Bus::Subscription listening = bus.listen([&](const Frame& frame) {
    if (frame.extended || frame.remote || frame.id <= connection_set::sdo_response ||
        frame.id > connection_set::sdo_response + 127)
      return;
    for (Interview& interview : interviews) {
      if (interview.node().node_id == frame.id - connection_set::sdo_response) interview.receive(frame);
    }
  });
  const Time listen_until = bus.now() + options.listen;
  for (unsigned node_id = options.first; node_id <= options.last; ++node_id) {
    interviews.emplace_back(bus, static_cast<std::uint8_t>(node_id), options.timeout);
  }
  const auto all_done = [&] {
    return std::all_of(interviews.begin(), interviews.end(), [](const Interview& one) { return one.finished(); });
  };
  while (!all_done()) {
    Time next = canopen::never;
    for (const Interview& interview : interviews) next = std::min(next, interview.deadline());
    bus.run_until(next, all_done);
    for (Interview& interview : interviews) interview.poll();
  }
  bus.run_until(listen_until, [] { return false; });

  std::vector<FoundNode> found;
  for (Interview& interview : interviews) {
    FoundNode& node = interview.node();
    node.state = listener.health(node.node_id).state;
    if (interview.answered() || node.state) found.push_back(std::move(node));
  }
  return found;
}

// The kind of device: bits 16..23 of the device type of CiA 402.
std::string kind_of(const FoundNode& node) {
  if (!node.device_type) return "";
  if (node.profile() == 0) return "device without profile";
  if (!node.is_drive()) return fmt::format("CiA {} device", node.profile());
  switch (*node.device_type >> 16 & 0xFF) {
    case 1: return "frequency converter (CiA 402)";
    case 2: return "servo drive (CiA 402)";
    case 4: return "stepper drive (CiA 402)";
    default: return "drive (CiA 402)";
  }
}

}  // namespace servodrome::master
