// Reads EtherCAT slave information of makers (ETG.2000): device and PDOs; esi_dictionary_reader.cpp reads the objects.
#include "describe/esi_reader.hpp"

#include <algorithm>
#include <fmt/format.h>
#include <map>
#include <set>

#include "describe/esi_document.hpp"

namespace servodrome::describe {
namespace {

using dictionary::Access;
using dictionary::ObjectCode;
using dictionary::Pdo;
using dictionary::Type;

struct Direction {
  const char* element;
  std::uint16_t assignment;
  std::uint16_t first_mapping;
  Pdo pdo;
  const char* assignment_name;
};
constexpr Direction directions[] = {{"RxPdo", 0x1C12, 0x1600, Pdo::rpdo, "RxPDO assign"},
                                    {"TxPdo", 0x1C13, 0x1A00, Pdo::tpdo, "TxPDO assign"}};

std::uint32_t key_of(std::uint16_t index, std::uint8_t sub) { return std::uint32_t{index} << 8 | sub; }

std::string title_of(const pugi::xml_node& device) {
  return fmt::format("{} ({})", text_of(device.child("Type")), device.child("Type").attribute("ProductCode").value());
}

class EsiReader {
 public:
  EsiReader(const std::string& text, const std::string& file) : document_(text, file) { made_.device.file = file; }

  EsiDevice read(const std::string& which) {
    const pugi::xml_node info = document_.root();
    const pugi::xml_node device = choose(info.child("Descriptions").child("Devices"), which);
    read_identity(info.child("Vendor"), device);
    read_channels(device);
    read_op_modes(device.child("Dc"));
    made_.complete_access = is_set(device.child("Mailbox").child("CoE").attribute("CompleteAccess"));
    std::vector<pugi::xml_node> parts{device};
    if (const pugi::xml_node module = first_module(info, device)) parts.push_back(module);
    EsiDictionaryReader dictionary(document_, adder_);
    for (const pugi::xml_node& part : parts) {
      for (const pugi::xml_node& profile : part.children("Profile")) {
        made_.has_dictionary = dictionary.read(profile.child("Dictionary")) || made_.has_dictionary;
      }
    }
    settle(made_.device);
    for (std::size_t i = 0; i < made_.device.entries.size(); ++i) places_[made_.device.entries[i].key()] = i;
    for (const Direction& direction : directions) read_pdos(parts, direction);
    std::sort(made_.device.entries.begin(), made_.device.entries.end(),
              [](const FileEntry& a, const FileEntry& b) { return a.key() < b.key(); });
    settle(made_.device);
    return std::move(made_);
  }

 private:
  // Finds the wanted device, and the newest of its revisions.
  pugi::xml_node choose(const pugi::xml_node& devices, const std::string& which) {
    std::vector<pugi::xml_node> found;
    std::vector<std::string> titles;
    std::set<std::string> known_titles;
    const auto wanted_code = parse_xml_number(which);
    for (const pugi::xml_node& device : devices.children("Device")) {
      const std::string title = title_of(device);
      if (known_titles.insert(title).second) titles.push_back(title);
      const pugi::xml_node type = device.child("Type");
      const auto code = parse_xml_number(type.attribute("ProductCode").value());
      const auto has_name = [&which](const pugi::xml_node& name) { return text_of(name) == which; };
      const auto names = device.children("Name");
      const bool matches = which.empty() || text_of(type) == which || (wanted_code && wanted_code == code) ||
                           std::any_of(names.begin(), names.end(), has_name);
      if (matches) found.push_back(device);
    }
    if (titles.empty()) document_.refuse(devices, "Devices", "there is no device", "give an ESI file of a drive");
    const auto list = [&titles] {
      constexpr std::size_t most = 20;
      const std::size_t shown = std::min(titles.size(), most);
      return fmt::format("{}{}", fmt::join(titles.begin(), titles.begin() + static_cast<std::ptrdiff_t>(shown), ", "),
                         shown < titles.size() ? fmt::format(" and {} more", titles.size() - shown) : "");
    };
    if (found.empty()) {
      document_.refuse(devices, "Devices", fmt::format("there is no device \"{}\"", which), "the file has " + list());
    }
    const auto code_of = [](const pugi::xml_node& device) {
      return parse_xml_number(device.child("Type").attribute("ProductCode").value());
    };
    const bool one_product = std::all_of(found.begin(), found.end(), [&](const pugi::xml_node& device) {
      return code_of(device) == code_of(found.front());
    });
    if (!one_product) {
      document_.refuse(devices, "Devices", fmt::format("{} devices are described", titles.size()),
                       "choose one by its type or product code: " + list());
    }
    return *std::max_element(found.begin(), found.end(), [](const pugi::xml_node& a, const pugi::xml_node& b) {
      const auto revision = [](const pugi::xml_node& device) {
        return parse_xml_number(device.child("Type").attribute("RevisionNo").value()).value_or(0);
      };
      return revision(a) < revision(b);
    });
  }

