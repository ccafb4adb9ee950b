#pragma once

#include <memory>
#include <vector>

#include "products/can_device.hpp"
#include "products/generic402/ethercat_objects.hpp"
#include "products/generic402/objects.hpp"

// Memory of the objects of a described drive: the objects of the reference drive, which its control code uses, followed
// by all further objects of the description.
namespace servodrome::described {

struct CanObjects : products::generic402::Objects {};
struct EthercatObjects : products::generic402::EthercatObjects {};

// An object of the type Objects at the beginning of a memory of the size given by the composition.
template <typename Objects>
class GrownMemory {
 public:
  explicit GrownMemory(const products::Composition& composition)
      : words_((composition.object_bytes + sizeof(std::uint64_t) - 1) / sizeof(std::uint64_t)) {
    clear();
  }

  Objects& objects() { return *objects_; }
  const Objects& objects() const { return *objects_; }
  std::span<std::byte> bytes() { return std::as_writable_bytes(std::span(words_)); }
  void clear() {
    std::fill(words_.begin(), words_.end(), std::uint64_t{0});
    objects_ = new (words_.data()) Objects{};
  }

 private:
  static_assert(alignof(Objects) <= alignof(std::uint64_t) && std::is_trivially_destructible_v<Objects>);
  std::vector<std::uint64_t> words_;
  Objects* objects_ = nullptr;
};

// Limits: PDOs in each direction, and objects in one PDO.
inline constexpr std::size_t most_pdos = 32;
inline constexpr std::size_t most_mapped = 64;

}  // namespace servodrome::described

namespace servodrome::products {

template <>
class ObjectMemory<described::CanObjects> : public described::GrownMemory<described::CanObjects> {
  using GrownMemory::GrownMemory;
};

template <>
class ObjectMemory<described::EthercatObjects> : public described::GrownMemory<described::EthercatObjects> {
  using GrownMemory::GrownMemory;
};

template <>
struct NodeSizes<described::CanObjects> {
  using Communication =
      canopen::CommunicationObjects<described::most_pdos, described::most_pdos, described::most_mapped, 16>;
};

}  // namespace servodrome::products
