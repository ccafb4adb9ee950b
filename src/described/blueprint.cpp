#include "described/blueprint.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <fmt/format.h>
#include <fstream>
#include <sstream>

#include "described/composer.hpp"
#include "dictionary/store.hpp"

namespace servodrome::described {

using dictionary::Entry;

const Entry* Blueprint::find(std::uint16_t index, std::uint8_t sub) const {
  const std::uint32_t key = static_cast<std::uint32_t>(index) << 8 | sub;
  const auto found = std::lower_bound(table.begin(), table.end(), key,
                                      [](const Entry& entry, std::uint32_t wanted) { return entry.key() < wanted; });
  return found != table.end() && found->key() == key ? &*found : nullptr;
}

std::shared_ptr<const Blueprint> make_can_blueprint(describe::DeviceFile device, std::string text) {
  auto blueprint = std::make_shared<Blueprint>();
  blueprint->device = std::move(device);
  blueprint->text = std::move(text);
  blueprint->can.lss = blueprint->device.lss_supported;
  Composer(*blueprint, can_foundation()).compose();
  return blueprint;
}

namespace {

// Rule for a mailbox: the greatest length is that of the file, but at least the length that an SDO needs.
ethercat::AreaRule mailbox_rule(const describe::EsiChannel& channel) {
  constexpr std::uint16_t least_mailbox = 34;  // what an SDO needs (ETG.1000.6)
  const std::uint16_t greatest = std::max({channel.greatest_length, channel.default_length, least_mailbox});
  return {channel.start, channel.least_length != 0 ? std::min(channel.least_length, greatest) : least_mailbox,
          greatest};
}

void set_ethercat(EthercatBlueprint& made) {
  const describe::EsiDevice& device = made.described;
  for (const describe::EsiOpMode& mode : device.op_modes) {
    made.dc_modes.push_back({.name = mode.name.c_str(),
                             .description = mode.description.c_str(),
                             .sync0_cycle_ns = mode.sync0_cycle_ns,
                             .sync0_shift_ns = static_cast<std::uint32_t>(mode.sync0_shift_ns),
                             .sync1_shift_ns = static_cast<std::uint32_t>(mode.sync1_shift_ns),
                             .sync1_factor = mode.sync1_factor,
                             .assign_activate = mode.assign_activate,
                             .sync0_factor = mode.sync0_factor});
  }
  made.profile.mailbox_out = mailbox_rule(*device.channels[0]);
  made.profile.mailbox_in = mailbox_rule(*device.channels[1]);
  made.profile.complete_access = device.complete_access;
  if (device.channels[2]) made.profile.outputs_start = device.channels[2]->start;
  if (device.channels[3]) made.profile.inputs_start = device.channels[3]->start;
  made.profile.fit_process_data();
  const describe::DeviceFile& file = device.device;
  made.sii = {.vendor_id = file.vendor_id.value_or(0),
              .product_code = file.product_code.value_or(0),
              .revision_number = file.revision_number.value_or(0),
              .group = device.group.c_str(),
              .order = device.type.c_str(),
              .name = device.name.c_str(),
              .dc_modes = made.dc_modes};
}

}  // namespace

std::shared_ptr<const Blueprint> make_ethercat_blueprint(describe::EsiDevice device) {
  auto blueprint = std::make_shared<Blueprint>();
  blueprint->ethercat = std::make_unique<EthercatBlueprint>();
  blueprint->ethercat->described = std::move(device);
  blueprint->device = blueprint->ethercat->described.device;
  set_ethercat(*blueprint->ethercat);
  Foundation foundation = ethercat_foundation();
  foundation.completes_dictionary = !blueprint->ethercat->described.has_dictionary;
  Composer(*blueprint, foundation).compose();
  return blueprint;
}

std::shared_ptr<const Blueprint> read_blueprint(const std::string& path, const std::string& device) {
  const std::string text = describe::read_file(path);
  // Skip the byte order mark of an encoding.
  constexpr std::string_view blank(" \t\r\n\xEF\xBB\xBF\xFE\xFF\0", 10);
  const std::size_t first = text.find_first_not_of(blank);
  if (first != std::string::npos && text[first] == '<') {
    return make_ethercat_blueprint(describe::read_esi(text, path, device));
  }
  if (!device.empty()) {
    throw describe::DeviceFileError(path, 0, device, "an EDS describes one device", "leave out the device's name");
  }
  std::istringstream stream(text);
  return make_can_blueprint(describe::read_eds(stream, path), text);
}

describe::Description description_of(const Blueprint& blueprint) {
  describe::Description description = describe::description_of(blueprint.device);
  description.table = blueprint.table;
  description.service_table = blueprint.table;
  if (blueprint.ethercat != nullptr) {
    description.ethercat = {&blueprint.ethercat->profile, blueprint.ethercat->sii, ethercat_sii_bytes};
  }
  description.file.name = blueprint.device.file;
  description.file.created_by = "servodrome";
  description.file.modified_by = "servodrome";
  return description;
}

std::uint32_t store_bytes(const Blueprint& blueprint) {
  constexpr std::size_t page = 4096;
  std::size_t bank = sizeof(dictionary::StoreHeader) + 2 * (dictionary::Store::record_overhead + 4);  // includes 1018h
  for (const Entry& entry : blueprint.table) {
    if (!entry.saved) continue;
    bank +=
        dictionary::Store::record_overhead + (entry.fixed_size() ? dictionary::size_of(entry.type) : entry.capacity);
  }
  return static_cast<std::uint32_t>(2 * ((bank + page - 1) / page * page));
}

}  // namespace servodrome::described