  void read_identity(const pugi::xml_node& vendor, const pugi::xml_node& device) {
    const pugi::xml_node type = device.child("Type");
    DeviceFile& made = made_.device;
    made.vendor_id = static_cast<std::uint32_t>(document_.number(vendor.child("Id"), "Vendor Id"));
    made.product_code =
        static_cast<std::uint32_t>(document_.number(type.attribute("ProductCode"), type, "ProductCode"));
    made.revision_number =
        static_cast<std::uint32_t>(parse_xml_number(type.attribute("RevisionNo").value()).value_or(0));
    made.vendor_name = english(vendor, "Name");
    made.product_name = english(device, "Name");
    made.order_code = text_of(type);
    made_.type = made.order_code;
    made_.name = made.product_name;
    made_.group = text_of(device.child("GroupType"));
    // ESI files have no element for this; `servodrome clone` writes this comment.
    made.is_configuration = english(device, "Comment").starts_with("Configuration of one device");
  }

  void read_channels(const pugi::xml_node& device) {
    std::size_t n = 0;
    for (const pugi::xml_node& sm : device.children("Sm")) {
      if (n == made_.channels.size()) break;
      const auto length = [&](const char* name) {
        return static_cast<std::uint16_t>(parse_xml_number(sm.attribute(name).value()).value_or(0));
      };
      made_.channels[n++] = EsiChannel{
          .start = static_cast<std::uint16_t>(document_.number(sm.attribute("StartAddress"), sm, "Sm StartAddress")),
          .least_length = length("MinSize"),
          .greatest_length = length("MaxSize"),
          .default_length = length("DefaultSize")};
    }
    if (n < 2) document_.refuse(device, "Sm", "no mailbox is described", "a drive needs sync managers 0 and 1");
  }

  void read_op_modes(const pugi::xml_node& clock) {
    for (const pugi::xml_node& mode : clock.children("OpMode")) {
      const auto number = [&mode](const char* name) { return parse_xml_number(mode.child_value(name)).value_or(0); };
      const auto factor = [&mode](const char* name) {
        return static_cast<std::int16_t>(parse_xml_number(mode.child(name).attribute("Factor").value()).value_or(0));
      };
      made_.op_modes.push_back({.name = text_of(mode.child("Name")),
                                .description = text_of(mode.child("Desc")),
                                .assign_activate = static_cast<std::uint16_t>(number("AssignActivate")),
                                .sync0_cycle_ns = static_cast<std::uint32_t>(number("CycleTimeSync0")),
                                .sync0_factor = factor("CycleTimeSync0"),
                                .sync0_shift_ns = static_cast<std::int32_t>(number("ShiftTimeSync0")),
                                .sync1_factor = factor("CycleTimeSync1"),
                                .sync1_shift_ns = static_cast<std::int32_t>(number("ShiftTimeSync1"))});
    }
  }

  // The factory module of the first slot, because a modular drive is read as a drive of one axis.
  pugi::xml_node first_module(const pugi::xml_node& info, const pugi::xml_node& device) {
    const pugi::xml_node slots = device.child("Slots");
    const pugi::xml_node slot = slots.child("Slot");
    if (!slot) return {};
    pugi::xml_node ident = slot.child("ModuleIdent");
    for (const pugi::xml_node& one : slot.children("ModuleIdent")) {
      if (is_set(one.attribute("Default"))) ident = one;
    }
    if (slot.next_sibling("Slot")) {
      made_.device.notes.push_back(
          fmt::format("{}: only the first slot is used, with module {}", made_.device.file, text_of(ident)));
    }
    const auto wanted = parse_xml_number(text_of(ident));
    for (const pugi::xml_node& modules : {slots.child("Modules"), info.child("Descriptions").child("Modules")}) {
      for (const pugi::xml_node& module : modules.children("Module")) {
        if (wanted && parse_xml_number(module.child("Type").attribute("ModuleIdent").value()) == wanted) return module;
      }
    }
    return {};
  }

  // ---- PDOs ----

  bool is_known(std::uint16_t index, std::uint8_t sub) const { return places_.contains(key_of(index, sub)); }

  FileEntry& entry(std::uint16_t index, std::uint8_t sub, ObjectCode code, const std::string& object_name) {
    const auto [place, is_new] = places_.try_emplace(key_of(index, sub), made_.device.entries.size());
    if (!is_new) return made_.device.entries[place->second];
    FileEntry made;
    made.index = index;
    made.sub = sub;
    made.code = code;
    made.object_name = object_name;
    return adder_.add(std::move(made));
  }

