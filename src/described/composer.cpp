#include "described/composer.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <fmt/format.h>
#include <set>

#include "described/binding.hpp"
#include "described/objects.hpp"
#include "products/generic402/servo.hpp"

namespace servodrome::described {

using describe::FileEntry;
using dictionary::Access;
using dictionary::Entry;
using dictionary::ObjectCode;
using dictionary::Owner;
using dictionary::Pdo;
using dictionary::Type;

namespace {

constexpr std::uint32_t string_bytes = 256;   // size of a string or block of bytes without a given length
constexpr std::uint32_t domain_bytes = 4096;  // ... of a DOMAIN

bool is_manufacturers(std::uint16_t index) { return index >= 0x2000 && index < 0x6000; }
// PDO parameters, mappings and assignments are not fields of a struct, since their number depends on the description.
bool is_pdo_object(std::uint16_t index) {
  return (index >= 0x1400 && index < 0x1C00) || index == 0x1C12 || index == 0x1C13;
}
bool is_storage(std::uint16_t index) { return index == 0x1010 || index == 0x1011; }
bool is_plain_number(Type type) { return dictionary::size_of(type) != 0 && type != Type::real32; }

// COB-IDs include the node-ID, but the defaults of some files omit it.
bool needs_node_id(const Entry& reference, std::int64_t value) {
  return reference.default_adds_node_id && value == reference.default_value;
}

// Values for which 0 stops the axis or is no valid ratio. In a data sheet such a 0 means that no value is given.
constexpr auto never_zero = std::to_array<std::uint32_t>({
    0x607200, 0x607300, 0x607500, 0x607600, 0x607F00, 0x608100, 0x608300, 0x608400, 0x608500, 0x608700,
    0x608F01, 0x608F02, 0x609101, 0x609102, 0x609201, 0x609202, 0x609601, 0x609602, 0x609701, 0x609702,
    0x609901, 0x609902, 0x609A00, 0x60C201, 0x60C500, 0x60C600, 0x60E000, 0x60E100,
});
bool is_never_zero(const Entry& entry) { return std::binary_search(never_zero.begin(), never_zero.end(), entry.key()); }

// Speeds and ramps with factory values in the reference drive's units, 131072 per revolution.
constexpr auto motion_values = std::to_array<std::uint32_t>({
    0x608100,
    0x608300,
    0x608400,
    0x608500,
    0x609901,
    0x609902,
    0x609A00,
    0x60A401,
    0x60A402,
    0x60A403,
    0x60A404,
    0x60A405,
    0x60A406,
});
constexpr double reference_units_per_revolution = 131072.0;

}  // namespace

Foundation can_foundation() {
  static constexpr std::uint16_t mandatory[] = {0x1000, 0x1001, 0x1018};
  return {products::generic402::object_table, sizeof(CanObjects), mandatory};
}

Foundation ethercat_foundation() {
  static constexpr std::uint16_t mandatory[] = {0x1000, 0x1001, 0x1018, 0x1C00, 0x1C12, 0x1C13, 0x1C32, 0x1C33};
  return {products::generic402::ethercat_object_table, sizeof(EthercatObjects), mandatory};
}

void Composer::note(const Entry& entry, const std::string& what) {
  made_.notes.push_back(
      fmt::format("{}: {:04X}:{:02X} {}: {}", made_.device.file, entry.index, entry.sub, entry.name, what));
}

const Entry* Composer::reference_of(std::uint16_t index, std::uint8_t sub) const {
  if (is_manufacturers(index)) return nullptr;
  const std::uint32_t key = static_cast<std::uint32_t>(index) << 8 | sub;
  const auto found = std::lower_bound(foundation_.table.begin(), foundation_.table.end(), key,
                                      [](const Entry& entry, std::uint32_t wanted) { return entry.key() < wanted; });
  return found != foundation_.table.end() && found->key() == key ? &*found : nullptr;
}

Entry* Composer::find(std::uint16_t index, std::uint8_t sub) { return const_cast<Entry*>(made_.find(index, sub)); }

std::int64_t Composer::default_of(std::uint16_t index, std::uint8_t sub, std::int64_t absent) const {
  const Entry* entry = made_.find(index, sub);
  return entry != nullptr ? entry->default_value : absent;
}

void Composer::compose() {
  complete_device();
  if (foundation_.completes_dictionary) {
    made_.notes.push_back(
        fmt::format("{}: there is no object dictionary; the reference drive's objects are used", made_.device.file));
  }
  made_.object_bytes = foundation_.object_bytes;
  made_.table.reserve(made_.device.entries.size());
  for (const FileEntry& described : made_.device.entries) add_entry(described);
  settle_mappings();
  made_.policy = products::generic402::policy;
  made_.policy.units = units;
  choose_modes();
  choose_homing_methods();
  settle_motion();
  list_what_is_not_simulated();
}

// Adds the objects that every device has, and the dummies that the file permits in a mapping.
void Composer::complete_device() {
  describe::DeviceFile& device = made_.device;
  if (device.find(0x6040, 0) == nullptr || device.find(0x6041, 0) == nullptr) {
    throw describe::DeviceFileError(device.file, 0, "[6040], [6041]",
                                    "controlword and statusword are not described: this is not a CiA 402 drive",
                                    "give the description of a servo drive");
  }
  std::erase_if(device.entries, [](const FileEntry& entry) { return entry.index < 0x1000; });
  if (device.entries.size() > most_entries) {
    throw describe::DeviceFileError(device.file, 0, "", fmt::format("{} objects are described", device.entries.size()),
                                    fmt::format("a drive has at most {} here", most_entries));
  }
  std::set<std::uint16_t> described;
  for (const FileEntry& entry : device.entries) described.insert(entry.index);
  for (const Entry& entry : foundation_.table) {
    const auto& all = foundation_.mandatory;
    const bool mandatory =
        std::find(all.begin(), all.end(), entry.index) != all.end() ||
        (foundation_.completes_dictionary && !is_pdo_object(entry.index) && !is_manufacturers(entry.index));
    const bool dummy =
        entry.index >= 1 && entry.index <= device.dummy_usage.size() && device.dummy_usage[entry.index - 1U];
    if (!dummy && (!mandatory || described.contains(entry.index))) continue;
    FileEntry& added = device.entries.emplace_back(describe::file_entry_of(entry, entry.name));
    added.default_value = entry.default_value;
    if (dummy) continue;
    const std::optional<std::uint32_t> identity[] = {device.vendor_id, device.product_code, device.revision_number};
    if (entry.index == 0x1018 && entry.sub > 0)
      added.default_value = entry.sub <= 3 ? identity[entry.sub - 1].value_or(0) : 0;
    if (entry.sub == 0 && !foundation_.completes_dictionary) {
      device.notes.push_back(fmt::format("{}: {:04X}h is not described, though every device has it; it was added",
                                         device.file, entry.index));
    }
  }
  std::sort(device.entries.begin(), device.entries.end(),
            [](const FileEntry& a, const FileEntry& b) { return a.key() < b.key(); });
}

std::uint32_t Composer::take_bytes(std::size_t bytes) {
  constexpr std::size_t alignment = sizeof(std::uint64_t);
  const std::size_t place = (made_.object_bytes + alignment - 1) / alignment * alignment;
  made_.object_bytes = place + bytes;
  if (made_.object_bytes > most_object_bytes) {
    throw describe::DeviceFileError(made_.device.file, 0, "",
                                    fmt::format("the objects take more than {} MiB", most_object_bytes >> 20),
                                    "give shorter lengths of strings and blocks of bytes");
  }
  return static_cast<std::uint32_t>(place);
}

void Composer::add_entry(const FileEntry& described) {
  const Entry* reference = reference_of(described.index, described.sub);
  Entry entry = describe::entry_of(described);
  const bool known = reference != nullptr && !is_storage(described.index);
  const bool kept_by_reference = known && reference->writable() ? reference->saved : true;
  entry.saved = described.saved.value_or(entry.access == Access::rw && kept_by_reference && !is_storage(entry.index));
  if (entry.fixed_size()) {
    set_default(entry, described, reference);
    set_range(entry, described);
  }
  set_place(entry, described, reference);
  made_.table.push_back(entry);
}

void Composer::set_default(Entry& entry, const FileEntry& described, const Entry* reference) {
  const bool is_count = entry.sub == 0 && entry.code != ObjectCode::var;
  if (described.default_value) {
    entry.default_value = *described.default_value;
    entry.default_adds_node_id = described.default_adds_node_id;
    if (reference != nullptr && !described.default_adds_node_id && needs_node_id(*reference, entry.default_value)) {
      entry.default_adds_node_id = true;
    }
  } else if (reference != nullptr && !is_count && is_plain_number(entry.type)) {
    entry.default_value = reference->default_value;
    entry.default_adds_node_id = reference->default_adds_node_id;
  }
}

void Composer::set_range(Entry& entry, const FileEntry& described) {
  if (!is_plain_number(entry.type) || dictionary::size_of(entry.type) == 8) return;
  const std::int64_t least = dictionary::minimum_of(entry.type);
  const std::int64_t greatest = dictionary::maximum_of(entry.type);
  entry.minimum = described.minimum.value_or(least);
  entry.maximum = described.maximum.value_or(greatest);
  const bool given = described.minimum || described.maximum;
  // tools write 0 for both if there are no limits
  const bool empty = entry.minimum == 0 && entry.maximum == 0 && entry.default_value != 0;
  const bool is_read = entry.access != Access::wo;  // the default of a write-only object has no meaning
  const bool holds_default = !is_read || (entry.default_value >= entry.minimum && entry.default_value <= entry.maximum);
  entry.has_range = given && !empty && holds_default && !entry.default_adds_node_id;
  if (given && !empty && !holds_default && !entry.default_adds_node_id) {
    note(entry, fmt::format("the default {} is not within {} .. {}; the limits are ignored", entry.default_value,
                            entry.minimum, entry.maximum));
  }
  if (entry.has_range && entry.minimum == least && entry.maximum == greatest) entry.has_range = false;
  if (!entry.has_range) {
    entry.minimum = least;
    entry.maximum = greatest;
  }
}

void Composer::set_text(Entry& entry, const FileEntry& described) {
  if (entry.type == Type::domain && !entry.writable()) {
    entry.owner = Owner::product;  // Binding::domain
    return;
  }
  const auto length = static_cast<std::uint32_t>(described.content.size());
  entry.capacity = described.capacity != 0      ? std::max(described.capacity, length)
                   : !entry.writable()          ? std::max(length, 1U)
                   : entry.type == Type::domain ? domain_bytes
                                                : std::max(length, string_bytes);
  entry.offset = take_bytes(sizeof(std::uint32_t) + entry.capacity);
  if (length != 0) made_.contents[entry.key()] = described.content;
}

void Composer::set_place(Entry& entry, const FileEntry& described, const Entry* reference) {
  if (!entry.fixed_size()) return set_text(entry, described);
  if (is_storage(entry.index) && entry.sub != 0) {
    entry.owner = Owner::communication;  // uses a signature
    return;
  }
  if (is_pdo_object(entry.index) || (reference != nullptr && reference->owner == Owner::communication)) {
    entry.owner = Owner::communication;
  }
  const bool bindable = reference != nullptr && reference->offset != dictionary::Field::no_storage &&
                        !is_pdo_object(entry.index) && entry.index != 0x6502 && is_plain_number(entry.type);
  if (bindable && dictionary::size_of(entry.type) == dictionary::size_of(reference->type)) {
    entry.offset = reference->offset;
    entry.owner = reference->owner;
    return;
  }
  entry.offset = take_bytes(dictionary::size_of(entry.type));
  if (!bindable || entry.index < 0x6000) return;
  entry.owner = Owner::product;
  made_.adapted.push_back({entry.key(), *reference});
}

// ---- PDOs ----

void Composer::settle_mappings() {
  for (const Entry& entry : made_.table) {
    if (entry.sub != 0) continue;
    if (entry.index >= 0x1600 && entry.index < 0x1800) settle_mapping(entry.index, Pdo::rpdo);
    if (entry.index >= 0x1A00 && entry.index < 0x1C00) settle_mapping(entry.index, Pdo::tpdo);
  }
}

// An object in a default mapping is mappable, even if its own description says otherwise.
void Composer::settle_mapping(std::uint16_t index, Pdo direction) {
  Entry& count = *find(index, 0);
  std::int64_t mapped = 0;
  while (mapped < count.default_value && default_of(index, static_cast<std::uint8_t>(mapped + 1), 0) != 0) ++mapped;
  if (mapped != count.default_value) {
    note(count, fmt::format("the count says {} mapped objects, but {} are mapped", count.default_value, mapped));
    count.default_value = mapped;
  }
  for (std::int64_t i = 1; i <= mapped; ++i) {
    const auto mapping = static_cast<std::uint32_t>(default_of(index, static_cast<std::uint8_t>(i), 0));
    const auto object_index = static_cast<std::uint16_t>(mapping >> 16);
    Entry* object = find(object_index, static_cast<std::uint8_t>(mapping >> 8));
    if (object == nullptr) {
      if (object_index > 0x1F) {
        made_.not_simulated.push_back(
            fmt::format("{:04X}h maps {:04X}:{:02X}, which is not described: the PDO stays off", index, object_index,
                        mapping >> 8 & 0xFF));
      }
      continue;
    }
    const auto both = static_cast<unsigned>(object->pdo) | static_cast<unsigned>(direction);
    if (both == static_cast<unsigned>(object->pdo)) continue;
    object->pdo = static_cast<Pdo>(both);
    note(*object, fmt::format("mapped in {:04X}h, so it can be mapped", index));
  }
}

// ---- Motion ----

void Composer::choose_modes() {
  const std::uint32_t reference = made_.policy.modes.supported;
  Entry* supported = find(0x6502, 0);
  if (supported == nullptr) return;
  if (supported->default_value == 0) supported->default_value = reference;  // not given
  const auto described = static_cast<std::uint32_t>(supported->default_value);
  made_.policy.modes.supported = described & reference;
  std::vector<std::string> absent;
  for (unsigned bit = 0; bit < 32; ++bit) {
    if (((described & ~reference) >> bit & 1) == 0) continue;
    absent.push_back(bit < 16 ? fmt::format("{}", bit + 1) : fmt::format("-{}", bit - 15));
  }
  if (!absent.empty()) made_.not_simulated.push_back(fmt::format("modes of operation {}", fmt::join(absent, ", ")));
}

void Composer::choose_homing_methods() {
  const auto all = made_.policy.homing.methods;
  std::vector<std::string> absent;
  for (unsigned sub = 1; sub < 255; ++sub) {
    const Entry* listed = made_.find(0x60E3, static_cast<std::uint8_t>(sub));
    if (listed == nullptr) break;
    const auto number = static_cast<std::int8_t>(listed->default_value);
    const drive::Method* method = drive::find_method(all, number);
    if (method != nullptr) {
      made_.homing_methods.push_back(*method);
    } else if (number != 0) {
      absent.push_back(fmt::format("{}", number));
    }
  }
  if (made_.homing_methods.empty()) {
    made_.homing_methods.assign(all.begin(), all.end());
  }
  if (!absent.empty()) made_.not_simulated.push_back(fmt::format("homing methods {}", fmt::join(absent, ", ")));
  made_.policy.homing.methods = made_.homing_methods;
}

// Replaces zeros that would stop the axis, and converts the reference drive's speeds and ramps to the described units.
void Composer::settle_motion() {
  constexpr std::uint32_t greatest_encoder = 1U << 24;  // plant::Encoder
  const auto increments = static_cast<double>(default_of(0x608F, 1, 0));
  const double counts = increments / static_cast<double>(std::max<std::int64_t>(default_of(0x608F, 2, 1), 1));
  if (counts >= 16 && counts <= greatest_encoder) made_.encoder_counts = static_cast<std::uint32_t>(counts);

  const auto feed = static_cast<double>(default_of(0x6092, 1, 1));
  const double feed_revolutions = static_cast<double>(std::max<std::int64_t>(default_of(0x6092, 2, 1), 1));
  double per_revolution = feed > feed_revolutions ? feed / feed_revolutions : counts >= 16 ? counts : 0.0;
  if (per_revolution == 0.0) per_revolution = reference_units_per_revolution;
  // 60A9h: revolutions per minute or per second.
  const auto si_unit = static_cast<std::uint32_t>(default_of(0x60A9, 0, 0)) & 0x00FFFF00;
  if (si_unit == 0x00B44700) per_revolution = 60.0;
  if (si_unit == 0x00B40300) per_revolution = 1.0;
  const double scale = per_revolution / reference_units_per_revolution;
  const auto scaled = [scale](const Entry& reference, const Entry& as) {
    const bool counts_units = std::binary_search(motion_values.begin(), motion_values.end(), reference.key());
    if (!counts_units) return std::min(reference.default_value, as.maximum);
    const double value = std::round(static_cast<double>(reference.default_value) * scale);
    return std::clamp<std::int64_t>(static_cast<std::int64_t>(std::min(value, 2147483647.0)), 1, as.maximum);
  };
  for (Entry& entry : made_.table) {
    const Entry* reference = reference_of(entry.index, entry.sub);
    if (reference == nullptr || !is_plain_number(entry.type)) continue;
    const FileEntry* described = made_.device.find(entry.index, entry.sub);
    const bool said = described != nullptr && described->default_value;
    const bool unset = entry.default_value == 0 && is_never_zero(entry) && !made_.device.is_configuration;
    if (said && !unset) continue;
    if (!said && !std::binary_search(motion_values.begin(), motion_values.end(), entry.key())) continue;
    if (said && reference->default_value == 0) continue;  // the motor's nameplate: Binding::prepare
    entry.default_value = scaled(*reference, entry);
    if (entry.has_range) entry.default_value = std::max(entry.default_value, entry.minimum);
    if (entry.index == 0x608F || entry.index == 0x6092) entry.default_value = said ? 1 : entry.default_value;
    if (said) note(entry, fmt::format("with 0 the axis could not move; {} is used", entry.default_value));
  }
  made_.implied.clear();
  for (const Entry& reference : foundation_.table) {
    if (reference.offset == dictionary::Field::no_storage || !reference.fixed_size()) continue;
    if (is_pdo_object(reference.index) || made_.find(reference.index, reference.sub) != nullptr) {
      if (!is_manufacturers(reference.index)) continue;
    }
    Entry implied = reference;
    implied.default_value = scaled(reference, reference);
    if (reference.index == 0x6092) implied.default_value = 1;
    made_.implied.push_back(implied);
  }
}

void Composer::list_what_is_not_simulated() {
  std::vector<std::string> kept;
  unsigned makers = 0;
  unsigned other_axes = 0;
  for (const Entry& entry : made_.table) {
    if (entry.sub != 0 || entry.index < 0x2000) continue;
    if (is_manufacturers(entry.index)) {
      ++makers;
    } else if (entry.index >= 0x6800 && entry.index < 0xA000) {
      ++other_axes;
    } else if (reference_of(entry.index, 0) == nullptr) {
      kept.push_back(fmt::format("{:04X}h", entry.index));
    }
  }
  const auto absent = [this](const std::string& what) { made_.not_simulated.push_back(what); };
  if (!kept.empty()) absent(fmt::format("{} (their values are stored, without any effect)", fmt::join(kept, ", ")));
  if (makers != 0)
    absent(fmt::format("{} manufacturer-specific objects, 2000h to 5FFFh (stored, without any effect)", makers));
  if (other_axes != 0)
    absent(fmt::format("{} objects of further axes, 6800h and up (stored, without any effect)", other_axes));
  for (const Entry& entry : made_.table) {
    const bool parameters =
        (entry.index >= 0x1400 && entry.index < 0x1600) || (entry.index >= 0x1800 && entry.index < 0x1A00);
    if (made_.ethercat == nullptr && parameters && entry.sub == 0 && (entry.index & 0x1FF) >= most_pdos) {
      absent(fmt::format("PDO {:04X}h: only {} PDOs in each direction are simulated", entry.index, most_pdos));
    }
  }
}

}  // namespace servodrome::described
