#include "links/can/client_slcan.hpp"

#include <algorithm>
#include <cerrno>
#include <fmt/format.h>

#include "links/can/slcan_protocol.hpp"
#include "links/descriptor_advice.hpp"
#include "links/link_error.hpp"

namespace servodrome::links {
namespace {

std::error_code system_error(int reason) { return {reason, std::generic_category()}; }

}  // namespace

SlcanClient::SlcanClient(const SlcanName& name, const CanClientOptions& options) : name_(name) {
  const auto* rate = std::find(slcan::bit_rates.begin(), slcan::bit_rates.end(), options.bit_rate);
  if (options.bit_rate != 0 && rate == slcan::bit_rates.end()) {
    fail(std::make_error_code(std::errc::invalid_argument),
         fmt::format("an slcan adapter has no bit rate {} bit/s", options.bit_rate),
         "choose 10000, 20000, 50000, 100000, 125000, 250000, 500000, 800000 or 1000000");
  }
  const Deadline deadline = std::chrono::steady_clock::now() + options.connect_timeout;
  open_tty();
  // Ends any incomplete command and closes a channel that was left open. Some adapters refuse C when the channel is
  // closed, and some answer the empty lines. The unmistakable answer to V marks the end of these answers.
  write("\r\r\rC\rV\r");
  do {
    if (!next_line(deadline)) {
      fail(std::make_error_code(std::errc::timed_out), "the adapter does not answer",
           "is it an slcan adapter, and free of other programs?");
    }
  } while (line_.empty() || line_[0] != 'V');
  if (options.bit_rate != 0) command(fmt::format("S{}", rate - slcan::bit_rates.begin()), deadline);
  command("O", deadline);
}

SlcanClient::~SlcanClient() {
  // A failure is ignored: the port is closed in any case.
  write_all(tty_.get(), "C\r", std::chrono::steady_clock::now() + std::chrono::milliseconds(100));
}

void SlcanClient::fail(std::error_code code, std::string_view what, std::string_view advice) const {
  throw LinkError(code,
                  fmt::format("\"{}\": {}; {}", to_string(CanLinkName(name_)), what, advice_for(code.value(), advice)));
}

// Sends a command that the adapter answers with CR or BEL only.
void SlcanClient::command(std::string_view line, Deadline deadline) {
  write(fmt::format("{}\r", line));
  do {
    if (!next_line(deadline)) {
      fail(std::make_error_code(std::errc::timed_out), fmt::format("no answer to command {}", line),
           "switch the adapter off and on");
    }
  } while (!line_.empty());
  if (ended_in_bell_) {
    fail(std::make_error_code(std::errc::protocol_error), fmt::format("the adapter refuses command {}", line),
         "give it another bit rate, or switch it off and on");
  }
}

void SlcanClient::write(std::string_view text) {
  if (write_all(tty_.get(), text, std::chrono::steady_clock::now() + send_timeout)) return;
  const auto code = system_error(errno);
  fail(code, fmt::format("the adapter is lost ({})", code.message()), "is it still plugged in, or the line up?");
}

bool SlcanClient::next_line(Deadline deadline) {
  for (;;) {
    if (line_ended_) {
      line_.clear();
      line_ended_ = false;
    }
    while (!unread_.empty()) {
      const char byte = unread_.front();
      unread_.remove_prefix(1);
      if (byte == slcan::end_of_line || byte == slcan::bell) {
        line_ended_ = true;
        ended_in_bell_ = byte == slcan::bell;
        return true;
      }
      if (line_.size() < longest_line) line_ += byte;
    }
    const std::ptrdiff_t size = read_some(tty_.get(), input_.data(), input_.size());
    if (size > 0) {
      unread_ = std::string_view(input_.data(), static_cast<std::size_t>(size));
    } else if (size == 0 || (errno != EAGAIN && errno != EINTR)) {
      const auto code = system_error(size == 0 ? EIO : errno);
      fail(code, fmt::format("the adapter is lost ({})", code.message()), "is it still plugged in, or the line up?");
    } else if (!wait_readable(tty_.get(), deadline)) {
      return false;
    }
  }
}

void SlcanClient::send(const canopen::Frame& frame) { write(slcan::format_frame(frame) + slcan::end_of_line); }

std::optional<canopen::Frame> SlcanClient::receive(Time timeout) {
  const Deadline deadline = std::chrono::steady_clock::now() + timeout;
  while (next_line(deadline)) {
    if (ended_in_bell_) continue;
    if (const auto frame = slcan::parse_frame(line_)) return frame;
  }
  return std::nullopt;
}

}  // namespace servodrome::links
