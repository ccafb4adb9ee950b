#pragma once

#include <string>

#include "links/file_descriptor.hpp"

namespace servodrome::links {

// A pseudo terminal in raw mode. Clients open it through a symbolic link. The master end is nonblocking.
class Pty {
 public:
  // Replaces `link_path` if it is a symbolic link without an owner. Throws LinkError if another Pty, of any process,
  // has this path, or if the path is anything else.
  explicit Pty(const std::string& link_path);
  ~Pty();
  Pty(const Pty&) = delete;
  Pty& operator=(const Pty&) = delete;

  int master() const { return master_.get(); }
  const std::string& device() const { return device_; }  // /dev/pts/N

  // Returns true if a client has the device open or has left bytes to read.
  bool has_client() const;
  // Takes back what the last client may have changed (mode, stopped output, exclusive use), and discards the bytes that
  // it has not read. If the client has demanded exclusive use, this needs root.
  void reset();
  // Discards bytes that no client has read.
  void discard_unread();

 private:
  FileDescriptor open_device() const;

  FileDescriptor master_;
  FileDescriptor claim_;  // reserves the path while the process runs
  std::string device_;
  std::string link_path_;
};

}  // namespace servodrome::links
