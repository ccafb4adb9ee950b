// A refused access has the right abort code and changes nothing. The same checks on CAN and EtherCAT.
#include "tools/conform/check_tables.hpp"
#include "tools/conform/trial.hpp"

namespace servodrome::master::conform::abort_group {
namespace {

using dictionary::AbortCode;

// An index that the drive does not have: the first absent one of three that the standards and most makers leave unused.
std::uint16_t absent_index(ObjectClient& objects) {
  for (const std::uint16_t index : {std::uint16_t{0x5FFE}, std::uint16_t{0x9FFE}, std::uint16_t{0x0FFE}}) {
    try {
      objects.upload({index, 0});
    } catch (const ObjectError& error) {
      if (!error.answered()) throw;
      return index;
    }
  }
  Trial::skip("it has all of 5FFEh, 9FFEh and 0FFEh, so no missing object is known");
}

void no_object(Trial& trial, int) {
  ObjectClient& objects = trial.subject().services();
  const std::uint16_t index = absent_index(objects);
  trial.expect_refused(fmt::format("read {:04X}h", index), {AbortCode::object_does_not_exist}, [&] {
    objects.upload({index, 0});
  });
  trial.expect_refused(fmt::format("write {:04X}h", index), {AbortCode::object_does_not_exist},
                       [&] { objects.write<std::uint32_t>(index, 0, 1); });
}

void no_sub(Trial& trial, int) {
  ObjectClient& objects = trial.subject().services();
  if (!objects.read_if_present<std::uint8_t>(0x1018)) Trial::skip("it has no 1018h");
  trial.objects().keep({0x6060, 0});
  trial.expect_refused("read 1018h sub 127", {AbortCode::sub_index_does_not_exist}, [&] {
    objects.upload({0x1018, 127});
  });
  trial.expect_refused("read 6041h sub 1", {AbortCode::sub_index_does_not_exist}, [&] { objects.upload({0x6041, 1}); });
  trial.expect_refused("write 6060h sub 1 = 1", {AbortCode::sub_index_does_not_exist},
                       [&] { objects.write<std::int8_t>(0x6060, 1, 1); });
}

void read_only(Trial& trial, int) {
  ObjectClient& objects = trial.subject().services();
  trial.expect_refused("write 6041h = 0", {AbortCode::read_only}, [&] { objects.write<std::uint16_t>(0x6041, 0, 0); });
  if (trial.subject().bus_kind() != buses::modbus) {
    trial.expect_refused("write 1000h = 0", {AbortCode::read_only},
                         [&] { objects.write<std::uint32_t>(0x1000, 0, 0); });
    trial.expect_refused("write 1018h sub 1 = 0", {AbortCode::read_only},
                         [&] { objects.write<std::uint32_t>(0x1018, 1, 0); });
  }
}

// An object that can be written at any time without effect on the axis: the profile velocity.
constexpr std::uint16_t harmless = 0x6081;

template <typename T>
void wrong_length(Trial& trial, AbortCode code) {
  KeptObjects& objects = trial.objects();
  ObjectClient& services = trial.subject().services();
  const auto before = objects.read_if_present<std::uint32_t>(harmless);
  if (!before) Trial::skip("it has no 6081h");
  objects.keep({harmless, 0});
  trial.expect_refused(fmt::format("write {} bytes to 6081h, which has 4", sizeof(T)),
                       {code, AbortCode::length_mismatch},
                       [&] { services.write<T>(harmless, 0, static_cast<T>(*before + 1)); });
  const auto after = objects.read<std::uint32_t>(harmless);
  trial.expect(after == *before, "read 6081h", fmt::format("{}, as before", *before), fmt::format("{}", after));
}

void too_long(Trial& trial, int) { wrong_length<std::uint64_t>(trial, AbortCode::length_too_high); }
void too_short(Trial& trial, int) { wrong_length<std::uint16_t>(trial, AbortCode::length_too_low); }

// Writes values that every drive must refuse: a reserved homing method, a reserved mode.
void value_range(Trial& trial, int) {
  KeptObjects& objects = trial.objects();
  ObjectClient& services = trial.subject().services();
  unsigned looked_at = 0;
  const auto attempt = [&](std::uint16_t index, std::int8_t wrong, const char* what) {
    const auto before = objects.read_if_present<std::int8_t>(index);
    if (!before) return;
    ++looked_at;
    objects.keep({index, 0});
    trial.expect_refused(fmt::format("write {:04X}h = {}, {}", index, wrong, what),
                         {AbortCode::value_invalid, AbortCode::value_too_high, AbortCode::value_too_low},
                         [&] { services.write<std::int8_t>(index, 0, wrong); });
    const auto after = objects.read<std::int8_t>(index);
    trial.expect(after == *before, fmt::format("read {:04X}h", index), fmt::format("{}, as before", *before),
                 fmt::format("{}", after));
  };
  attempt(0x6098, 100, "a reserved homing method");
  attempt(0x6060, 100, "a reserved mode");
  if (looked_at == 0) Trial::skip("it has neither 6098h nor 6060h to read");
}

constexpr std::array rows{
    Check{"abort.no-object", "CiA 301 7.2.4.3.17, table 22; ETG.1000.6 table 41",
          "A missing object is refused with 0602 0000h", Demand::nothing, buses::sdo, no_object},
    Check{"abort.no-sub-index", "CiA 301 table 22; ETG.1000.6 table 41",
          "A missing sub-index is refused with 0609 0011h", Demand::nothing, buses::sdo, no_sub},
    Check{"abort.read-only", "CiA 301 table 22; ETG.1000.6 table 41",
          "A write to a constant is refused with 0601 0002h", Demand::nothing, buses::all, read_only},
    Check{"abort.too-long", "CiA 301 table 22; ETG.1000.6 table 41",
          "Too many bytes are refused with 0607 0012h or 0607 0010h, and change nothing", Demand::nothing, buses::sdo,
          too_long},
    Check{"abort.too-short", "CiA 301 table 22; ETG.1000.6 table 41",
          "Too few bytes are refused with 0607 0013h or 0607 0010h, and change nothing", Demand::nothing, buses::sdo,
          too_short},
    Check{"abort.value-range", "CiA 301 table 22; ETG.1000.6 table 41",
          "A value out of range is refused with 0609 0030h to 0032h, and changes nothing", Demand::nothing, buses::all,
          value_range},
};

}  // namespace

std::span<const Check> checks() { return rows; }

}  // namespace servodrome::master::conform::abort_group
