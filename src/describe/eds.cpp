#include <algorithm>
#include <fmt/format.h>

#include "describe/description.hpp"
#include "describe/words.hpp"

namespace servodrome::describe {
namespace {

using dictionary::Access;
using dictionary::Entry;
using dictionary::ObjectCode;
using dictionary::Pdo;
using dictionary::Type;

constexpr std::array bit_rates_of_the_standard{10U, 20U, 50U, 125U, 250U, 500U, 800U, 1000U};

// Converts a text to one line of ASCII for an EDS, without the character that begins a comment.
std::string one_line(std::string_view text) {
  std::string line;
  for (const char letter : text) {
    const auto code = static_cast<unsigned char>(letter);
    if ((code & 0xC0) == 0x80) continue;  // further byte of a UTF-8 letter
    line += letter == ';' ? ',' : code >= 0x80 ? '?' : code < 0x20 || code == 0x7F ? ' ' : letter;
  }
  return line;
}

class Ini {
 public:
  void section(std::string_view name) {
    if (!text_.empty()) text_ += "\r\n";
    text_ += fmt::format("[{}]\r\n", name);
  }
  void key(std::string_view name, std::string_view value) { text_ += fmt::format("{}={}\r\n", name, one_line(value)); }
  void key(std::string_view name, const char* value) { key(name, std::string_view(value)); }
  void key(std::string_view name, bool value) { key(name, value ? "1" : "0"); }
  void key(std::string_view name, unsigned value) { key(name, fmt::format("{}", value)); }

  std::string take() { return std::move(text_); }

