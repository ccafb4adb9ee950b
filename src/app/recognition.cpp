#include "app/recognition.hpp"

#include <algorithm>
#include <filesystem>
#include <fmt/format.h>
#include <sstream>

#include "app/commands.hpp"

namespace servodrome::app {
namespace {

constexpr std::size_t signature_objects = 6;

bool is_makers_own(const dictionary::Entry& entry) { return entry.index >= 0x2000 && entry.index < 0x6000; }

// At most `count` elements of `all`, evenly spread over it.
template <typename T>
std::vector<T> some_of(const std::vector<T>& all, std::size_t count) {
  if (all.size() <= count) return all;
  std::vector<T> some;
  for (std::size_t i = 0; i < count; ++i) some.push_back(all[i * (all.size() - 1) / (count - 1)]);
  return some;
}

bool has(std::span<const dictionary::Entry> table, const dictionary::Entry& wanted) {
  return std::any_of(table.begin(), table.end(), [&](const dictionary::Entry& entry) {
    return entry.index == wanted.index && entry.sub == wanted.sub &&
           dictionary::size_of(entry.type) == dictionary::size_of(wanted.type);
  });
}

}  // namespace

Descriptions::Descriptions(const std::vector<std::string>& eds, const std::vector<std::string>& esi) {
  try {
    for (const std::string& path : eds) {
      std::istringstream text(describe::read_file(path));
      sheets_.push_back(describe::read_eds(text, path));
    }
    for (const std::string& path : esi) slave_files_.emplace_back(path, describe::read_file(path));
  } catch (const describe::DeviceFileError& error) {
    throw Failure::wrong_use(error.what());
  }
}

std::string Descriptions::name_of(std::uint32_t vendor_id, std::uint32_t product_code) const {
  const auto is_it = [&](const describe::DeviceFile& device) {
    return device.vendor_id == vendor_id && device.product_code == product_code;
  };
  const auto shown = [](const std::string& name, const std::string& path) {
    return fmt::format("{} ({})", name.empty() ? "a device" : name, std::filesystem::path(path).filename().string());
  };
  for (const describe::DeviceFile& sheet : sheets_) {
    if (is_it(sheet)) return shown(sheet.product_name, sheet.file);
  }
  for (const auto& [path, text] : slave_files_) {
    try {
      const describe::EsiDevice device = describe::read_esi(text, path, fmt::format("#x{:08X}", product_code));
      if (is_it(device.device)) return shown(device.name.empty() ? device.type : device.name, path);
    } catch (const describe::DeviceFileError&) {
      // The file describes another device.
    }
  }
  return {};
}

std::vector<const dictionary::Entry*> signature_of(const line::Product& product) {
  std::vector<std::span<const dictionary::Entry>> others;
  for (const line::Product& other : line::all_products()) {
    if (other.name != product.name && other.fieldbus == product.fieldbus) others.push_back(other.describe().table);
  }
  std::vector<const dictionary::Entry*> own;
  const auto table = product.describe().table;
  for (const dictionary::Entry& entry : table) {
    const bool readable = entry.access != dictionary::Access::wo && dictionary::size_of(entry.type) != 0;
    if (!is_makers_own(entry) || !readable) continue;
    const bool elsewhere =
        std::any_of(others.begin(), others.end(), [&](const auto& other) { return has(other, entry); });
    if (!elsewhere) own.push_back(&entry);
  }
  return some_of(own, signature_objects);
}

const line::Product* product_by_objects(master::ObjectClient& objects, line::Fieldbus bus) {
  const line::Product* found = nullptr;
  for (const line::Product& product : line::all_products()) {
    if (product.fieldbus != bus) continue;
    const auto signature = signature_of(product);
    const bool fits = !signature.empty() && std::all_of(signature.begin(), signature.end(), [&](const auto* entry) {
      try {
        return objects.upload({entry->index, entry->sub}).size() == dictionary::size_of(entry->type);
      } catch (const master::ObjectError& error) {
        if (!error.answered()) throw;
        return false;
      }
    });
    if (!fits) continue;
    if (found != nullptr) return nullptr;
    found = &product;
  }
  return found;
}

const line::Product* product_by_registers(master::ModbusClient& client, std::uint8_t unit) {
  const line::Product* found = nullptr;
  for (const line::Product& product : line::all_products()) {
    if (product.serial == nullptr) continue;
    if (found != nullptr && found->serial->registers.data() == product.serial->registers.data()) continue;
    const std::vector<modbus::Register> all(product.serial->registers.begin(), product.serial->registers.end());
    const auto tried = some_of(all, signature_objects);
    const bool fits = !tried.empty() && std::all_of(tried.begin(), tried.end(), [&](const modbus::Register& row) {
      try {
        return client.read_holding_registers(unit, row.address, row.words).size() == row.words;
      } catch (const master::ModbusError& error) {
        if (error.kind() != master::ModbusError::Kind::refused) throw;
        return false;
      }
    });
    if (!fits) continue;
    if (found != nullptr) return nullptr;
    found = &product;
  }
  return found;
}

}  // namespace servodrome::app
