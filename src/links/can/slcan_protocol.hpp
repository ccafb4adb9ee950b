#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "canopen/frame.hpp"
#include "links/time.hpp"

// The LAWICEL serial protocol (CAN232/CANUSB manuals), as python-can's `slcan` interface and Linux' slcand use it. A
// command ends with CR. The answer ends with CR, or is BEL if the command is wrong or not allowed in this state.
namespace servodrome::links::slcan {

inline constexpr char end_of_line = '\r';
inline constexpr char bell = '\a';

// Reads and writes `tiiildd..`, `Tiiiiiiiildd..`, `riiil`, `Riiiiiiiil`, without CR. parse_frame() also accepts a
// timestamp of four digits at the end.
std::optional<canopen::Frame> parse_frame(std::string_view line);
std::string format_frame(const canopen::Frame& frame);

// Bit rates of S0 .. S8. python-can calls S7 750 kbit/s; the manual says 800.
inline constexpr std::array<std::uint32_t, 9> bit_rates = {10'000,  20'000,  50'000,  100'000,  125'000,
                                                           250'000, 500'000, 800'000, 1'000'000};

// The operations of an adapter on its bus.
class Controller {
 public:
  virtual ~Controller() = default;
  virtual void open(bool listen_only) = 0;
  virtual void close() = 0;
  virtual void set_bit_rate(std::uint32_t bit_rate) = 0;
  virtual bool transmit(const canopen::Frame& frame) = 0;  // false: refused, for example by a full queue
  virtual std::uint8_t status_flags() = 0;                 // the value for the F command
};

// Acceptance filter of the SJA1000 in dual filter mode, set with M and m.
struct AcceptanceFilter {
  std::uint32_t code = 0;
  std::uint32_t mask = 0xFFFFFFFFU;  // 1: the bit is not compared

  bool passes(const canopen::Frame& frame) const;
};

// The adapter's side of the protocol.
class Adapter {
 public:
  explicit Adapter(Controller& controller) : controller_(controller) {}

  // Processes one byte from the host. If it completes a command, the answer is appended to `answer`.
  void receive(char byte, std::string& answer);
  // Returns the text that the host receives for a frame of the bus. It is empty if the channel is closed or the
  // acceptance filter rejects the frame.
  std::string frame_text(const canopen::Frame& frame, Time at) const;
  // Restores the state after power-on, when the host is gone.
  void reset();
  bool is_open() const { return state_ != State::closed; }
  std::uint64_t refused_commands() const { return refused_; }

 private:
  enum class State : std::uint8_t { closed, open, listening };

  bool execute(std::string_view line, std::string& answer);
  bool set_timing(std::string_view digits);

  static constexpr std::size_t longest_line = 32;

  Controller& controller_;
  State state_ = State::closed;
  bool timestamps_ = false;
  AcceptanceFilter filter_;
  std::array<char, longest_line> line_{};
  std::size_t size_ = 0;  // longest_line + 1: too long, ignore until CR
  std::uint64_t refused_ = 0;
};

}  // namespace servodrome::links::slcan
