#include <algorithm>
#include <array>
#include <fmt/format.h>
#include <sstream>

#include "describe/words.hpp"
#include "dictionary/dictionary.hpp"
#include "links/number_text.hpp"
#include "studio/commissioning.hpp"
#include "studio/route_names.hpp"
#include "tools/parameters/loader.hpp"

// The PDO mappings of an axis as lists: CiA 301 clauses 7.5.2.35 to 38, and 1C12h and 1C13h of ETG.1000.6. The
// parameter loader changes them: it knows the order of writes and restores everything if the drive refuses.
namespace servodrome::studio {
namespace {

using master::ObjectAddress;
using master::ParameterList;

constexpr std::uint32_t unused_bit = 0x80000000U;  // of a PDO's COB-ID
constexpr std::uint32_t can_id_mask = 0x7FFU;
constexpr std::uint16_t pdos_of_a_direction = 0x200;
constexpr std::uint64_t most_entries = 64;

struct Direction {
  const char* word;
  std::uint16_t communication;
  std::uint16_t mapping;
  std::uint16_t assignment;  // EtherCAT
  dictionary::Pdo mappable;
};
constexpr std::array directions{
    Direction{"receive", 0x1400, 0x1600, 0x1C12, dictionary::Pdo::rpdo},
    Direction{"transmit", 0x1800, 0x1A00, 0x1C13, dictionary::Pdo::tpdo},
};

constexpr std::uint16_t communication_of(const Direction& direction, std::uint16_t mapping) {
  return static_cast<std::uint16_t>(direction.communication + (mapping - direction.mapping));
}

const Direction* direction_of(std::uint16_t mapping) {
  for (const Direction& one : directions) {
    if (mapping >= one.mapping && mapping < one.mapping + pdos_of_a_direction) return &one;
  }
  return nullptr;
}

// A number of a PDO's communication parameter; `per_unit` of its units are one unit of the API's key.
struct CommunicationKey {
  const char* key;
  std::uint8_t sub;
  unsigned per_unit;
};
constexpr std::array communication_keys{
    CommunicationKey{"transmission_type", 2, 1},
    CommunicationKey{"inhibit_time_us", 3, 100},
    CommunicationKey{"event_timer_ms", 5, 1},
    CommunicationKey{"sync_start", 6, 1},
};

// The PDO objects of one axis, from its bus's table.
class PdoTable {
 public:
  explicit PdoTable(Subject& subject) : subject_(subject), table_(subject.table), list_(subject.parameters(true)) {}

  Json view() {
    Json pdos = Json::array();
    Json mappable = Json::object();
    for (const Direction& direction : directions) {
      mappable[direction.word] = mappable_in(direction);
      for (unsigned n = 0; n < pdos_of_a_direction; ++n) {
        const auto mapping = static_cast<std::uint16_t>(direction.mapping + n);
        if (find({mapping, 0}) != nullptr) pdos.push_back(view_of(direction, mapping));
      }
    }
    Json view{{"bus", subject_.node_id ? "can" : "ethercat"}};
    for (const Direction& direction : directions) {
      if (find({direction.assignment, 0}) == nullptr) continue;
      view[direction.word] = assigned(direction);
      view[fmt::format("{}_fixed", direction.word)] = list_.find({direction.assignment, 1}) == nullptr;
    }
    view["pdos"] = std::move(pdos);
    view["mappable"] = std::move(mappable);
    return view;
  }

  // The requested parameters as a parameter file. Throws ApiError.
  master::ParameterFile wanted(const std::string& body_text) {
    BodyReader body(body_text);
    master::ParameterFile file;
    if (body.has("pdos")) {
      const Json& pdos = body.required("pdos");
      if (!pdos.is_array()) wrong("pdos is not a list", "pdos", "write [{\"index\": \"0x1600\", \"objects\": [...]}]");
      for (std::size_t i = 0; i < pdos.size(); ++i) add_pdo(file, pdos[i], fmt::format("pdos[{}]", i));
    }
    for (const Direction& direction : directions) {
      if (body.has(direction.word)) add_assignment(file, direction, body.required(direction.word));
    }
    body.finish();
    std::sort(file.values.begin(), file.values.end(),
              [](const auto& a, const auto& b) { return a.address < b.address; });
    return file;
  }

