#pragma once

#include <bit>
#include <cstring>
#include <span>

#include "dictionary/abort_code.hpp"
#include "dictionary/entry.hpp"

namespace servodrome::dictionary {

static_assert(std::endian::native == std::endian::little,
              "values are kept as they travel: little endian (CiA 301 7.1.3)");

class Dictionary;
class Listener;

// The callbacks of an entry's owner for accesses to the entry. nullptr: none.
struct Handlers {
  AbortCode (*check)(Listener& owner, const Entry& entry, std::span<const std::byte> value) = nullptr;
  void (*written)(Listener& owner, const Entry& entry) = nullptr;
  void (*refresh)(Listener& owner, const Entry& entry) = nullptr;
};

// Gets callbacks for accesses to the objects it owns (Entry::owner). Objects without an owner are plain memory.
class Listener {
 public:
  // Before a write is committed, after all checks of the table. `value` is the raw value, little endian.
  virtual AbortCode check(const Entry&, std::span<const std::byte> /*value*/) { return AbortCode::none; }
  // After a value was committed, by any writer (SDO, PDO, bench).
  virtual void written(const Entry&) {}
  // Before a value is read: updates a computed value.
  virtual void refresh(const Entry&) {}
  // The content of a readable DOMAIN without storage.
  virtual std::span<const std::byte> domain(const Entry&) { return {}; }

  // For callers that access an entry repeatedly (process data): callbacks for this entry, which replace check(),
  // written() and refresh() during the life of the device.
  virtual Handlers handlers(const Entry&) {
    return {
        [](Listener& owner, const Entry& entry, std::span<const std::byte> value) { return owner.check(entry, value); },
        [](Listener& owner, const Entry& entry) { owner.written(entry); },
        [](Listener& owner, const Entry& entry) { owner.refresh(entry); }};
  }

 protected:
  ~Listener() = default;
};

// Stands between a bus and the objects and changes the values that pass. The bus then sees a device that is not as it
// should be, as tests of masters need it; the objects and the device that uses them keep the true values.
class View {
 public:
  // A number that the bus is about to read, little endian, after the owner refreshed it. May be changed.
  virtual void show(const Entry& entry, std::span<std::byte> value) = 0;
  // A number that the bus writes, little endian. May be changed. Returns false if the device shall not get it: the
  // write then succeeds without an effect.
  virtual bool take(const Entry& entry, std::span<std::byte> value) = 0;

 protected:
  ~View() = default;
};

// Gets all writes of a bus or of the service port (Dictionary::write), with the value before and after. It does not get
// writes by process data or by the device itself.
class Recorder {
 public:
  // `value` is the present value of the object that is about to be written; empty if it cannot be read. Valid during
  // the call.
  virtual void before(const Entry& entry, std::span<const std::byte> value) = 0;
  // The object was written. Follows `before` of the same entry, unless the write was refused.
  virtual void written(const Entry& entry, std::span<const std::byte> value) = 0;

 protected:
  ~Recorder() = default;
};

// Abort codes for a wrong length; products differ in them.
struct LengthAborts {
  AbortCode too_long = AbortCode::length_too_high;
  AbortCode too_short = AbortCode::length_too_low;
};

// A snapshot of an object's value. Numbers are copied, so that a segmented transfer is consistent; strings and domains
// are references.
struct ReadValue {
  std::array<std::byte, 8> number{};
  std::span<const std::byte> bytes;  // of `number`, or of the object itself

  ReadValue() = default;
  ReadValue(const ReadValue&) = delete;
  ReadValue& operator=(const ReadValue&) = delete;
};

// A device's objects: the table that describes them and the struct that holds them. Does not own either.
class Dictionary {
 public:
  Dictionary(std::span<const Entry> table, std::span<std::byte> objects, LengthAborts length_aborts = {})
      : table_(table), objects_(objects), length_aborts_(length_aborts) {}

