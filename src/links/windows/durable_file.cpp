#include "links/durable_file.hpp"

#include <algorithm>
#include <windows.h>

namespace servodrome::links {
namespace {

std::error_code last_error() { return {static_cast<int>(::GetLastError()), std::system_category()}; }

FileDescriptor opened(const std::filesystem::path& file, DWORD access, DWORD creation, DWORD flags) {
  return FileDescriptor(reinterpret_cast<Descriptor>(
      ::CreateFileW(file.c_str(), access, FILE_SHARE_READ, nullptr, creation, FILE_ATTRIBUTE_NORMAL | flags, nullptr)));
}

HANDLE handle_of(const FileDescriptor& file) { return reinterpret_cast<HANDLE>(file.get()); }

std::error_code write_all(const FileDescriptor& file, std::string_view text) {
  while (!text.empty()) {
    DWORD count = 0;
    const auto part = static_cast<DWORD>(std::min<std::size_t>(text.size(), 1U << 30));
    if (!::WriteFile(handle_of(file), text.data(), part, &count, nullptr)) return last_error();
    text.remove_prefix(count);
  }
  return ::FlushFileBuffers(handle_of(file)) ? std::error_code() : last_error();
}

}  // namespace

std::error_code replace_file(const std::filesystem::path& file, std::string_view text) {
  std::filesystem::path part = file;
  part += ".part";
  std::error_code error;
  {
    const FileDescriptor out = opened(part, GENERIC_WRITE, CREATE_ALWAYS, 0);
    if (!out.is_open()) return last_error();
    error = write_all(out, text);
  }
  if (!error && !::MoveFileExW(part.c_str(), file.c_str(), MOVEFILE_REPLACE_EXISTING | MOVEFILE_WRITE_THROUGH)) {
    error = last_error();
  }
  if (error) ::DeleteFileW(part.c_str());
  return error;
}

std::error_code append_to_file(const std::filesystem::path& file, std::string_view text) {
  const FileDescriptor out = opened(file, GENERIC_WRITE, OPEN_ALWAYS, 0);
  LARGE_INTEGER end{};
  if (!out.is_open() || !::SetFilePointerEx(handle_of(out), {}, &end, FILE_END)) return last_error();
  const std::error_code error = write_all(out, text);
  if (error && (!::SetFilePointerEx(handle_of(out), end, nullptr, FILE_BEGIN) || !::SetEndOfFile(handle_of(out)))) {
    return last_error();
  }
  return error;
}

// Windows cannot lock a folder. The lock is a file in it that only one program can have open, and that Windows deletes
// when the program ends.
std::optional<FolderLock> FolderLock::take(const std::filesystem::path& folder, std::error_code& error) {
  FileDescriptor file(reinterpret_cast<Descriptor>(::CreateFileW((folder / ".lock").c_str(), GENERIC_WRITE, 0, nullptr,
                                                                 OPEN_ALWAYS, FILE_FLAG_DELETE_ON_CLOSE, nullptr)));
  if (file.is_open()) return FolderLock(std::move(file));
  error = ::GetLastError() == ERROR_SHARING_VIOLATION ? std::make_error_code(std::errc::device_or_resource_busy)
                                                      : last_error();
  return std::nullopt;
}

}  // namespace servodrome::links
