#pragma once

#include <cstdint>
#include <string>

namespace servodrome::line::bench {

enum class Method : std::uint8_t { get, put, post, delete_, other };

struct Request {
  Method method = Method::get;
  std::string target{};  // path, and perhaps ?query
  std::string body{};
  // What decides who may do what (access.hpp).
  std::string host{};
  std::string origin{};
  std::string authorization{};
  bool has_origin = false;
  bool from_loopback = true;
};

struct Response {
  unsigned status = 200;
  std::string body;                              // empty for 204
  std::string allow{};                           // of a 405: the methods the address has
  std::string content_type{"application/json"};  // of a body
};

}  // namespace servodrome::line::bench
