#include "links/durable_file.hpp"

#include <cerrno>
#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

namespace servodrome::links {
namespace {

constexpr mode_t usual_rights = 0666;  // the user's umask restricts them

std::error_code last_error() { return {errno, std::generic_category()}; }

std::error_code write_all(int file, std::string_view text) {
  while (!text.empty()) {
    const ssize_t count = ::write(file, text.data(), text.size());
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) return last_error();
    text.remove_prefix(static_cast<std::size_t>(count));
  }
  return {};
}

// Makes the name of a file as durable as its content.
std::error_code sync_folder_of(const std::filesystem::path& file) {
  const FileDescriptor folder(::open(file.parent_path().c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  return folder.is_open() && ::fsync(folder.get()) == 0 ? std::error_code() : last_error();
}

}  // namespace

std::error_code replace_file(const std::filesystem::path& file, std::string_view text) {
  const std::filesystem::path part = file.string() + ".part";
  FileDescriptor out(::open(part.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, usual_rights));
  if (!out.is_open()) return last_error();
  std::error_code error = write_all(out.get(), text);
  if (!error && ::fsync(out.get()) != 0) error = last_error();
  if (!error && ::rename(part.c_str(), file.c_str()) != 0) error = last_error();
  if (!error) return sync_folder_of(file);
  ::unlink(part.c_str());
  return error;
}

std::error_code append_to_file(const std::filesystem::path& file, std::string_view text) {
  const FileDescriptor out(::open(file.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, usual_rights));
  struct stat before {};
  if (!out.is_open() || ::fstat(out.get(), &before) != 0) return last_error();
  // Before the text: a caller that repeats the call after an error must not write it twice.
  std::error_code error = before.st_size == 0 ? sync_folder_of(file) : std::error_code();
  if (!error) error = write_all(out.get(), text);
  if (!error && ::fsync(out.get()) != 0) error = last_error();
  if (!error) return error;
  if (::ftruncate(out.get(), before.st_size) != 0) return last_error();
  return error;
}

std::optional<FolderLock> FolderLock::take(const std::filesystem::path& folder, std::error_code& error) {
  FileDescriptor file(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (file.is_open() && ::flock(file.get(), LOCK_EX | LOCK_NB) == 0) return FolderLock(std::move(file));
  error = errno == EWOULDBLOCK ? std::make_error_code(std::errc::device_or_resource_busy) : last_error();
  return std::nullopt;
}

}  // namespace servodrome::links