  // The values of the dictionary, which the PDOs replace.
  void clear_values(std::uint16_t index) {
    for (auto at = places_.lower_bound(key_of(index, 0)); at != places_.end() && at->first >> 8 == index; ++at) {
      made_.device.entries[at->second].default_value = 0;
    }
  }

  void set(std::uint16_t index, std::uint8_t sub, ObjectCode code, const std::string& object_name, Type type,
           std::int64_t value) {
    FileEntry& made = entry(index, sub, code, object_name);
    if (made.name.empty()) {
      made.name = sub == 0 ? "SubIndex 000" : fmt::format("SubIndex {:03}", sub);
      made.type = type;
    }
    made.default_value = value;
  }

  void read_pdos(const std::vector<pugi::xml_node>& parts, const Direction& direction) {
    std::vector<std::uint16_t> assigned;
    std::set<std::uint16_t> excluded;
    constexpr std::size_t most_assigned = 254;
    for (const pugi::xml_node& part : parts) {
      for (const pugi::xml_node& pdo : part.children(direction.element)) {
        const auto index = static_cast<std::uint16_t>(document_.number(pdo.child("Index"), "PDO Index"));
        read_mapping(pdo, index, direction);
        if (!pdo.attribute("Sm")) continue;
        if (excluded.contains(index)) continue;
        if (assigned.size() == most_assigned) {
          document_.refuse(pdo, direction.element, "more than 254 PDOs are assigned", "leave some out");
        }
        assigned.push_back(index);
        for (const pugi::xml_node& exclude : pdo.children("Exclude")) {
          excluded.insert(static_cast<std::uint16_t>(parse_xml_number(text_of(exclude)).value_or(0)));
        }
      }
    }
    const std::uint16_t list = direction.assignment;
    clear_values(list);
    set(list, 0, ObjectCode::array, direction.assignment_name, Type::unsigned8,
        static_cast<std::int64_t>(assigned.size()));
    for (std::size_t i = 0; i < std::max<std::size_t>(assigned.size(), 4); ++i) {
      set(list, static_cast<std::uint8_t>(i + 1), ObjectCode::array, direction.assignment_name, Type::unsigned16,
          i < assigned.size() ? assigned[i] : 0);
    }
  }

  void read_mapping(const pugi::xml_node& pdo, std::uint16_t index, const Direction& direction) {
    const std::string name = english(pdo, "Name");
    const Access access = is_set(pdo.attribute("Fixed")) ? Access::ro : Access::rw;
    clear_values(index);
    const auto put = [&](std::uint8_t sub, Type type, std::int64_t value) {
      const bool is_new = !is_known(index, sub);
      set(index, sub, ObjectCode::record, name, type, value);
      if (is_new) entry(index, sub, ObjectCode::record, name).access = access;
    };
    std::uint8_t count = 0;
    put(0, Type::unsigned8, 0);
    for (const pugi::xml_node& mapped : pdo.children("Entry")) {
      if (count == 64) document_.refuse(mapped, "Entry", "a PDO maps more than 64 objects", "leave some out");
      const auto object = static_cast<std::uint16_t>(document_.number(mapped.child("Index"), "Entry Index"));
      const auto sub = static_cast<std::uint8_t>(parse_xml_number(text_of(mapped.child("SubIndex"))).value_or(0));
      const auto bits = static_cast<std::uint8_t>(document_.number(mapped.child("BitLen"), "Entry BitLen"));
      put(++count, Type::unsigned32,
          static_cast<std::int64_t>(std::uint32_t{object} << 16 | std::uint32_t{sub} << 8 | bits));
      if (object != 0) describe_mapped(mapped, object, sub, bits, direction);
    }
    entry(index, 0, ObjectCode::record, name).default_value = count;
  }

  // Adds an object that only a PDO mentions.
  void describe_mapped(const pugi::xml_node& mapped, std::uint16_t object, std::uint8_t sub, unsigned bits,
                       const Direction& direction) {
    if (is_known(object, sub)) return;
    const std::string name = english(mapped, "Name");
    FileEntry& made = entry(object, sub, sub == 0 ? ObjectCode::var : ObjectCode::record, name);
    made.name = name;
    made.type = type_of_name(text_of(mapped.child("DataType")), bits);
    made.access = direction.pdo == Pdo::rpdo ? Access::rw : Access::ro;
    made.pdo = direction.pdo;
  }

  EsiDocument document_;
  EsiDevice made_;
  EntryAdder adder_{made_.device};
  std::map<std::uint32_t, std::size_t>
      places_;  // of the entries by their keys; these are not sorted while PDOs are read
};

}  // namespace

EsiDevice read_esi(const std::string& text, const std::string& file, const std::string& which) {
  return EsiReader(text, file).read(which);
}

}  // namespace servodrome::describe
