#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <utility>
#include <vector>

namespace servodrome::api {

enum class Method : std::uint8_t { get, put, post, delete_, other };

struct Request {
  Method method = Method::get;
  std::string target{};  // path, perhaps with ?query
  std::string body{};
  // The fields that decide whether the request is allowed (access.hpp).
  std::string host{};
  std::string origin{};
  std::string authorization{};
  std::string if_none_match{};
  // The sender by its own words: "page", or the first name of User-Agent, such as "curl". Empty: not known.
  std::string client{};
  bool has_origin = false;
  bool from_loopback = true;
  // The request comes before its turn in the rate limit: `begin` carries it out only if its route is urgent, otherwise
  // postpones it.
  bool only_if_urgent = false;
  // Why the request is no longer valid: its client has closed the connection, or a halt came while it waited for its
  // turn. Empty: it is valid. A request that is no longer valid begins nothing; a halt is carried out nevertheless.
  std::string_view obsolete{};
};

// Returns the next part of a body that is generated while it is sent; empty: the body is complete.
using More = std::function<std::string()>;

struct Response {
  // Carries out a piece of a long request, so that other events are handled between the pieces. Returns true after the
  // last piece, when the response is complete.
  using Piece = std::function<bool(Response&)>;

  unsigned status = 200;
  std::string body;                                           // empty for 204
  std::string allow{};                                        // of a 405: the methods of the address
  std::string content_type{"application/json"};               // of the body
  More more{};                                                // generates the rest of the body behind `body`
  std::vector<std::pair<std::string, std::string>> fields{};  // additional header fields
  Piece piece{};                                              // set while the request is not complete
  bool postponed = false;                                     // no answer: the request must be sent again in its turn
  bool halts = false;                                         // the request has halted axes
};

}  // namespace servodrome::api