  // The present values in the drive of the lists in `file`.
  master::ParameterFile before(const master::ParameterFile& file) const {
    master::ParameterFile now;
    for (const master::ParameterValue& value : file.values) {
      if (value.address.sub != 0) continue;
      const std::uint16_t index = value.address.index;
      const auto count = subject_.objects.read<std::uint8_t>(index, 0);
      add(now, {index, 0}, count);
      for (unsigned sub = 1; sub <= count; ++sub) {
        const auto at = static_cast<std::uint8_t>(sub);
        add(now, {index, at}, subject_.objects.read<std::uint32_t>(index, at));
      }
    }
    return now;
  }

 private:
  [[noreturn]] static void wrong(std::string what, std::string where, std::string hint) {
    throw ApiError{422, std::move(what), std::move(where), std::move(hint)};
  }

  const dictionary::Entry* find(ObjectAddress address) const {
    const auto found = std::lower_bound(table_.begin(), table_.end(), address, [](const auto& entry, ObjectAddress at) {
      return ObjectAddress{entry.index, entry.sub} < at;
    });
    const bool is_there = found != table_.end() && ObjectAddress{found->index, found->sub} == address;
    return is_there ? &*found : nullptr;
  }

  // The name of the object, e.g. "Target position"; for a sub-index also the sub-index.
  std::string name_of(ObjectAddress address) const {
    const dictionary::Entry* entry = find(address);
    if (entry == nullptr) return "";
    const dictionary::Entry* object = find({address.index, 0});
    if (address.sub == 0 || object == nullptr) return entry->name;
    return fmt::format("{}.{}", object->name, entry->name);
  }

  Json mapped_view(std::uint32_t entry) const {
    const ObjectAddress address{static_cast<std::uint16_t>(entry >> 16U), static_cast<std::uint8_t>(entry >> 8U)};
    const std::string name = address.index == 0 ? "padding" : name_of(address);
    return {{"object", master::text_of(address)}, {"name", name}, {"bits", entry & 0xFFU}};
  }

  Json mappable_in(const Direction& direction) const {
    Json list = Json::array();
    for (const dictionary::Entry& entry : table_) {
      const bool fits = (static_cast<unsigned>(entry.pdo) & static_cast<unsigned>(direction.mappable)) != 0;
      if (!fits || !entry.fixed_size()) continue;
      const ObjectAddress address{entry.index, entry.sub};
      list.push_back({{"object", master::text_of(address)},
                      {"name", name_of(address)},
                      {"bits", dictionary::size_of(entry.type) * 8U}});
    }
    return list;
  }

  std::uint8_t highest_sub(std::uint16_t index) const {
    std::uint8_t highest = 0;
    for (const dictionary::Entry& entry : table_) {
      if (entry.index == index) highest = std::max(highest, entry.sub);
    }
    return highest;
  }

  Json view_of(const Direction& direction, std::uint16_t mapping) {
    Json pdo{{"index", fmt::format("0x{:04X}", mapping)},
             {"direction", direction.word},
             {"number", mapping - direction.mapping + 1},
             {"fixed", list_.find({mapping, 0}) == nullptr || list_.find({mapping, 1}) == nullptr},
             {"most", highest_sub(mapping)}};
    const std::uint16_t communication = communication_of(direction, mapping);
    if (const auto cob_id = subject_.objects.read_if_present<std::uint32_t>(communication, 1)) {
      pdo["enabled"] = (*cob_id & unused_bit) == 0;
      pdo["can_id"] = *cob_id & can_id_mask;
      for (const CommunicationKey& one : communication_keys) {
        if (find({communication, one.sub}) == nullptr) continue;
        pdo[one.key] = subject_.objects.read<std::uint32_t>(communication, one.sub) * one.per_unit;
      }
    }
    Json objects = Json::array();
    const auto count = subject_.objects.read<std::uint8_t>(mapping, 0);
    for (unsigned sub = 1; sub <= count && sub <= most_entries; ++sub) {
      objects.push_back(mapped_view(subject_.objects.read<std::uint32_t>(mapping, static_cast<std::uint8_t>(sub))));
    }
    pdo["objects"] = std::move(objects);
    return pdo;
  }

