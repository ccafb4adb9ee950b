// LSS, the layer setting services of CiA 305, for a node that has a node-ID.
#include <algorithm>

#include "canopen/305/lss_slave.hpp"
#include "master/canopen/lss_master.hpp"
#include "master/canopen/scan.hpp"
#include "tools/conform/check_tables.hpp"
#include "tools/conform/frames.hpp"
#include "tools/conform/trial.hpp"

namespace servodrome::master::conform::lss_group {
namespace {

using namespace std::chrono_literals;
using LssFrame = std::array<std::uint8_t, 8>;

constexpr std::uint8_t configure_node_id = 0x11;
constexpr std::uint8_t configure_bit_timing = 0x13;
constexpr std::uint8_t inquire_node_id = 0x5E;
constexpr std::uint8_t no_node_id = 255;
constexpr Time silence = 100ms;

std::string text_of_lss(const LssFrame& frame) {
  std::string text = "LSS";
  for (const std::uint8_t byte : frame) text += fmt::format(" {:02X}", byte);
  return text;
}

// Sends a request and returns the first answer; nullopt if there is none in time.
std::optional<LssFrame> ask_lss(Trial& trial, const LssFrame& request) {
  Bus& bus = trial.subject().can().bus;
  bus.drain();
  const Watch answers(bus, canopen::LssSlave::response_can_id);
  Frame frame;
  frame.id = canopen::LssSlave::request_can_id;
  frame.length = 8;
  frame.data = request;
  bus.send(frame);
  bus.run_until(bus.now() + silence, [&] { return !answers.arrivals().empty(); });
  if (answers.arrivals().empty()) return std::nullopt;
  return answers.arrivals().front().frame.data;
}
std::string text_of_answer(const std::optional<LssFrame>& answer) {
  return answer ? text_of_lss(*answer) : "no answer";
}

LssAddress address_of(Trial& trial) {
  ObjectClient& objects = trial.subject().services();
  const auto part = [&](std::uint8_t sub) { return objects.read_if_present<std::uint32_t>(0x1018, sub).value_or(0); };
  return {part(1), part(2), part(3), part(4)};
}

std::string text_of_address(const LssAddress& address) {
  return fmt::format("{:X}h {:X}h {:X}h {:X}h", address.vendor_id, address.product_code, address.revision_number,
                     address.serial_number);
}

// Puts all nodes into the waiting state at construction and destruction.
class Lss {
 public:
  // Skips the check if the node does not answer.
  explicit Lss(Trial& trial) : trial_(trial), address_(address_of(trial)), master_(trial.subject().can().bus, silence) {
    if (!master_.select(address_)) Trial::skip("it does not answer to LSS, which is optional");
    master_.switch_all_to_waiting();
  }
  ~Lss() {
    try {
      master_.switch_all_to_waiting();
    } catch (const MasterError&) {
      // The link is lost; the next access reports it.
    }
  }
  Lss(const Lss&) = delete;
  Lss& operator=(const Lss&) = delete;

  LssMaster& master() { return master_; }
  const LssAddress& address() const { return address_; }
  void select() {
    trial_.require(master_.select(address_), "switch state selective, " + text_of_address(address_),
                   "44h, it is in configuration state", "no answer");
  }
  bool in_configuration() { return ask_lss(trial_, {inquire_node_id}).has_value(); }

