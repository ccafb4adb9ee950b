#include "app/process.hpp"

#include <array>
#include <csignal>
#include <windows.h>
// needs the one above
#include <timeapi.h>

namespace servodrome::app {

void begin_process() {
  // Otherwise a timer fires up to 16 ms late.
  ::timeBeginPeriod(1);
  ::SetConsoleOutputCP(CP_UTF8);
  const HANDLE output = ::GetStdHandle(STD_OUTPUT_HANDLE);
  DWORD mode = 0;
  if (::GetConsoleMode(output, &mode)) ::SetConsoleMode(output, mode | ENABLE_VIRTUAL_TERMINAL_PROCESSING);
}

std::filesystem::path program_file() {
  std::array<wchar_t, 32768> path{};  // the longest path of Windows
  const DWORD size = ::GetModuleFileNameW(nullptr, path.data(), static_cast<DWORD>(path.size()));
  return std::filesystem::path(path.data(), path.data() + size);
}

std::vector<int> ending_signals() { return {SIGINT, SIGTERM, SIGBREAK}; }

void ignore_broken_pipes() {}  // Windows does not kill a process for them

}  // namespace servodrome::app