  Json assigned(const Direction& direction) {
    Json list = Json::array();
    const auto count = subject_.objects.read<std::uint8_t>(direction.assignment, 0);
    for (unsigned sub = 1; sub <= count; ++sub) {
      const auto pdo = subject_.objects.read<std::uint16_t>(direction.assignment, static_cast<std::uint8_t>(sub));
      list.push_back(fmt::format("0x{:04X}", pdo));
    }
    return list;
  }

  static std::uint32_t hexadecimal(std::string_view text, const char* where) {
    std::string_view digits = text;
    if (digits.starts_with("0x") || digits.starts_with("0X")) digits.remove_prefix(2);
    const auto value = links::number_of_text<std::uint32_t>(digits, 16);
    if (!value || *value > 0xFFFFU) {
      wrong(fmt::format("\"{}\" is not an index", text.substr(0, 40)), where, "write it in hexadecimal: \"0x1600\"");
    }
    return *value;
  }

  std::uint16_t pdo_index(const Json& value, const char* where) const {
    if (!value.is_string()) wrong("a PDO's index is not a string", where, "write it in hexadecimal: \"0x1600\"");
    const auto index = static_cast<std::uint16_t>(hexadecimal(value.get_ref<const std::string&>(), where));
    if (direction_of(index) != nullptr && find({index, 0}) != nullptr) return index;
    wrong(fmt::format("the drive has no PDO {:04X}h", index), where, "GET .../pdos lists them");
  }

  // Reads "607A:00", or "0000:00/8": 8 bits of padding.
  std::uint32_t mapped(const Json& value) const {
    constexpr const char* hint = "write \"INDEX:SUB\" in hexadecimal, or \"0000:00/8\" for 8 bits of padding";
    if (!value.is_string()) wrong("an object to be mapped is not a string", "objects", hint);
    const auto& text = value.get_ref<const std::string&>();
    unsigned index = 0;
    unsigned sub = 0;
    unsigned bits = 0;
    int end = 0;
    // NOLINTNEXTLINE(cert-err34-c): the end is checked, and widths limit the numbers
    const int found = std::sscanf(text.c_str(), "%4x:%2x%n/%3u%n", &index, &sub, &end, &bits, &end);
    if (found < 2 || end != static_cast<int>(text.size()) || bits > 0xFFU) {
      wrong(fmt::format("\"{}\" is not an object", text.substr(0, 40)), "objects", hint);
    }
    if (found < 3) {
      const dictionary::Entry* entry = find({static_cast<std::uint16_t>(index), static_cast<std::uint8_t>(sub)});
      if (entry == nullptr) {
        wrong(fmt::format("the drive has no object {}", text.substr(0, 40)), "objects",
              "GET .../pdos lists what can be mapped; with \"/BITS\" it is sent to the drive nevertheless");
      }
      bits = dictionary::size_of(entry->type) * 8U;
    }
    return static_cast<std::uint32_t>(index) << 16U | static_cast<std::uint32_t>(sub) << 8U | bits;
  }

  // Adds a value with the parameter's type; throws if the drive does not permit writing it.
  void add(master::ParameterFile& file, ObjectAddress address, std::uint64_t number) const {
    const master::Parameter* parameter = list_.find(address);
    if (parameter == nullptr) {
      wrong(fmt::format("{} cannot be written", master::text_of(address)), master::text_of(address),
            "it is fixed in this drive, or the drive does not have it");
    }
    if (const std::int64_t most = dictionary::maximum_of(parameter->type); number > static_cast<std::uint64_t>(most)) {
      wrong(fmt::format("{} is outside {}, 0 .. {}", number, describe::word(parameter->type), most),
            master::text_of(address), "give a number of the object's type");
    }
    const auto bytes = dictionary::encode_number(static_cast<std::int64_t>(number));
    master::ParameterValue value{.address = address, .type = parameter->type, .name = parameter->name};
    value.bytes.assign(bytes.begin(), bytes.begin() + dictionary::size_of(parameter->type));
    file.values.push_back(std::move(value));
  }

