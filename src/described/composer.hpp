#pragma once

#include "described/blueprint.hpp"

namespace servodrome::described {

// The reference drive on one of its fieldbuses. Described objects are connected to its fields.
struct Foundation {
  std::span<const dictionary::Entry> table;
  std::size_t object_bytes = 0;              // size of its objects struct
  std::span<const std::uint16_t> mandatory;  // objects that every device on the bus has
  bool completes_dictionary = false;         // adds all its objects, even those that are not described
};
Foundation can_foundation();
Foundation ethercat_foundation();

// Makes the tables of a blueprint from its description.
class Composer {
 public:
  Composer(Blueprint& blueprint, const Foundation& foundation) : made_(blueprint), foundation_(foundation) {}

  void compose();

 private:
  const dictionary::Entry* reference_of(std::uint16_t index, std::uint8_t sub) const;
  void complete_device();
  void add_entry(const describe::FileEntry& described);
  void set_default(dictionary::Entry& entry, const describe::FileEntry& described, const dictionary::Entry* reference);
  void set_range(dictionary::Entry& entry, const describe::FileEntry& described);
  void set_place(dictionary::Entry& entry, const describe::FileEntry& described, const dictionary::Entry* reference);
  void set_text(dictionary::Entry& entry, const describe::FileEntry& described);
  std::uint32_t take_bytes(std::size_t bytes);
  void settle_mappings();
  void settle_mapping(std::uint16_t index, dictionary::Pdo direction);
  void settle_motion();
  void choose_modes();
  void choose_homing_methods();
  void list_what_is_not_simulated();
  dictionary::Entry* find(std::uint16_t index, std::uint8_t sub);
  std::int64_t default_of(std::uint16_t index, std::uint8_t sub, std::int64_t absent) const;
  void note(const dictionary::Entry& entry, const std::string& what);

  Blueprint& made_;
  Foundation foundation_;
};

}  // namespace servodrome::described
