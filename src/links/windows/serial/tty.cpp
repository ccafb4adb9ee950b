#include "links/serial/tty.hpp"

#include <cerrno>
#include <fmt/format.h>
#include <windows.h>

#include "links/link_error.hpp"

namespace servodrome::links {
namespace {

[[noreturn]] void fail(DWORD reason, const std::string& device, std::string_view what, std::string_view advice) {
  const std::error_code code(static_cast<int>(reason), std::system_category());
  throw LinkError(code, fmt::format("serial port \"{}\" {} ({}); {}", device, what, code.message(), advice));
}

}  // namespace

// The port is opened for overlapped I/O, which Asio and FileDescriptor use.
FileDescriptor open_tty(const std::string& device, const modbus::CharacterFormat& format) {
  // Without this prefix, Windows knows only the names COM1 to COM9.
  const std::string path = device.starts_with("\\\\") ? device : "\\\\.\\" + device;
  FileDescriptor port(reinterpret_cast<Descriptor>(::CreateFileA(path.c_str(), GENERIC_READ | GENERIC_WRITE, 0, nullptr,
                                                                 OPEN_EXISTING, FILE_FLAG_OVERLAPPED, nullptr)));
  if (!port.is_open()) {
    const DWORD reason = ::GetLastError();
    fail(reason, device, "cannot be opened",
         reason == ERROR_ACCESS_DENIED || reason == ERROR_SHARING_VIOLATION
             ? "another program has it; end that program"
             : "check the name: \"mode\" or the device manager lists the ports");
  }
  const auto handle = reinterpret_cast<HANDLE>(port.get());
  DCB settings{};
  settings.DCBlength = sizeof settings;
  if (!::GetCommState(handle, &settings)) {
    fail(::GetLastError(), device, "is not a serial port", "name a port, for example COM3");
  }
  settings.BaudRate = format.bit_rate;
  settings.ByteSize = static_cast<BYTE>(format.data_bits);
  settings.Parity = format.parity == modbus::Parity::none  ? NOPARITY
                    : format.parity == modbus::Parity::odd ? ODDPARITY
                                                           : EVENPARITY;
  settings.StopBits = format.stop_bits == 2 ? TWOSTOPBITS : ONESTOPBIT;
  settings.fBinary = TRUE;
  settings.fParity = format.parity != modbus::Parity::none;
  settings.fOutxCtsFlow = settings.fOutxDsrFlow = settings.fDsrSensitivity = FALSE;
  settings.fOutX = settings.fInX = FALSE;
  settings.fErrorChar = settings.fNull = settings.fAbortOnError = FALSE;
  settings.fDtrControl = DTR_CONTROL_ENABLE;
  settings.fRtsControl = RTS_CONTROL_ENABLE;
  if (!::SetCommState(handle, &settings)) {
    fail(::GetLastError(), device, "does not accept the format", "choose another bit rate or parity");
  }
  // A read waits for the first byte without limit and ends 1 ms after the last one.
  COMMTIMEOUTS timeouts{};
  timeouts.ReadIntervalTimeout = 1;
  if (!::SetCommTimeouts(handle, &timeouts)) {
    fail(::GetLastError(), device, "does not accept timeouts", "name a port, for example COM3");
  }
  ::PurgeComm(handle, PURGE_RXCLEAR | PURGE_TXCLEAR);
  return port;
}

}  // namespace servodrome::links
