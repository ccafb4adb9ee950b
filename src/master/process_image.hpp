#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <type_traits>

#include "master/object_address.hpp"

namespace servodrome::master {

// Position of an object among the bits of one or more consecutive PDOs.
struct MappedBits {
  unsigned first = 0;
  unsigned count = 0;
};

// An object in the process data, at any bit position.
class ProcessObject {
 public:
  ProcessObject(std::uint8_t* bytes, MappedBits bits) : bytes_(bytes), bits_(bits) {}

  // At most the low 64 bits; sign-extended for signed types.
  template <typename T>
  requires std::is_integral_v<T> T get()
  const {
    std::uint64_t value = raw();
    if (std::is_signed_v<T> && bits_.count < 64 && bits_.count != 0 && (value >> (bits_.count - 1) & 1) != 0) {
      value |= ~std::uint64_t{0} << bits_.count;
    }
    return static_cast<T>(value);
  }
  template <typename T>
  requires std::is_integral_v<T>
  void set(T value) { set_raw(static_cast<std::uint64_t>(value)); }

  std::uint64_t raw() const;
  void set_raw(std::uint64_t value);
  unsigned bits() const { return bits_.count; }

 private:
  std::uint8_t* bytes_;
  MappedBits bits_;
};

// Process data of one drive on any bus. nullopt: the object is not mapped. Results are valid as long as the exchange
// exists.
class ProcessImage {
 public:
  virtual ~ProcessImage() = default;
  virtual std::optional<ProcessObject> output(ObjectAddress object) = 0;
  virtual std::optional<ProcessObject> input(ObjectAddress object) = 0;
  // Link and address, for error messages.
  virtual std::string where() const = 0;
};

}  // namespace servodrome::master
