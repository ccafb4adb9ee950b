// CoE: the object dictionary matches its description, and the PDO assignment follows its rules.
#include <algorithm>

#include "tools/conform/check_tables.hpp"
#include "tools/conform/trial.hpp"

namespace servodrome::master::conform::coe_group {
namespace {

using namespace std::chrono_literals;
using dictionary::AbortCode;

CoeClient& coe_of(Trial& trial) {
  trial.subject().leave_operation();
  EthercatSlave& slave = trial.subject().ethercat().slave;
  if (!slave.has_coe()) Trial::skip("it has no CoE");
  slave.to_pre_operational();
  return slave.coe();
}

// Skips the check if the slave has no SDO information.
std::vector<std::uint16_t> objects_of(CoeClient& coe) {
  std::vector<std::uint16_t> all;
  const auto refusal = Trial::refusal_of([&] { all = coe.list(ObjectList::all); });
  if (refusal) Trial::skip("it has no SDO information: " + refusal->text);
  return all;
}

void lists(Trial& trial, int) {
  CoeClient& coe = coe_of(trial);
  const auto all = objects_of(coe);
  const auto lengths = coe.list_lengths();
  trial.expect(lengths[0] == all.size(), "get object list, all objects",
               fmt::format("{} objects, as list 0 says", lengths[0]), fmt::format("{}", all.size()));
  trial.expect(std::is_sorted(all.begin(), all.end()), "get object list, all objects", "in ascending order",
               "not in order");
  for (const std::uint16_t index :
       {std::uint16_t{0x1000}, std::uint16_t{0x1018}, std::uint16_t{0x6040}, std::uint16_t{0x6041}}) {
    const bool there = std::find(all.begin(), all.end(), index) != all.end();
    trial.expect(there, "get object list, all objects", fmt::format("{:04X}h among them", index),
                 there ? "there" : "missing");
  }
}

// Each entry that is described as readable can be read, and its value has the described size.
void descriptions(Trial& trial, int) {
  CoeClient& coe = coe_of(trial);
  unsigned entries = 0;
  for (const std::uint16_t index : objects_of(coe)) {
    const ObjectDescription object = coe.describe(index);
    for (unsigned sub = 0; sub <= object.highest_sub; ++sub) {
      const ObjectAddress address{index, static_cast<std::uint8_t>(sub)};
      EntryDescription entry;
      if (Trial::refusal_of([&] { entry = coe.describe(address); })) continue;  // a gap in the sub-indices
      ++entries;
      const bool readable = (entry.access & 0x0001) != 0;  // readable in PREOP
      if (!readable) {
        if ((entry.access & entry_access::write) != 0 && (entry.access & entry_access::read) == 0) {
          const auto refusal = Trial::refusal_of([&] { coe.upload(address); });
          if (!refusal || refusal->code != AbortCode::write_only) {
            trial.expect(false, fmt::format("read {}, described as write-only", master::text_of(address)),
                         "refused with " + text_of(AbortCode::write_only), text_of(refusal));
          }
        }
        continue;
      }
      std::vector<std::byte> value;
      const auto refusal = Trial::refusal_of([&] { value = coe.upload(address); });
      const bool text = entry.type >= 9 && entry.type <= 15;  // strings and domains have no fixed size
      const std::size_t bytes = (entry.bits + 7U) / 8U;
      const bool right = !refusal && (text || value.size() == bytes);
      if (!right) {
        trial.expect(false, fmt::format("read {}, described with {} bits", master::text_of(address), entry.bits),
                     fmt::format("{} bytes", bytes), refusal ? refusal->text : fmt::format("{} bytes", value.size()));
      }
    }
  }
  trial.expect(entries > 0, "read each entry that is described", "values as described",
               fmt::format("{} entries", entries));
}

// An entry that is described as read-only cannot be written.
void read_only_entries(Trial& trial, int) {
  CoeClient& coe = coe_of(trial);
  unsigned entries = 0;
  for (const std::uint16_t index : objects_of(coe)) {
    if (index < 0x6000 || index > 0x67FF) continue;
    EntryDescription entry;
    if (Trial::refusal_of([&] { entry = coe.describe(ObjectAddress{index, 0}); })) continue;
    if ((entry.access & entry_access::write) != 0 || (entry.access & entry_access::read) == 0 || entry.bits > 32)
      continue;
    ++entries;
    const std::vector<std::byte> zeros((entry.bits + 7U) / 8U);
    const auto refusal = Trial::refusal_of([&] { coe.download({index, 0}, zeros); });
    if (!refusal || refusal->code != AbortCode::read_only) {
      trial.expect(false, fmt::format("write {:04X}h, described as read-only", index),
                   "refused with " + text_of(AbortCode::read_only), text_of(refusal));
    }
  }
  trial.expect(entries > 0, "write each entry of 6000h to 67FFh that is described as read-only", "refused",
               fmt::format("{} entries", entries));
}

void assignment_rules(Trial& trial, int row) {
  CoeClient& coe = coe_of(trial);
  const std::uint16_t index = row == 0 ? rx_assignment : tx_assignment;
  std::uint8_t count = 0;
  if (Trial::refusal_of([&] { count = coe.read<std::uint8_t>(index, 0); }))
    Trial::skip(fmt::format("it has no {:04X}h", index));
  if (count == 0) Trial::skip(fmt::format("{:04X}h is empty", index));
  const auto first = coe.read<std::uint16_t>(index, 1);
  if (Trial::refusal_of([&] { coe.write<std::uint8_t>(index, 0, count); }))
    Trial::skip(fmt::format("{:04X}h is fixed", index));
  trial.expect_refused(fmt::format("write {:04X}h sub 1 while sub 0 is {}", index, count), {},
                       [&] { coe.write<std::uint16_t>(index, 1, first); });
  const auto restore = [&] {
    Trial::refusal_of([&] { coe.write<std::uint8_t>(index, 0, 0); });
    coe.write<std::uint16_t>(index, 1, first);
    coe.write<std::uint8_t>(index, 0, count);
  };
  // Assigns a PDO that does not exist.
  try {
    coe.write<std::uint8_t>(index, 0, 0);
    const auto refusal = Trial::refusal_of([&] {
      coe.write<std::uint16_t>(index, 1, static_cast<std::uint16_t>(row == 0 ? 0x17FE : 0x1BFE));
      coe.write<std::uint8_t>(index, 0, 1);
    });
    trial.expect(refusal.has_value(), fmt::format("assign to {:04X}h a PDO that does not exist", index), "refused",
                 text_of(refusal));
  } catch (const MasterError&) {
    restore();
    throw;
  }
  restore();
}

void assignment_in_operation(Trial& trial, int) {
  trial.objects();
  EthercatSlave& slave = trial.subject().ethercat().slave;
  for (const std::uint16_t index : {rx_assignment, tx_assignment}) {
    std::uint8_t count = 0;
    if (Trial::refusal_of([&] { count = slave.coe().read<std::uint8_t>(index, 0); })) continue;
    trial.expect_refused(fmt::format("write {:04X}h sub 0 = 0 in OP", index), {},
                         [&] { slave.coe().write<std::uint8_t>(index, 0, 0); });
    const auto after = slave.coe().read<std::uint8_t>(index, 0);
    trial.expect(after == count, fmt::format("read {:04X}h sub 0", index), fmt::format("{}, as before", count),
                 fmt::format("{}", after));
  }
}

constexpr auto information = "ETG.1000.6 5.6.3, SDO information";
constexpr auto assignment = "ETG.1000.6 5.6.7.4, ETG.1020 12";

constexpr std::array rows{
    Check{"coe.object-list", information,
          "The list of objects has the reported length, is sorted, and contains the mandatory objects", Demand::nothing,
          buses::ethercat, lists},
    Check{"coe.descriptions", information, "Each entry can be read as it is described", Demand::nothing,
          buses::ethercat, descriptions},
    Check{"coe.read-only", information, "Objects described as read-only cannot be written", Demand::nothing,
          buses::ethercat, read_only_entries},
    Check{"coe.rx-assignment", assignment, "1C12h can be changed by its procedure only", Demand::nothing,
          buses::ethercat, assignment_rules, 0},
    Check{"coe.tx-assignment", assignment, "1C13h can be changed by its procedure only", Demand::nothing,
          buses::ethercat, assignment_rules, 1},
    Check{"coe.assignment-in-operation", assignment, "The assignment cannot be changed in OP", Demand::nothing,
          buses::ethercat, assignment_in_operation},
};

}  // namespace

std::span<const Check> checks() { return rows; }

}  // namespace servodrome::master::conform::coe_group
