#pragma once

#include <span>

#include "dictionary/dictionary.hpp"
#include "ethercat/slave/profile.hpp"

namespace servodrome::ethercat {

enum class Direction : std::uint8_t { outputs, inputs };

// One mapped object: where its bits lie in the process data and in memory.
struct MappedObject {
  const dictionary::Entry* entry = nullptr;
  std::byte* place = nullptr;  // nullptr: no storage
  dictionary::Listener* owner = nullptr;
  void (*act)(dictionary::Listener& owner, const dictionary::Entry& entry) = nullptr;  // Handlers::written or refresh
  std::uint16_t byte = 0;  // of the process data in which it begins,
  std::uint8_t bit = 0;    // with this bit
  std::uint8_t bits = 0;   // in the process data
  std::uint8_t bytes = 0;  // in memory
  bool plain = true;       // every value is taken
  bool whole = true;       // whole bytes, as many as in memory, where it has a place
  bool tell = false;       // its owner is to be told of this cycle's value
};

// The process data of one sync manager: the PDOs that 1C12h or 1C13h assigns, with their mappings 16xxh or 1Axxh, as a
// list of copies (ETG.1000.6 clauses 5.6.7.4 and 5.6.7.5).
class ProcessImage {
 public:
  ProcessImage(dictionary::Dictionary& dictionary, Direction direction, const Profile& profile,
               std::span<MappedObject> objects)
      : dictionary_(dictionary), direction_(direction), profile_(profile), objects_(objects) {}

  // Reads assignment and mappings. Errors: what the first of them that cannot be served would answer; the image is
  // then empty.
  dictionary::AbortCode resolve();
  std::uint16_t bytes() const { return static_cast<std::uint16_t>((bits_ + 7) / 8); }

  // Outputs into the objects. A value that its object's type, range or owner refuses leaves that object as it was.
  // Owners are told when all values are there, so that a controlword acts with the target that came with it.
  void write_objects(std::span<const std::uint8_t> image);
  // Objects into the inputs. Bits that are not mapped are 0.
  void read_objects(std::span<std::uint8_t> image);

  // Before an SDO writes a mapping entry. 0 is an empty entry; index 0 a gap of so many bits.
  dictionary::AbortCode check_entry(std::uint32_t mapping) const;
  // Before an SDO assigns a PDO.
  dictionary::AbortCode check_pdo(std::uint16_t index) const;
  // Before an SDO sets sub-index 0 of the assignment to `count`: PDOs that are there, each once.
  dictionary::AbortCode check_assignment(unsigned count) const;
  // Before an SDO sets sub-index 0 of a mapping to `count`.
  dictionary::AbortCode check_count(std::uint16_t index, unsigned count) const;

 private:
  dictionary::AbortCode add_pdo(std::uint16_t index);
  std::uint16_t assignment() const { return direction_ == Direction::outputs ? 0x1C12 : 0x1C13; }
  std::uint16_t assigned_pdo(unsigned sub) const {
    return static_cast<std::uint16_t>(dictionary_.number(assignment(), static_cast<std::uint8_t>(sub)));
  }
  dictionary::AbortCode resolve_entry(std::uint32_t mapping, MappedObject& object) const;
  bool store_checked(const MappedObject& object, std::span<const std::uint8_t> image);
  unsigned greatest_bits() const {
    return 8U * (direction_ == Direction::outputs ? profile_.greatest_outputs : profile_.greatest_inputs);
  }

  dictionary::Dictionary& dictionary_;
  Direction direction_;
  const Profile& profile_;
  std::span<MappedObject> objects_;
  std::size_t count_ = 0;
  unsigned bits_ = 0;
};

}  // namespace servodrome::ethercat