 private:
  std::string text_;
};

std::string ini_hex(unsigned value, int digits) { return fmt::format("0x{:0{}X}", value, digits); }

void put_time(Ini& ini, std::string_view event, const Timestamp& time) {
  const unsigned hour = time.hour % 12 == 0 ? 12 : time.hour % 12;
  ini.key(fmt::format("{}Time", event), fmt::format("{:02}:{:02}{}", hour, time.minute, time.hour < 12 ? "AM" : "PM"));
  ini.key(fmt::format("{}Date", event), fmt::format("{:02}-{:02}-{:04}", time.month, time.day, time.year));
}

void put_file_info(Ini& ini, const FileMetadata& file) {
  ini.section("FileInfo");
  ini.key("FileName", file.name);
  ini.key("FileVersion", unsigned{file.version});
  ini.key("FileRevision", unsigned{file.revision});
  ini.key("EDSVersion", "4.0");
  ini.key("Description", file.description);
  put_time(ini, "Creation", file.created);
  ini.key("CreatedBy", file.created_by);
  put_time(ini, "Modification", file.modified);
  ini.key("ModifiedBy", file.modified_by);
}

// Parameters of PDO mapping (CiA 301 7.5.2.36 and 7.5.2.38).
bool is_mapping(const Entry& entry) {
  return (entry.index >= 0x1600 && entry.index < 0x1800) || (entry.index >= 0x1A00 && entry.index < 0x1C00);
}

bool mapping_can_be_changed(std::span<const Entry> table) {
  return std::any_of(table.begin(), table.end(),
                     [](const Entry& entry) { return is_mapping(entry) && entry.writable(); });
}

void put_device_info(Ini& ini, const Description& device) {
  ini.section("DeviceInfo");
  ini.key("VendorName", device.vendor_name);
  ini.key("VendorNumber", ini_hex(identity(device.table, 1), 8));
  ini.key("ProductName", device.product_name);
  ini.key("ProductNumber", ini_hex(identity(device.table, 2), 8));
  ini.key("RevisionNumber", ini_hex(identity(device.table, 3), 8));
  ini.key("OrderCode", device.order_code);
  for (const unsigned rate : bit_rates_of_the_standard) {
    const auto& rates = device.bit_rates_kbit;
    ini.key(fmt::format("BaudRate_{}", rate), std::find(rates.begin(), rates.end(), rate) != rates.end());
  }
  ini.key("SimpleBootUpMaster", device.simple_boot_up_master);
  ini.key("SimpleBootUpSlave", device.simple_boot_up_slave);
  ini.key("Granularity", mapping_can_be_changed(device.table) ? device.granularity_bits : 0U);
  ini.key("DynamicChannelsSupported", false);  // only for programmable devices (CiA 302)
  ini.key("CompactPDO", false);                // all PDO parameters are listed
  ini.key("GroupMessaging", device.group_messaging);
  ini.key("NrOfRXPDO", count_rpdos(device.table));
  ini.key("NrOfTXPDO", count_tpdos(device.table));
  ini.key("LSS_Supported", device.lss_supported);
}

void put_dummy_usage(Ini& ini, const Description& device) {
  ini.section("DummyUsage");
  for (std::size_t i = 0; i < device.dummy_usage.size(); ++i) {
    ini.key(fmt::format("Dummy{:04}", i + 1), device.dummy_usage[i]);
  }
}

void put_comments(Ini& ini, const std::vector<std::string>& comments) {
  ini.section("Comments");
  ini.key("Lines", static_cast<unsigned>(comments.size()));
  for (std::size_t i = 0; i < comments.size(); ++i) ini.key(fmt::format("Line{}", i + 1), comments[i]);
}

// The three lists of objects (CiA 306-1): mandatory ones of CiA 301, other standardised ones, the manufacturer's.
enum class List { mandatory, optional, manufacturer };

List list_of(std::uint16_t index) {
  if (index == 0x1000 || index == 0x1001 || index == 0x1018) return List::mandatory;
  return dictionary::area_of(index) == dictionary::Area::manufacturer ? List::manufacturer : List::optional;
}

// The access of a mappable object shows the direction: rww is written by an RPDO, rwr is read into a TPDO.
std::string_view access_text(const Entry& entry) {
  if (entry.access != Access::rw) return word(entry.access);
  if (entry.pdo == Pdo::rpdo) return "rww";
  if (entry.pdo == Pdo::tpdo) return "rwr";
  return "rw";
}

void put_value(Ini& ini, std::string_view name, const Entry& entry) {
  ini.key("ParameterName", name);
  ini.key("ObjectType",
          ini_hex(static_cast<unsigned>(entry.type == Type::domain ? ObjectCode::domain : ObjectCode::var), 1));
  ini.key("DataType", ini_hex(static_cast<unsigned>(entry.type), 4));
  ini.key("AccessType", access_text(entry));
  ini.key("DefaultValue", (entry.default_adds_node_id ? "$NODEID+" : "") + default_text(entry));
  if (entry.has_range) {
    ini.key("LowLimit", number_text(entry, entry.minimum));
    ini.key("HighLimit", number_text(entry, entry.maximum));
  }
  if (entry.type != Type::domain) ini.key("PDOMapping", entry.pdo != Pdo::none);  // a DOMAIN has no such key
}

// In the table sub-index 0 has the name of the whole object; its own name depends on what it counts.
std::string_view name_of_sub_index_0(const Entry& entry) {
  if (is_mapping(entry)) return "Number of mapped application objects in PDO";
  return entry.index == 0x1003 ? "Number of errors" : "Highest sub-index supported";
}

// Writes an object with all its sub-indices.
void put_object(Ini& ini, std::span<const Entry> object) {
  const Entry& first = object.front();
  ini.section(fmt::format("{:04X}", first.index));
  if (first.code == ObjectCode::var || first.code == ObjectCode::domain) return put_value(ini, first.name, first);
  ini.key("ParameterName", first.name);
  ini.key("ObjectType", ini_hex(static_cast<unsigned>(first.code), 1));
  ini.key("SubNumber", static_cast<unsigned>(object.size()));
  for (const Entry& entry : object) {
    ini.section(fmt::format("{:04X}sub{:X}", entry.index, entry.sub));
    put_value(ini, entry.sub == 0 ? name_of_sub_index_0(entry) : entry.name, entry);
  }
}

void put_list(Ini& ini, std::string_view name, List list, std::span<const Entry> objects) {
  std::vector<std::uint16_t> indices;
  for (const Entry& entry : objects) {
    const bool begins = indices.empty() || indices.back() != entry.index;
    if (begins && list_of(entry.index) == list) indices.push_back(entry.index);
  }
  ini.section(name);
  ini.key("SupportedObjects", static_cast<unsigned>(indices.size()));
  for (std::size_t i = 0; i < indices.size(); ++i) ini.key(fmt::format("{}", i + 1), ini_hex(indices[i], 4));
  for (std::size_t i = 0; i < objects.size();) {
    const std::size_t count = entries_of_object(objects, i);
    if (list_of(objects[i].index) == list) put_object(ini, objects.subspan(i, count));
    i += count;
  }
}

}  // namespace

std::string eds(const Description& description) {
  const auto table = description.table;
  const auto begin = std::find_if(table.begin(), table.end(), [](const Entry& entry) { return entry.index >= 0x1000; });
  const std::span<const Entry> objects(begin, table.end());

  Ini ini;
  put_file_info(ini, description.file);
  put_device_info(ini, description);
  put_dummy_usage(ini, description);
  put_comments(ini, description.file.comments);
  put_list(ini, "MandatoryObjects", List::mandatory, objects);
  put_list(ini, "OptionalObjects", List::optional, objects);
  put_list(ini, "ManufacturerObjects", List::manufacturer, objects);
  return ini.take();
}

}  // namespace servodrome::describe
