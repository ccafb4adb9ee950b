#pragma once

#include <cstring>
#include <optional>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include "links/time.hpp"
#include "master/emergency.hpp"
#include "master/error.hpp"
#include "master/object_address.hpp"

namespace servodrome::master {

using links::Time;

// An access to an object failed: the drive refused it or did not answer.
class ObjectError : public MasterError {
 public:
  ObjectError(std::string happened, std::string where, std::string remedy, bool object_is_absent, bool answered = true)
      : MasterError(std::move(happened), std::move(where), std::move(remedy)),
        object_is_absent_(object_is_absent),
        answered_(answered) {}

  // The drive does not have the object, or does not offer it on this bus.
  bool object_is_absent() const { return object_is_absent_; }
  // False: the drive did not answer, so a write may or may not have taken effect.
  bool answered() const { return answered_; }

 private:
  bool object_is_absent_;
  bool answered_;
};

// Access to the objects of one drive, the same on every bus. One access at a time. All calls throw ObjectError,
// also if a value has more bytes than requested; MasterError if the link is lost.
class ObjectClient {
 public:
  virtual ~ObjectClient() = default;

  // The value as the drive sends it, little endian.
  virtual std::vector<std::byte> upload(ObjectAddress object) = 0;
  virtual void download(ObjectAddress object, std::span<const std::byte> data) = 0;

  // Groups `objects` (by their positions in the list) into sets that one request can read. The default is one set for
  // each object.
  virtual std::vector<std::vector<std::size_t>> read_together(std::span<const ObjectAddress> objects) const;
  // Reads the values of one such set.
  virtual std::vector<std::vector<std::byte>> upload_together(std::span<const ObjectAddress> objects);

  // False if the answer to the last upload() did not contain the size. CANopen allows this in an expedited answer (CiA
  // 301 7.2.4.3.6): it has four bytes, and the value is in the first ones.
  virtual bool size_is_known() const { return true; }

  // From now on an access without answer fails after `longest`, without a retry. nullopt: after the client's own
  // timeout and retries. Clients that have no timeout ignore it.
  void limit_wait(std::optional<Time> longest) {
    has_limited_wait_ = longest.has_value();
    set_wait_limit(longest);
  }
  bool has_limited_wait() const { return has_limited_wait_; }

  // Time on the bus's clock.
  virtual Time now() const = 0;
  // Waits for `span` and keeps the bus running.
  virtual void wait(Time span) = 0;

  // Node-ID, station address or position on the bus, or unit.
  virtual std::uint16_t address() const = 0;
  // Link and address, for error messages.
  virtual std::string where() const = 0;
  // The last emergency message of the drive; nullopt on a bus that has no such messages.
  virtual std::optional<Emergency> latest_emergency() { return std::nullopt; }

  // Integers and floating-point numbers. If the drive sends fewer bytes than T has, the value is sign- or
  // zero-extended; more bytes are an error if size_is_known().
  template <typename T>
  requires std::is_arithmetic_v<T> T read(std::uint16_t index, std::uint8_t sub = 0) {
    std::vector<std::byte> bytes = upload({index, sub});
    if (!size_is_known() && bytes.size() > sizeof(T)) bytes.resize(sizeof(T));
    check_size(bytes, sizeof(T), {index, sub});
    const bool negative = std::is_signed_v<T> && !bytes.empty() && std::to_integer<unsigned>(bytes.back()) >= 0x80;
    T value{};
    std::memset(&value, negative ? 0xFF : 0, sizeof value);
    if (!bytes.empty()) std::memcpy(&value, bytes.data(), bytes.size());
    return value;
  }
  template <typename T>
  requires std::is_arithmetic_v<T>
  void write(std::uint16_t index, std::uint8_t sub, std::type_identity_t<T> value) {
    download({index, sub}, std::as_bytes(std::span(&value, 1)));
  }
  // A VISIBLE_STRING, without trailing zeros.
  std::string read_text(std::uint16_t index, std::uint8_t sub = 0);

  // The value; nullopt if the drive does not have the object.
  template <typename T>
  std::optional<T> read_if_present(std::uint16_t index, std::uint8_t sub = 0) {
    try {
      return read<T>(index, sub);
    } catch (const ObjectError& error) {
      if (error.object_is_absent()) return std::nullopt;
      throw;
    }
  }

 private:
  virtual void set_wait_limit(std::optional<Time> /*longest*/) {}
  void check_size(const std::vector<std::byte>& bytes, std::size_t at_most, ObjectAddress object) const;

  bool has_limited_wait_ = false;
};

// Limits the wait of a client while it exists.
class LimitedWait {
 public:
  LimitedWait(ObjectClient& objects, Time longest) : objects_(objects) { objects_.limit_wait(longest); }
  ~LimitedWait() { objects_.limit_wait(std::nullopt); }
  LimitedWait(const LimitedWait&) = delete;
  LimitedWait& operator=(const LimitedWait&) = delete;

 private:
  ObjectClient& objects_;
};

}  // namespace servodrome::master
