#pragma once

#include <cstdint>
#include <fmt/format.h>
#include <string>

#include "capi/handles.hpp"

// What all functions of servodrome.h do: they make a result of every exception and check their arguments.
namespace servodrome::capi {

using api::ApiError;
using api::Json;

inline constexpr std::int64_t longest_advance_ns = 3'600'000'000'000;  // an hour

inline int result_of(const ApiError& error) {
  return error.status == 404 || error.status == 422 ? SERVODROME_UNKNOWN : SERVODROME_REFUSED;
}

template <typename Act>
int guarded(Act act) noexcept {
  try {
    try {
      return act();
    } catch (const Failure& failure) {
      keep_reason(failure.reason);
      return failure.result;
    } catch (const ApiError& error) {
      keep_reason({{"what", error.what}, {"where", error.where}, {"hint", error.hint}});
      return result_of(error);
    } catch (const std::exception& error) {
      keep_reason({{"what", error.what()}, {"where", "line"}, {"hint", ""}});
      return SERVODROME_FAILED;
    }
  } catch (...) {  // no memory for the reason
    return SERVODROME_FAILED;
  }
}

[[noreturn]] inline void refuse_argument(std::string what, std::string where, std::string hint) {
  throw failure(SERVODROME_BAD_ARGUMENT, std::move(what), std::move(where), std::move(hint));
}

template <typename Pointer>
void require(Pointer* pointer, const char* name) {
  if (pointer == nullptr) refuse_argument("a null pointer", name, "give the address of a value");
}

inline std::int64_t within(std::int64_t value, std::int64_t least, std::int64_t most, const char* name) {
  if (value < least || value > most) {
    refuse_argument(fmt::format("{} is out of range", value), name, fmt::format("give {} .. {}", least, most));
  }
  return value;
}

inline void size_within(std::size_t size, std::size_t least, std::size_t most, const char* name) {
  if (size < least || size > most) {
    refuse_argument(fmt::format("{} is out of range", size), name, fmt::format("give {} .. {}", least, most));
  }
}

template <typename Kind>
int close_item(servodrome_handle handle) {
  return guarded([&] {
    const LockedLine line(handle);
    line.item<Kind>();
    line->items.erase(handle);
    remove_handle(handle);
    return SERVODROME_OK;
  });
}

}  // namespace servodrome::capi
