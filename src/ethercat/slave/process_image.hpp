#pragma once

#include <span>

#include "dictionary/dictionary.hpp"
#include "ethercat/slave/profile.hpp"

namespace servodrome::ethercat {

enum class Direction : std::uint8_t { outputs, inputs };

// One mapped object: the position of its bits in the process data and in memory.
struct MappedObject {
  const dictionary::Entry* entry = nullptr;
  std::byte* place = nullptr;  // nullptr: no storage
  dictionary::Listener* owner = nullptr;
  // Handlers::written (outputs) or refresh (inputs)
  void (*act)(dictionary::Listener& owner, const dictionary::Entry& entry) = nullptr;
  std::uint16_t byte = 0;  // first byte in the process data
  std::uint8_t bit = 0;    // first bit in that byte
  std::uint8_t bits = 0;   // number of bits in the process data
  std::uint8_t bytes = 0;  // number of bytes in memory
  bool plain = true;       // every value is accepted
  bool whole = true;       // whole bytes at a byte boundary, as many as in memory, and there is storage
  bool tell = false;       // call `act` for this cycle's value
};

// The process data of one sync manager: the PDOs that 1C12h or 1C13h assigns and their mappings 16xxh or 1Axxh, as a
// list of copies (ETG.1000.6 clauses 5.6.7.4 and 5.6.7.5).
class ProcessImage {
 public:
  ProcessImage(dictionary::Dictionary& dictionary, Direction direction, const Profile& profile,
               std::span<MappedObject> objects)
      : dictionary_(dictionary), direction_(direction), profile_(profile), objects_(objects) {}

  // Reads assignment and mappings. Returns the error of the first one that is not possible; the image is then empty.
  dictionary::AbortCode resolve();
  std::uint16_t bytes() const { return static_cast<std::uint16_t>((bits_ + 7) / 8); }

  // Copies the outputs into the objects. An object keeps its value if its type, range or owner refuses the new one.
  // Owners are called when all values are stored, so that a controlword acts together with the target of the same
  // frame.
  void write_objects(std::span<const std::uint8_t> image);
  // Copies the objects into the inputs. Unmapped bits are 0.
  void read_objects(std::span<std::uint8_t> image);

  // Checks a mapping entry before an SDO writes it. 0 is an empty entry; an entry with index 0 is a gap with the length
  // of the entry in bits.
  dictionary::AbortCode check_entry(std::uint32_t mapping) const;
  // Checks a PDO before an SDO assigns it.
  dictionary::AbortCode check_pdo(std::uint16_t index) const;
  // Checks before an SDO sets sub-index 0 of the assignment to `count`: all assigned PDOs exist, each only once.
  dictionary::AbortCode check_assignment(unsigned count) const;
  // Checks before an SDO sets sub-index 0 of a mapping to `count`.
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
