#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <utility>
#include <vector>

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
  std::string if_none_match{};
  bool has_origin = false;
  bool from_loopback = true;
};

// The next part of a body that is made while it is sent; empty: there is no more.
using More = std::function<std::string()>;

struct Response {
  // Carries out a piece of a request that takes long, so that other things are done between the pieces. True: that was
  // the last, and the response is what is to be answered.
  using Piece = std::function<bool(Response&)>;

  unsigned status = 200;
  std::string body;                                           // empty for 204
  std::string allow{};                                        // of a 405: the methods the address has
  std::string content_type{"application/json"};               // of a body
  More more{};                                                // of a body that does not end with `body`
  std::vector<std::pair<std::string, std::string>> fields{};  // more of the header
  Piece piece{};                                              // the request is not carried out yet
};

}  // namespace servodrome::line::bench
