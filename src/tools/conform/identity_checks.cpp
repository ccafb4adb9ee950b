// Mandatory objects, of every device or of every drive.
#include "tools/conform/check_tables.hpp"
#include "tools/conform/trial.hpp"

namespace servodrome::master::conform::identity_group {
namespace {

template <typename T>
std::optional<T> read(Trial& trial, std::uint16_t index, std::uint8_t sub = 0) {
  return trial.subject().services().read_if_present<T>(index, sub);
}

void device_type(Trial& trial, int) {
  const auto type = read<std::uint32_t>(trial, 0x1000);
  trial.require(type.has_value(), "read 1000h", "the device type", "there is no such object");
  trial.expect((*type & 0xFFFF) == 402, "read 1000h", "low word 0192h, device profile 402",
               fmt::format("{:08X}h", *type));
  const unsigned kind = *type >> 16 & 0xFF;
  trial.expect((kind & 0x07) != 0, "read 1000h", "bits 16 to 18: frequency converter, servo drive or stepper",
               fmt::format("{:08X}h", *type));
}

void error_register(Trial& trial, int) {
  const auto value = read<std::uint8_t>(trial, 0x1001);
  trial.require(value.has_value(), "read 1001h", "the error register", "there is no such object");
  trial.expect((*value & 0x40) == 0, "read 1001h", "bit 6 is reserved, 0", fmt::format("{:02X}h", *value));
}

void identity(Trial& trial, int) {
  const auto highest = read<std::uint8_t>(trial, 0x1018, 0);
  trial.require(highest.has_value(), "read 1018h sub 0", "the identity object", "there is no such object");
  trial.expect(*highest >= 1 && *highest <= 4, "read 1018h sub 0", "1 to 4", fmt::format("{}", *highest));
  const auto vendor = read<std::uint32_t>(trial, 0x1018, 1);
  trial.expect(vendor.value_or(0) != 0, "read 1018h sub 1", "a vendor-ID",
               vendor ? fmt::format("{:08X}h", *vendor) : "absent");
  const bool has_last = read<std::uint32_t>(trial, 0x1018, *highest).has_value();
  trial.expect(has_last, fmt::format("read 1018h sub {}", *highest), "there, as sub 0 says",
               has_last ? "there" : "absent");
}

struct Mandatory {
  std::uint16_t index;
  const char* what;
};
constexpr std::array drive_objects{
    Mandatory{0x6040, "controlword"}, Mandatory{0x6041, "statusword"}, Mandatory{0x6060, "modes of operation"},
    Mandatory{0x6061, "modes of operation display"}, Mandatory{0x6502, "supported drive modes"}};

void drive_object(Trial& trial, int row) {
  const auto& [index, what] = drive_objects[static_cast<std::size_t>(row)];
  const auto value = read<std::uint32_t>(trial, index);
  trial.expect(value.has_value(), fmt::format("read {:04X}h", index), what,
               value ? fmt::format("{:X}h", *value) : "there is no such object");
}

// A wrong signature must be refused. The check does not send the right one, because it would store or restore the
// parameters.
void signature(Trial& trial, int row) {
  const std::uint16_t index = row == 0 ? 0x1010 : 0x1011;
  ObjectClient& objects = trial.subject().services();
  const auto ability = read<std::uint32_t>(trial, index, 1);
  if (!ability) Trial::skip(fmt::format("it has no {:04X}h", index));
  trial.expect((*ability & ~3U) == 0, fmt::format("read {:04X}h sub 1", index),
               "bit 0: on command, bit 1: by itself, others 0", fmt::format("{:08X}h", *ability));
  using dictionary::AbortCode;
  for (const std::uint32_t wrong : {0U, 0x65766174U, 0x12345678U}) {
    trial.expect_refused(fmt::format("write {:04X}h sub 1 = {:08X}h, a wrong signature", index, wrong),
                         {AbortCode::cannot_transfer_or_store, AbortCode::local_control, AbortCode::device_state},
                         [&] { objects.write<std::uint32_t>(index, 1, wrong); });
  }
}

constexpr std::array rows{
    Check{"identity.device-type", "CiA 301 7.5.2, object 1000h; CiA 402-1", "The device type is that of a drive",
          Demand::nothing, buses::sdo, device_type},
    Check{"identity.error-register", "CiA 301 7.5.2, object 1001h", "There is an error register", Demand::nothing,
          buses::sdo, error_register},
    Check{"identity.identity-object", "CiA 301 7.5.2, object 1018h",
          "There is an identity object of the reported length", Demand::nothing, buses::sdo, identity},
    Check{"identity.controlword", "CiA 402-2, object 6040h", "There is a controlword", Demand::nothing, buses::all,
          drive_object, 0},
    Check{"identity.statusword", "CiA 402-2, object 6041h", "There is a statusword", Demand::nothing, buses::all,
          drive_object, 1},
    Check{"identity.mode", "CiA 402-2, object 6060h", "There is an object for the mode of operation", Demand::nothing,
          buses::sdo, drive_object, 2},
    Check{"identity.mode-display", "CiA 402-2, object 6061h", "The mode is displayed", Demand::nothing, buses::sdo,
          drive_object, 3},
    Check{"identity.supported-modes", "CiA 402-2, object 6502h", "The supported modes are reported", Demand::nothing,
          buses::sdo, drive_object, 4},
    Check{"identity.store-signature", "CiA 301 7.5.2, object 1010h", "Only \"save\" stores parameters", Demand::nothing,
          buses::sdo, signature, 0},
    Check{"identity.restore-signature", "CiA 301 7.5.2, object 1011h", "Only \"load\" restores defaults",
          Demand::nothing, buses::sdo, signature, 1},
};

}  // namespace

std::span<const Check> checks() { return rows; }

}  // namespace servodrome::master::conform::identity_group
