#include "app/terminal.hpp"

#include <array>
#include <windows.h>

namespace servodrome::app {
namespace {

bool is_console(DWORD standard_handle) {
  DWORD mode = 0;
  return ::GetConsoleMode(::GetStdHandle(standard_handle), &mode) != 0;
}

}  // namespace

bool on_terminal() { return is_console(STD_OUTPUT_HANDLE); }

unsigned terminal_width() {
  CONSOLE_SCREEN_BUFFER_INFO info{};
  if (!::GetConsoleScreenBufferInfo(::GetStdHandle(STD_OUTPUT_HANDLE), &info)) return 0;
  return static_cast<unsigned>(info.srWindow.Right - info.srWindow.Left + 1);
}

// A console has no poll.
bool output_is_ready() { return true; }
bool error_output_is_ready() { return true; }

bool has_keyboard() { return is_console(STD_INPUT_HANDLE); }

struct Keyboard::Before {
  DWORD mode = 0;
};

Keyboard::Keyboard() : before_(std::make_unique<Before>()) {
  const HANDLE input = ::GetStdHandle(STD_INPUT_HANDLE);
  ::GetConsoleMode(input, &before_->mode);
  ::SetConsoleMode(input, before_->mode & ~static_cast<DWORD>(ENABLE_LINE_INPUT | ENABLE_ECHO_INPUT));
}

Keyboard::~Keyboard() { ::SetConsoleMode(::GetStdHandle(STD_INPUT_HANDLE), before_->mode); }

std::string Keyboard::typed() {
  const HANDLE input = ::GetStdHandle(STD_INPUT_HANDLE);
  std::string text;
  DWORD waiting = 0;
  if (!::GetNumberOfConsoleInputEvents(input, &waiting)) return "q";
  for (; waiting > 0; --waiting) {
    INPUT_RECORD record{};
    DWORD count = 0;
    if (!::ReadConsoleInputW(input, &record, 1, &count)) return "q";
    if (record.EventType != KEY_EVENT || !record.Event.KeyEvent.bKeyDown) continue;
    switch (record.Event.KeyEvent.wVirtualKeyCode) {
      case VK_UP: text += "\x1B[A"; break;
      case VK_DOWN: text += "\x1B[B"; break;
      case VK_RIGHT: text += "\x1B[C"; break;
      case VK_LEFT: text += "\x1B[D"; break;
      default:
        if (const wchar_t letter = record.Event.KeyEvent.uChar.UnicodeChar; letter > 0 && letter < 0x80) {
          text += static_cast<char>(letter);
        }
    }
  }
  return text;
}

}  // namespace servodrome::app
