#pragma once

#include "dictionary/dictionary.hpp"

namespace servodrome::dictionary {

// Writes the objects of one request as a whole: add() checks and stores each value, commit() then calls the owners, in
// the order of the request. So a controlword acts together with the targets of its request, in any order, as in a PDO.
// Without commit() the destructor gives all objects their old values back, and no owner has noticed the request.
//
// Strings, and objects without storage (commands such as 1010h, whose check acts), are written by commit().
class JointWrite {
 public:
  static constexpr std::size_t capacity = 128;  // objects

  explicit JointWrite(Dictionary& dictionary) : dictionary_(dictionary) {}
  ~JointWrite();
  JointWrite(const JointWrite&) = delete;
  JointWrite& operator=(const JointWrite&) = delete;

  // `value` is little endian and must stay valid; it is exchanged with the old value. Errors: those of
  // Dictionary::write, for strings and objects without storage without the owner's check; out_of_memory for more than
  // `capacity` objects.
  AbortCode add(const Entry& entry, std::span<std::byte> value);

  // Errors: the first refusal of a string or of an object without storage. All other objects are written nevertheless.
  AbortCode commit();

 private:
  struct Item {
    const Entry* entry = nullptr;
    std::span<std::byte> value;  // of a stored object: its old value
  };
  bool is_stored(const Entry& entry) const { return entry.fixed_size() && entry.offset != Field::no_storage; }
  void exchange(const Item& item);
  void tell(const Item& item);

  Dictionary& dictionary_;
  std::array<Item, capacity> items_;
  std::size_t count_ = 0;
};

}  // namespace servodrome::dictionary