 private:
  Trial& trial_;
  LssAddress address_;
  LssMaster master_;
};

void selective(Trial& trial, int) {
  Lss lss(trial);
  trial.expect(!lss.in_configuration(), "inquire node-ID in waiting state", "no answer", "an answer");
  lss.select();
  trial.expect(lss.in_configuration(), "inquire node-ID when it is selected", "an answer", "no answer");
  lss.master().switch_all_to_waiting();
  trial.expect(!lss.in_configuration(), "switch state global to waiting, then inquire node-ID", "no answer",
               "an answer");
  LssAddress other = lss.address();
  other.product_code = ~other.product_code;
  const bool answered = lss.master().select(other);
  trial.expect(!answered, "switch state selective, " + text_of_address(other), "no answer", "44h");
  trial.expect(!lss.in_configuration(), "inquire node-ID after that", "no answer", "an answer");
}

void global(Trial& trial, int) {
  Lss lss(trial);
  // Several nodes would all answer, with different data under the same identifier.
  if (scan(trial.subject().can().bus).size() != 1 || lss.master().any_unconfigured())
    Trial::skip("there are other nodes on the bus, which would answer as well");
  lss.master().switch_all_to_configuration();
  trial.expect(lss.in_configuration(), "switch state global to configuration, then inquire node-ID", "an answer",
               "no answer");
}

void inquires(Trial& trial, int) {
  Lss lss(trial);
  lss.select();
  const LssAddress seen = lss.master().inquire_address();
  trial.expect(seen == lss.address(), "inquire identity", text_of_address(lss.address()) + ", as 1018h has it",
               text_of_address(seen));
  const std::uint8_t node_id = lss.master().inquire_node_id();
  const std::uint8_t own = trial.subject().can().sdo.node_id();
  trial.expect(node_id == own, "inquire node-ID", fmt::format("{}", own), fmt::format("{}", node_id));
}

void identifies(Trial& trial, int) {
  Lss lss(trial);
  const LssAddress& own = lss.address();
  trial.expect(lss.master().identify(own, own.revision_number, own.serial_number),
               "identify remote slave, with its revision and serial number", "4Fh", "no answer");
  // Identify with ranges above the node's own numbers: it must not answer.
  LssAddress above = own;
  above.serial_number = own.serial_number + 1;
  trial.expect(!lss.master().identify(above, own.revision_number, own.serial_number),
               "identify remote slave, serial numbers above its own", "no answer", "4Fh");
  above = own;
  above.revision_number = own.revision_number + 1;
  trial.expect(!lss.master().identify(above, own.revision_number, own.serial_number),
               "identify remote slave, revisions above its own", "no answer", "4Fh");
}

void node_id(Trial& trial, int) {
  Lss lss(trial);
  const std::uint8_t own = trial.subject().can().sdo.node_id();
  const auto waiting = ask_lss(trial, {configure_node_id, own});
  trial.expect(!waiting, text_of_lss({configure_node_id, own}) + " in waiting state", "no answer",
               text_of_answer(waiting));
  lss.select();
  const auto expect_answer = [&](std::uint8_t id, bool taken, const char* what) {
    const LssFrame request{configure_node_id, id};
    const auto answer = ask_lss(trial, request);
    const bool right = answer && (*answer)[0] == configure_node_id && (*answer)[1] == (taken ? 0 : 1);
    trial.expect(right, fmt::format("{} ({})", text_of_lss(request), what), taken ? "11 00" : "11 01, out of range",
                 text_of_answer(answer));
  };
  expect_answer(0, false, "no node-ID");
  expect_answer(128, false, "no node-ID");
  expect_answer(own, true, "its own");
  const auto after = ask_lss(trial, {inquire_node_id});
  trial.expect(after && (*after)[1] == own, "inquire node-ID", fmt::format("{}, as before", own),
               text_of_answer(after));
}

void bit_timing(Trial& trial, int) {
  Lss lss(trial);
  lss.select();
  const LssFrame request{configure_bit_timing, 0, 200};
  const auto answer = ask_lss(trial, request);
  if (!answer) Trial::skip("it does not let its bit rate be set by LSS");
  trial.expect((*answer)[0] == configure_bit_timing && (*answer)[1] == 1,
               text_of_lss(request) + " (row 200 of the standard table)", "13 01, not supported",
               text_of_answer(answer));
}

// Restores the node's node-ID. Tries each way in which the node may still answer. Returns false if it does not answer.
bool give_back(Trial& trial, Lss& lss) {
  Bus& bus = trial.subject().can().bus;
  const std::uint8_t own = trial.subject().can().sdo.node_id();
  const auto boots = [&] {
    const Watch errors(bus, 0x700U + own);
    const auto answer = ask_lss(trial, {configure_node_id, own});
    if (!answer || (*answer)[1] != 0) return false;
    lss.master().switch_all_to_waiting();
    return bus.run_until(bus.now() + trial.settings().patience, [&] { return !errors.arrivals().empty(); });
  };
  if (boots()) return true;
  if (lss.master().select(lss.address()) && boots()) return true;
  lss.master().switch_all_to_configuration();
  return boots();
}

void fastscan(Trial& trial, int) {
  Lss lss(trial);
  Bus& bus = trial.subject().can().bus;
  const std::uint8_t own = trial.subject().can().sdo.node_id();
  if (lss.master().any_unconfigured())
    Trial::skip("another node without node-ID answers, or this one although it has one");
  if (scan(bus).size() != 1) Trial::skip("there are other nodes on the bus, which must not be without this one");
  lss.select();
  const LssFrame none{configure_node_id, no_node_id};
  const auto taken = ask_lss(trial, none);
  trial.require(taken && (*taken)[1] == 0, text_of_lss(none), "11 00, taken", text_of_answer(taken));
  try {
    lss.master().switch_all_to_waiting();
    trial.subject().master().command(NmtCommand::reset_communication, own);
    bus.run_for(500ms);
    const bool unconfigured = lss.master().any_unconfigured();
    trial.expect(unconfigured, "identify non-configured remote slave, after a reset of communication", "50h",
                 "no answer");
    const auto found = lss.master().fastscan();
    trial.expect(found && *found == lss.address(), "fastscan", text_of_address(lss.address()),
                 found ? text_of_address(*found) : "no answer");
  } catch (const MasterError&) {
    give_back(trial, lss);
    throw;
  }
  const bool back = give_back(trial, lss);
  trial.require(back, fmt::format("configure node-ID {}, then switch state global to waiting", own),
                fmt::format("the boot-up of node {}", own), "none: switch its power off and on");
  trial.expect(!lss.master().any_unconfigured(), "identify non-configured remote slave", "no answer", "50h");
}

constexpr unsigned can = buses::can;

constexpr std::array rows{
    Check{"lss.selective", "CiA 305, switch state selective and global",
          "It enters configuration state only when it is selected by its address", Demand::nothing, can, selective},
    Check{"lss.global", "CiA 305, switch state global", "A global switch puts all nodes into configuration state",
          Demand::nothing, can, global},
    Check{"lss.inquire", "CiA 305, inquire identity and node-ID", "It reports the contents of 1018h and its node-ID",
          Demand::nothing, can, inquires},
    Check{"lss.identify", "CiA 305, identify remote slave", "It answers to its own numbers only", Demand::nothing, can,
          identifies},
    Check{"lss.node-id", "CiA 305, configure node-ID", "An invalid node-ID is refused, and its own is accepted",
          Demand::nothing, can, node_id},
    Check{"lss.bit-timing", "CiA 305, configure bit timing", "An unknown bit rate is refused", Demand::nothing, can,
          bit_timing},
    Check{"lss.fastscan", "CiA 305, fastscan, identify non-configured remote slave",
          "Without node-ID it is found by fastscan and accepts its node-ID again", Demand::nothing, can, fastscan},
};

}  // namespace

std::span<const Check> checks() { return rows; }

}  // namespace servodrome::master::conform::lss_group
