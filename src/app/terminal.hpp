#pragma once

#include <memory>
#include <string>

namespace servodrome::app {

// Returns true if standard output is a terminal, where a line can be rewritten.
bool on_terminal();
// Returns the width of the terminal of standard output; 0: unknown.
unsigned terminal_width();
// Returns true if writing a line to standard output, or to standard error, does not block. A terminal that Ctrl-S has
// stopped blocks.
bool output_is_ready();
bool error_output_is_ready();
// Returns true if standard input is a terminal.
bool has_keyboard();

// While it lives, the terminal delivers single characters without echo, and Ctrl-S does not stop the output.
class Keyboard {
 public:
  Keyboard();
  ~Keyboard();
  Keyboard(const Keyboard&) = delete;
  Keyboard& operator=(const Keyboard&) = delete;

  // Returns the characters typed since the last call, arrow keys as ESC [ A to D. After the loss of the terminal it
  // returns "q", which ends the jog.
  static std::string typed();

 private:
  struct Before;  // the terminal's settings before
  std::unique_ptr<Before> before_;
};

}  // namespace servodrome::app
