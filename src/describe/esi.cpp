#include <algorithm>
#include <fmt/format.h>
#include <iterator>

#include "describe/description.hpp"
#include "describe/esi_dictionary.hpp"
#include "describe/words.hpp"
#include "describe/xml.hpp"
#include "ethercat/esc/esc.hpp"
#include "ethercat/sii/defaults.hpp"

// Names and order of the elements are those of ETG.2000; tests/data/esi.xsd contains them as a schema.
namespace servodrome::describe {
namespace {

using namespace etg2000;  // NOLINT(google-build-using-namespace)
using dictionary::Entry;

constexpr std::string_view schema_version = "1.14";  // of ETG.2000 1.0.10

// ---- Process data ----

void put_channels(Xml& xml, const ethercat::Profile& profile, const ethercat::Defaults& defaults) {
  for (const char* use : {"Outputs", "Inputs", "MBoxState"}) xml.leaf("Fmmu", use);
  constexpr std::string_view uses[] = {"", "MBoxOut", "MBoxIn", "Outputs", "Inputs"};
  for (const ethercat::SyncManagerChannel& channel : ethercat::sync_manager_channels(profile, defaults)) {
    xml.leaf("Sm", uses[channel.type],
             {{"MinSize", decimal(channel.least_length)},
              {"MaxSize", decimal(channel.greatest_length)},
              {"DefaultSize", decimal(channel.default_length)},
              {"StartAddress", index_text(channel.start)},
              {"ControlByte", hex(channel.control, 2)},
              {"Enable", flag(channel.enabled)}});
  }
}

void put_pdo_entry(Xml& xml, const ethercat::Defaults& defaults, const ethercat::Mapped& mapped) {
  const Entry* object = defaults.find(mapped.index, mapped.sub);
  xml.node("Entry", [&] {
    xml.leaf("Index", index_text(mapped.index));
    if (mapped.index != 0) xml.leaf("SubIndex", decimal(mapped.sub));
    xml.leaf("BitLen", decimal(mapped.bits));
    if (object == nullptr) return;  // a gap
    put_name(xml, object->name);
    Entry mapped_object = *object;
    mapped_object.type = ethercat::mapped_type(*object, mapped.bits);
    xml.leaf("DataType", type_name(mapped_object));
  });
}

void put_pdos(Xml& xml, std::string_view element, const ethercat::PdoDirection& direction,
              const ethercat::Defaults& defaults) {
  for (const Entry& entry : defaults.table) {
    if (!direction.has(entry)) continue;
    const auto content = [&] {
      xml.leaf("Index", index_text(entry.index));
      put_name(xml, entry.name);
      for (unsigned sub = 1; sub <= static_cast<unsigned>(entry.default_value); ++sub) {
        put_pdo_entry(xml, defaults, ethercat::Mapped(defaults.value(entry.index, sub)));
      }
    };
    const std::string fixed = flag(!entry.writable());
    if (defaults.assigned(direction.assignment, entry.index)) {
      xml.node(element, {{"Fixed", fixed}, {"Sm", decimal(direction.sync_manager)}}, content);
    } else {
      xml.node(element, {{"Fixed", fixed}}, content);
    }
  }
}

// ---- Mailbox, clock, memory ----

void put_mailbox(Xml& xml, const ethercat::Profile& profile, const ethercat::Defaults& defaults) {
  xml.node("Mailbox", {{"DataLinkLayer", "1"}}, [&] {
    xml.node("CoE",
             {{"SdoInfo", "1"},
              {"PdoAssign", "1"},
              {"PdoConfig", "1"},
              {"CompleteAccess", flag(profile.complete_access)},
              {"SegmentedSdo", "1"}},
             [&] {
               for (const ethercat::StartUpParameter& command : profile.start_up) {
                 const Entry* entry = defaults.find(command.index, command.sub);
                 if (entry == nullptr) continue;
                 xml.node("InitCmd", [&] {
                   xml.leaf("Transition", command.transition);
                   xml.leaf("Index", index_text(command.index));
                   xml.leaf("SubIndex", decimal(command.sub));
                   xml.leaf("Data", data_of(*entry, command.value));
                   xml.leaf("Comment", command.comment);
                 });
               }
             });
    if (profile.file_access) xml.empty("FoE");
  });
}

void put_dc(Xml& xml, std::span<const ethercat::DcMode> modes) {
  if (modes.empty()) return;
  xml.node("Dc", [&] {
    for (const ethercat::DcMode& mode : modes) {
      xml.node("OpMode", [&] {
        xml.leaf("Name", mode.name);
        xml.leaf("Desc", mode.description);
        xml.leaf("AssignActivate", hex(mode.assign_activate, 4));
        xml.leaf("CycleTimeSync0", decimal(mode.sync0_cycle_ns), {{"Factor", decimal(mode.sync0_factor)}});
        xml.leaf("ShiftTimeSync0", decimal(mode.sync0_shift_ns));
        xml.leaf("CycleTimeSync1", "0", {{"Factor", decimal(mode.sync1_factor)}});
        xml.leaf("ShiftTimeSync1", decimal(mode.sync1_shift_ns));
      });
    }
  });
}

void put_eeprom(Xml& xml, const Description& device) {
  const std::vector<std::uint8_t> image = sii(device);
  const std::span<const std::uint8_t> bytes(image);
  xml.node("Eeprom", [&] {
    xml.leaf("ByteSize", decimal(static_cast<std::int64_t>(image.size())));
    xml.leaf("ConfigData", hex_bytes(bytes.first(ethercat::sii_config_bytes)));
    if (device.ethercat->profile->bootstrap) {
      xml.leaf("BootStrap", hex_bytes(bytes.subspan(ethercat::sii_bootstrap_byte, ethercat::sii_bootstrap_bytes)));
    }
  });
}

void put_info(Xml& xml, const ethercat::SiiDescription& sii) {
  xml.node("Info", [&] {
    if (sii.current_ma != 0) xml.node("Electrical", [&] { xml.leaf("EBusCurrent", decimal(sii.current_ma)); });
    xml.node("EtherCATController", [&] {
      xml.leaf("DpramSize", decimal(ethercat::Esc::memory_size - 0x1000));  // process data RAM
      xml.leaf("SmCount", decimal(ethercat::Esc::sync_managers));
      xml.leaf("FmmuCount", decimal(ethercat::Esc::fmmus));
    });
    xml.leaf("StationAliasSupported", "REGISTER_SUPPORT");
    xml.leaf("IdentificationReg134", "1");
  });
}

void put_device(Xml& xml, const Description& device) {
  const ethercat::Profile& profile = *device.ethercat->profile;
  const ethercat::SiiDescription& sii = device.ethercat->sii;
  const ethercat::Defaults defaults{device.table};
  xml.node("Device", {{"Physics", "YY"}}, [&] {
    xml.leaf("Type", sii.order,
             {{"ProductCode", hex(sii.product_code, 8)}, {"RevisionNo", hex(sii.revision_number, 8)}});
    put_name(xml, sii.name);
    if (!device.file.description.empty()) {
      xml.leaf("Comment", device.file.description, {{"LcId", std::string(english_lcid)}});
    }
    if (!device.url.empty()) xml.leaf("URL", device.url, {{"LcId", std::string(english_lcid)}});
    put_info(xml, sii);
    xml.leaf("GroupType", sii.group);
    put_profile(xml, device, profile, defaults);
    put_channels(xml, profile, defaults);
    put_pdos(xml, "RxPdo", ethercat::rx_pdos, defaults);
    put_pdos(xml, "TxPdo", ethercat::tx_pdos, defaults);
    put_mailbox(xml, profile, defaults);
    put_dc(xml, sii.dc_modes);
    put_eeprom(xml, device);
  });
}

// Objects of the bus: without local objects, which only the service port sees, and with the identity of the model.
std::vector<Entry> table_of_bus(const Description& device) {
  std::vector<Entry> table;
  std::copy_if(device.table.begin(), device.table.end(), std::back_inserter(table),
               [](const Entry& entry) { return !entry.local; });
  const ethercat::SiiDescription& sii = device.ethercat->sii;
  const std::uint32_t nameplate[] = {sii.vendor_id, sii.product_code, sii.revision_number};
  for (Entry& entry : table) {
    if (entry.index == 0x1018 && entry.sub >= 1 && entry.sub <= 3) entry.default_value = nameplate[entry.sub - 1];
  }
  return table;
}

// One size of the product: the same device with another identity.
void put_model(Xml& xml, const Description& device, const ethercat::SiiDescription& sii) {
  Description model = device;
  model.ethercat->sii = sii;
  const std::vector<Entry> table = table_of_bus(model);
  model.table = table;
  put_device(xml, model);
}

}  // namespace

std::vector<std::uint8_t> sii(const Description& device) {
  if (!device.ethercat) return {};
  std::vector<std::uint8_t> image(device.ethercat->sii_bytes);
  ethercat::write_sii_image(device.ethercat->sii, *device.ethercat->profile, device.table, image);
  return image;
}

std::string esi(const Description& device) {
  if (!device.ethercat) return {};
  const ethercat::SiiDescription& sii = device.ethercat->sii;
  Xml xml;
  xml.node("EtherCATInfo",
           {{"xmlns:xsi", "http://www.w3.org/2001/XMLSchema-instance"},
            {"xsi:noNamespaceSchemaLocation", "EtherCATInfo.xsd"},
            {"Version", std::string(schema_version)}},
           [&] {
             xml.node("Vendor", {{"FileVersion", decimal(device.file.version)}}, [&] {
               xml.leaf("Id", hex(sii.vendor_id, 8));
               put_name(xml, device.vendor_name);
             });
             xml.node("Descriptions", [&] {
               xml.node("Groups", [&] {
                 xml.node("Group", [&] {
                   xml.leaf("Type", sii.group);
                   put_name(xml, sii.group);
                 });
               });
               xml.node("Devices", [&] {
                 put_model(xml, device, sii);
                 for (const ethercat::SiiDescription& other : device.ethercat->other_models) {
                   put_model(xml, device, other);
                 }
               });
             });
           });
  return xml.take();
}

}  // namespace servodrome::describe
