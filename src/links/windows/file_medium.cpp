#include "links/file_medium.hpp"

#include <filesystem>
#include <fmt/format.h>
#include <stdexcept>
#include <system_error>
#include <windows.h>

namespace servodrome::links {
namespace {

[[noreturn]] void fail(const std::string& path, const std::string& why) {
  throw std::runtime_error(fmt::format("parameter file {}: {}", path, why));
}

std::string last_error() {
  return std::error_code(static_cast<int>(::GetLastError()), std::system_category()).message();
}

HANDLE handle_of(Descriptor file) { return reinterpret_cast<HANDLE>(file); }

// The place in the file for one ReadFile or WriteFile.
OVERLAPPED place_of(std::uint32_t address) {
  OVERLAPPED place{};
  place.Offset = address;
  return place;
}

}  // namespace

// Other programs may read the file while it is open, but neither write, delete, move nor replace it: so it is locked,
// and its path always refers to it.
FileMedium::FileMedium(const std::string& path, std::uint32_t size)
    : path_(std::filesystem::absolute(path).string()), file_(no_descriptor), size_(size) {
  FileDescriptor file(reinterpret_cast<Descriptor>(::CreateFileW(std::filesystem::path(path_).c_str(),
                                                                 GENERIC_READ | GENERIC_WRITE, FILE_SHARE_READ, nullptr,
                                                                 OPEN_ALWAYS, FILE_ATTRIBUTE_NORMAL, nullptr)));
  if (!file.is_open()) {
    if (::GetLastError() == ERROR_SHARING_VIOLATION) {
      fail(path, "is in use by another drive or process; stop it or choose another file");
    }
    fail(path, "cannot open: " + last_error() + "; choose a file in a folder that exists and may be written to");
  }
  const HANDLE handle = handle_of(file.get());
  if (::GetFileType(handle) != FILE_TYPE_DISK) fail(path, "is not a regular file; choose another path");
  LARGE_INTEGER present{};
  if (!::GetFileSizeEx(handle, &present)) fail(path, "cannot inspect: " + last_error());
  if (present.QuadPart == 0) {
    LARGE_INTEGER wanted{};
    wanted.QuadPart = size;
    if (!::SetFilePointerEx(handle, wanted, nullptr, FILE_BEGIN) || !::SetEndOfFile(handle)) {
      fail(path, "cannot grow: " + last_error());
    }
    if (!::FlushFileBuffers(handle)) fail(path, "cannot sync: " + last_error());
  } else if (present.QuadPart != static_cast<LONGLONG>(size)) {
    fail(path, fmt::format("has {} bytes, but this device's memory has {}; move it away to start with factory values",
                           present.QuadPart, size));
  }
  file_ = file.release();
}

FileMedium::~FileMedium() { ::CloseHandle(handle_of(file_)); }

bool FileMedium::in_place() const { return true; }

bool FileMedium::read(std::uint32_t address, std::span<std::byte> bytes) {
  OVERLAPPED place = place_of(address);
  DWORD count = 0;
  const auto size = static_cast<DWORD>(bytes.size());
  return ::ReadFile(handle_of(file_), bytes.data(), size, &count, &place) && count == size;
}

bool FileMedium::write(std::uint32_t address, std::span<const std::byte> bytes) {
  OVERLAPPED place = place_of(address);
  DWORD count = 0;
  const auto size = static_cast<DWORD>(bytes.size());
  return ::WriteFile(handle_of(file_), bytes.data(), size, &count, &place) && count == size;
}

bool FileMedium::flush() { return ::FlushFileBuffers(handle_of(file_)) != 0; }

}  // namespace servodrome::links
