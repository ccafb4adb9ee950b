#pragma once

#include <string>

namespace servodrome::api {

// Names the client or the job for which the calling thread works, for the change log. The name is valid during the life
// of this object; then the former one is valid again.
class Author {
 public:
  explicit Author(std::string name);
  ~Author();
  Author(const Author&) = delete;
  Author& operator=(const Author&) = delete;

  // The name that is valid in the calling thread; empty: none.
  static const std::string& present();

 private:
  std::string former_;
};

}  // namespace servodrome::api
