#pragma once

#include <string>

#include "links/file_descriptor.hpp"

namespace servodrome::links {

// A pseudo terminal in raw mode, found by clients under a symbolic link. The master end is nonblocking.
class Pty {
 public:
  // `link_path`: replaced if it is a symbolic link that was left behind, refused if another Pty has it, of this process
  // or another, or if it is anything else. Throws LinkError.
  explicit Pty(const std::string& link_path);
  ~Pty();
  Pty(const Pty&) = delete;
  Pty& operator=(const Pty&) = delete;

  int master() const { return master_.get(); }
  const std::string& device() const { return device_; }  // /dev/pts/N

  // Whether a client has the device open or has left bytes to read.
  bool has_client() const;
  // Bytes of a client can be read.
  bool has_input() const;
  // Raw mode again and nothing left of an earlier client's traffic.
  void reset();

 private:
  FileDescriptor master_;
  FileDescriptor claim_;  // of the path: a name that is taken as long as its process lives
  std::string device_;
  std::string link_path_;
};

}  // namespace servodrome::links