  void set_listener(Owner owner, Listener* listener) { listeners_[static_cast<std::size_t>(owner)] = listener; }

  // All accesses of the bus (read, write, PDOs) pass `view` from now on; nullptr: none. Accesses by number() and
  // set_number() do not.
  void set_view(View* view) { view_ = view; }
  View* view() const { return view_; }

  // `recorder` gets each `write` from now on; nullptr: none.
  void set_recorder(Recorder* recorder) { recorder_ = recorder; }
  Recorder* recorder() const { return recorder_; }

  std::span<const Entry> table() const { return table_; }
  const LengthAborts& length_aborts() const { return length_aborts_; }

  // The entry, or nullptr with the reason in `abort` (object or sub-index does not exist).
  const Entry* find(std::uint16_t index, std::uint8_t sub, AbortCode& abort) const;
  const Entry* find(std::uint16_t index, std::uint8_t sub) const {
    AbortCode ignored{};
    return find(index, sub, ignored);
  }

  // Reads the value, as the service port does. Errors: write_only.
  AbortCode read(const Entry& entry, ReadValue& value) const;

  // Checks access, length and range in the order of a CiA 301 server, then calls the owner's check; commits the value
  // and calls the owner's `written`. Nothing changes unless the result is `none`.
  AbortCode write(const Entry& entry, std::span<const std::byte> value);

  // Returns the result that `write` would have for the value, a number or a string, without writing it. It calls the
  // owner's check, so it must not be used for entries whose check has effects (1010h, 1011h).
  AbortCode check(const Entry& entry, std::span<const std::byte> value) const;

  // The part of `check` that the table decides: access, length and range.
  AbortCode check_by_table(const Entry& entry, std::span<const std::byte> value) const;

  // `write` without the access check: for a device's own use and for restoring saved values.
  AbortCode write_any(const Entry& entry, std::span<const std::byte> value);

  // Numbers as int64 (unsigned 64-bit values wrap). A missing object reads as 0.
  std::int64_t number(const Entry& entry) const;
  std::int64_t number(std::uint16_t index, std::uint8_t sub = 0) const;
  AbortCode set_number(std::uint16_t index, std::uint8_t sub, std::int64_t value);

  // Sets the factory values of the areas without callbacks, for use before a device starts.
  void load_defaults(Area areas, std::uint8_t node_id);
  static std::int64_t default_number(const Entry& entry, std::uint8_t node_id) {
    return entry.default_value + (entry.default_adds_node_id ? node_id : 0);
  }

  // The storage of a fixed-size entry, or nullptr; for PDO copies that were checked when they were mapped.
  std::byte* storage(const Entry& entry) const {
    return entry.offset == Field::no_storage ? nullptr : objects_.data() + entry.offset;
  }
  Listener* listener(const Entry& entry) const { return listener(entry.owner); }
  Listener* listener(Owner owner) const { return listeners_[static_cast<std::size_t>(owner)]; }
  AbortCode check_range(const Entry& entry, std::span<const std::byte> value) const;

 private:
  AbortCode check_value(const Entry& entry, std::span<const std::byte> value) const;
  AbortCode check_length_and_range(const Entry& entry, std::span<const std::byte> value) const;
  AbortCode read_object(const Entry& entry, ReadValue& value) const;
  AbortCode write_recorded(const Entry& entry, std::span<const std::byte> value);

  std::span<const Entry> table_;
  std::span<std::byte> objects_;
  LengthAborts length_aborts_;
  View* view_ = nullptr;
  Recorder* recorder_ = nullptr;
  std::array<Listener*, owner_count> listeners_{};
};

// A little-endian number of `type` in `bytes`, sign-extended if the type is signed.
std::int64_t decode_number(Type type, std::span<const std::byte> bytes);
inline std::array<std::byte, 8> encode_number(std::int64_t value) {
  return std::bit_cast<std::array<std::byte, 8>>(value);
}

}  // namespace servodrome::dictionary
