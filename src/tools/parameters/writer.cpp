#include "tools/parameters/writer.hpp"

#include <algorithm>
#include <fmt/format.h>
#include <set>

#include "dictionary/dictionary.hpp"

namespace servodrome::master {
namespace {

using dictionary::Type;

constexpr std::uint16_t rpdo_communication = 0x1400;
constexpr std::uint16_t tpdo_communication = 0x1800;
constexpr std::uint16_t mapping_offset = 0x200;  // from a PDO's communication parameter to its mapping
constexpr std::uint16_t output_assignment = 0x1C12;
constexpr std::uint16_t input_assignment = 0x1C13;
constexpr std::int64_t invalid_bit = std::int64_t{1} << 31;  // bit of a PDO's COB-ID
// Maximum of passes. Each pass brings at least one more value to its target, otherwise the writing ends. No known drive
// has longer chains of dependent values.
constexpr unsigned most_passes = 8;

bool is_communication(std::uint16_t index) {
  return (index >= rpdo_communication && index < 0x1600) || (index >= tpdo_communication && index < 0x1A00);
}
bool is_mapping(std::uint16_t index) {
  return (index >= 0x1600 && index < 0x1800) || (index >= 0x1A00 && index < 0x1C00);
}
bool is_assignment(std::uint16_t index) { return index == output_assignment || index == input_assignment; }

// Finds the value to report. If the drive refuses to activate a list, the cause is an entry that it refused before.
const WantedValues::value_type& culprit(const WantedValues& changes,
                                        const std::map<ObjectAddress, std::string>& refused) {
  const auto found = std::find_if(changes.begin(), changes.end(), [&refused](const auto& one) {
    const ObjectAddress address = one.first;
    const bool counts = address.sub == 0 && (is_mapping(address.index) || is_assignment(address.index));
    return !counts && refused.count(address) != 0;
  });
  return found != changes.end() ? *found : *changes.begin();
}

}  // namespace

std::vector<ObjectAddress> ParameterWriter::written() const {
  std::vector<ObjectAddress> list;
  for (const auto& [address, value] : before_) list.push_back(address);
  return list;
}

std::int64_t ParameterWriter::number(ObjectAddress address, Type type) {
  return dictionary::decode_number(type, read_parameter(objects_, address, type).value_or(std::vector<std::byte>{}));
}

void ParameterWriter::write(ObjectAddress address, Type type, std::vector<std::byte> bytes) {
  if (address.index < 0x2000 && !communication_begun_) {
    communication_begun_ = true;
    if (before_communication_) before_communication_();
  }
  if (before_.count(address) == 0) {
    before_[address] = {type, read_parameter(objects_, address, type).value_or(std::vector<std::byte>{})};
  }
  try {
    objects_.download(address, bytes);
  } catch (const ObjectError& error) {
    if (error.answered()) throw;
    // Either one answer was lost or the bus is lost. Reading the value back shows which; it throws without an answer.
    if (read_parameter(objects_, address, type) != bytes) throw;
  }
}

// Records a refusal instead of throwing, because the write may succeed after another value has changed.
void ParameterWriter::try_to_write(ObjectAddress address, Type type, std::vector<std::byte> bytes) {
  if (progress_) progress_("writing", std::min(done_, of_), of_);
  ++done_;
  try {
    write(address, type, std::move(bytes));
  } catch (const ObjectError& error) {
    if (!error.answered()) throw;
    refused_[address] = error.happened();
  }
}

// A PDO must be invalid while its mapping, transmission type or identifier changes (CiA 301 7.5.2.35 to 7.5.2.38).
void ParameterWriter::switch_off(std::uint16_t communication) {
  const ObjectAddress cob_id{communication, 1};
  const auto now = read_parameter(objects_, cob_id, Type::unsigned32);
  if (!now) return;  // PDOs on EtherCAT have no identifiers
  const std::int64_t number = dictionary::decode_number(Type::unsigned32, *now);
  if ((number & invalid_bit) == 0)
    try_to_write(cob_id, Type::unsigned32, bytes_of(number | invalid_bit, Type::unsigned32));
}

// Writes a list whose sub-index 0 is the number of valid entries: sets it to 0, writes the entries, then activates the
// whole list.
void ParameterWriter::write_counted(std::uint16_t index, const WantedValues& changes, const WantedValues& wanted) {
  const auto first = changes.lower_bound({index, 0});
  if (first == changes.end() || first->first.index != index) return;
  const ObjectAddress count{index, 0};
  const auto wanted_count = wanted.find(count);
  const std::vector<std::byte> final_count = wanted_count != wanted.end()
                                                 ? wanted_count->second.bytes
                                                 : bytes_of(number(count, Type::unsigned8), Type::unsigned8);
  if (number(count, Type::unsigned8) != 0) try_to_write(count, Type::unsigned8, bytes_of(0, Type::unsigned8));
  for (auto change = first; change != changes.end() && change->first.index == index; ++change) {
    if (change->first.sub != 0) try_to_write(change->first, change->second.type, change->second.bytes);
  }
  if (final_count != bytes_of(0, Type::unsigned8)) try_to_write(count, Type::unsigned8, final_count);
}

void ParameterWriter::write_pdos(const WantedValues& changes, const WantedValues& wanted) {
  std::set<std::uint16_t> pdos;  // by the index of the communication parameter
  for (const auto& [address, value] : changes) {
    if (is_communication(address.index)) pdos.insert(address.index);
    if (is_mapping(address.index)) pdos.insert(static_cast<std::uint16_t>(address.index - mapping_offset));
  }
  // PDOs may exchange their identifiers, so all are switched off before the first is switched on again.
  std::map<std::uint16_t, WantedValue> identifiers;
  for (const std::uint16_t pdo : pdos) {
    const auto wanted_id = wanted.find({pdo, 1});
    if (wanted_id != wanted.end()) {
      identifiers[pdo] = wanted_id->second;
    } else if (const auto now = read_parameter(objects_, {pdo, 1}, Type::unsigned32)) {
      identifiers[pdo] = {Type::unsigned32, *now};
    }
    switch_off(pdo);
  }
  for (const std::uint16_t pdo : pdos) {
    for (auto change = changes.lower_bound({pdo, 2}); change != changes.end() && change->first.index == pdo; ++change) {
      try_to_write(change->first, change->second.type, change->second.bytes);
    }
    write_counted(static_cast<std::uint16_t>(pdo + mapping_offset), changes, wanted);
  }
  for (const auto& [pdo, identifier] : identifiers) {
    if (read_parameter(objects_, {pdo, 1}, identifier.type) != identifier.bytes) {
      try_to_write({pdo, 1}, identifier.type, identifier.bytes);
    }
  }
}

// An assigned PDO must not be mapped (ETG.1000.6 clause 5.6.7.4), so the assignment lists are emptied meanwhile.
void ParameterWriter::write_assignments(const WantedValues& changes, const WantedValues& wanted) {
  const bool maps =
      std::any_of(changes.begin(), changes.end(), [](const auto& one) { return is_mapping(one.first.index); });
  std::map<std::uint16_t, std::vector<std::byte>> counts;
  for (const std::uint16_t index : {output_assignment, input_assignment}) {
    const ObjectAddress count{index, 0};
    const auto now = maps ? read_parameter(objects_, count, Type::unsigned8) : std::nullopt;
    if (!now || *now == bytes_of(0, Type::unsigned8)) continue;
    counts[index] = *now;
    try_to_write(count, Type::unsigned8, bytes_of(0, Type::unsigned8));
  }
  write_pdos(changes, wanted);
  for (const std::uint16_t index : {output_assignment, input_assignment}) {
    const auto kept = counts.find(index);
    const bool changed =
        changes.lower_bound({index, 0}) != changes.lower_bound({static_cast<std::uint16_t>(index + 1), 0});
    if (changed) {
      write_counted(index, changes, wanted);
      const bool counted = wanted.count({index, 0}) != 0;
      if (!counted && kept != counts.end()) try_to_write({index, 0}, Type::unsigned8, kept->second);
    } else if (kept != counts.end()) {
      try_to_write({index, 0}, Type::unsigned8, kept->second);
    }
  }
}

void ParameterWriter::write_plainly(const WantedValues& changes) {
  for (const auto& [address, value] : changes) {
    if (is_communication(address.index) || is_mapping(address.index) || is_assignment(address.index)) continue;
    try_to_write(address, value.type, value.bytes);
  }
}

void ParameterWriter::bring_to(const WantedValues& wanted) {
  WantedValues last_changes;
  for (unsigned pass = 0;; ++pass) {
    WantedValues changes;
    std::size_t looked = 0;
    for (const auto& [address, value] : wanted) {
      if (progress_) progress_(pass == 0 ? "comparing" : "verifying", looked++, wanted.size());
      if (read_parameter(objects_, address, value.type) != value.bytes) changes[address] = value;
    }
    if (changes.empty()) return;
    const auto is_same = [](const auto& a, const auto& b) { return a.first == b.first; };
    const bool stuck = changes.size() == last_changes.size() &&
                       std::equal(changes.begin(), changes.end(), last_changes.begin(), is_same);
    if (pass > 1 && (stuck || pass >= most_passes)) {
      const auto& [address, value] = culprit(changes, refused_);
      const auto words = refused_.find(address);
      const auto has = read_parameter(objects_, address, value.type).value_or(std::vector<std::byte>{});
      throw MasterError(
          words != refused_.end()
              ? fmt::format("the value {} was not accepted: {}", text_of_value(value.bytes, value.type), words->second)
              : fmt::format("{} was written and {} is read back", text_of_value(value.bytes, value.type),
                            text_of_value(has, value.type)),
          fmt::format("{}, {}", objects_.where(), text_of(address)),
          words != refused_.end() ? "see the drive's manual for the permitted values and states of this object"
                                  : "see the drive's manual for conditions that change it");
    }
    last_changes = changes;
    refused_.clear();
    done_ = 0;
    of_ = changes.size();
    write_plainly(changes);
    write_assignments(changes, wanted);
  }
}

}  // namespace servodrome::master