  void add_list(master::ParameterFile& file, std::uint16_t index, const std::vector<std::uint32_t>& entries) const {
    const std::uint8_t most = highest_sub(index);
    if (entries.size() > most) {
      wrong(fmt::format("{} entries do not fit: {:04X}h has at most {}", entries.size(), index, most),
            fmt::format("{:04X}h", index), "remove some");
    }
    add(file, {index, 0}, entries.size());
    for (std::size_t i = 0; i < entries.size(); ++i) {
      add(file, {index, static_cast<std::uint8_t>(i + 1)}, entries[i]);
    }
  }

  void add_pdo(master::ParameterFile& file, const Json& part, std::string where) {
    BodyReader pdo(std::move(where), part);
    const std::uint16_t mapping = pdo_index(pdo.required("index"), "index");
    const std::uint16_t communication = communication_of(*direction_of(mapping), mapping);
    if (pdo.has("objects")) {
      const Json& objects = pdo.required("objects");
      if (!objects.is_array()) wrong("objects is not a list", "objects", "write [\"6040:00\", \"607A:00\"]");
      std::vector<std::uint32_t> entries;
      for (const Json& object : objects) entries.push_back(mapped(object));
      add_list(file, mapping, entries);
    }
    const auto can_id = pdo.integer("can_id", can_id_mask);
    const auto enabled = pdo.boolean("enabled");
    if (can_id || enabled) {
      auto cob_id = subject_.objects.read_if_present<std::uint32_t>(communication, 1).value_or(0);
      if (can_id) cob_id = (cob_id & ~can_id_mask) | static_cast<std::uint32_t>(*can_id);
      if (enabled) cob_id = *enabled ? cob_id & ~unused_bit : cob_id | unused_bit;
      add(file, {communication, 1}, cob_id);
    }
    for (const CommunicationKey& one : communication_keys) {
      const auto number = pdo.integer(one.key, std::uint64_t{0xFFFF} * one.per_unit);
      if (!number) continue;
      if (*number % one.per_unit != 0) {
        wrong(fmt::format("{} is {}", one.key, *number), one.key, fmt::format("write a multiple of {}", one.per_unit));
      }
      add(file, {communication, one.sub}, *number / one.per_unit);
    }
    pdo.finish();
  }

  void add_assignment(master::ParameterFile& file, const Direction& direction, const Json& list) const {
    if (!list.is_array()) {
      wrong(fmt::format("{} is not a list", direction.word), direction.word, "write [\"0x1600\", ...]");
    }
    std::vector<std::uint32_t> entries;
    for (const Json& one : list) entries.push_back(pdo_index(one, direction.word));
    add_list(file, direction.assignment, entries);
  }

  Subject& subject_;
  std::span<const dictionary::Entry> table_;
  ParameterList list_;
};

void require_process_data(const Subject& subject) {
  if (subject.has_process_data) return;
  throw ApiError{409, "there are no process data on this bus", subject.objects.where(),
                 "the drive's CAN or EtherCAT port has them"};
}

Json show_pdos(Call& call) {
  Subject subject = subject_of(call);
  require_process_data(subject);
  try {
    return PdoTable(subject).view();
  } catch (const master::MasterError& error) {
    throw api_error(error);
  }
}

Json change_pdos(Call& call) {
  Subject subject = subject_of(call);
  require_process_data(subject);
  PdoTable pdos(subject);
  try {
    const master::ParameterFile file = pdos.wanted(call.body);
    const auto load = [list = subject.parameters(true), node_id = subject.node_id](
                          master::ObjectClient& objects, const master::ParameterFile& values) {
      // The values are for this drive, so the product check is skipped.
      master::load_parameters(objects, values, "body", list, {}, {.node_id = node_id, .force = true});
    };
    if (subject.configure) {
      subject.configure([load, file](master::ObjectClient& objects) { load(objects, file); },
                        [load, before = pdos.before(file)](master::ObjectClient& objects) { load(objects, before); });
    } else {
      load(subject.objects, file);
    }
    return pdos.view();
  } catch (const master::MasterError& error) {
    throw api_error(error);
  }
}

constexpr std::array pdo_table{
    Route{Method::get, "/api/v1/axes/{}/pdos", show_pdos},
    Route{Method::put, "/api/v1/axes/{}/pdos", change_pdos},
};

}  // namespace

api::RouteGroup pdo_routes(Subjects& subjects) { return {pdo_table, &subjects}; }

}  // namespace servodrome::studio
