// Takes any bytes as a file: the first byte selects a slave description, a data sheet (both also as a drive), an
// information memory, a scenario, rules, a line, parameters, a recording, a store, parameters over FoE, or words. The
// sanitizers detect misuse of memory. A file is refused only by the exception or the diagnostics that callers expect;
// a file that is accepted is printed, and its text must give the same content again.
#include <algorithm>
#include <array>
#include <memory>
#include <sstream>

#include "described/can_drive.hpp"
#include "described/ethercat_drive.hpp"
#include "dictionary/table.hpp"
#include "files_words.hpp"
#include "fit/error.hpp"
#include "fit/signals.hpp"
#include "line/axis_address.hpp"
#include "line/line_file.hpp"
#include "master/error.hpp"
#include "master/ethercat/sii_content.hpp"
#include "parsers.hpp"
#include "products/generic402/generic402_ec.hpp"
#include "scenario/parse.hpp"
#include "tools/parameters/file.hpp"

namespace {

using namespace servodrome;
using fuzz::Bytes;
using fuzz::require;
using fuzz::text_of;

// ---- Descriptions of devices ----

void check_entries(const std::vector<describe::FileEntry>& entries) {
  const describe::FileEntry* before = nullptr;
  for (const describe::FileEntry& entry : entries) {
    const bool begins_object = before == nullptr || before->index != entry.index;
    require(before == nullptr || before->key() < entry.key());
    require(!begins_object || entry.sub == 0);
    before = &entry;
  }
}

// The objects of a drive do not overlap beyond its memory.
void check_blueprint(const described::Blueprint& blueprint) {
  require(blueprint.table.size() <= described::most_entries + 1024);
  std::uint32_t before = 0;
  for (const dictionary::Entry& entry : blueprint.table) {
    require(entry.key() > before);
    before = entry.key();
    if (entry.offset == dictionary::Field::no_storage) continue;
    const std::size_t bytes = entry.fixed_size() ? dictionary::size_of(entry.type) : entry.capacity + 4U;
    require(entry.offset + bytes <= blueprint.object_bytes);
  }
}

template <typename Drive>
void switch_on(std::shared_ptr<const described::Blueprint> blueprint) {
  check_blueprint(*blueprint);
  const auto drive = std::make_unique<Drive>(std::move(blueprint), products::Settings{});
  drive->power_on({}, products::Time{0});
}

// A first line that is no XML selects the device of the file.
void read_slave_description(Bytes input) {
  std::string_view text = text_of(input);
  std::string_view which;
  if (!text.starts_with('<')) {
    which = text.substr(0, text.find('\n'));
    text.remove_prefix(std::min(which.size() + 1, text.size()));
  }
  try {
    describe::EsiDevice device = describe::read_esi(std::string(text), "fuzz", std::string(which));
    check_entries(device.device.entries);
    switch_on<described::EthercatDrive>(described::make_ethercat_blueprint(std::move(device)));
  } catch (const describe::DeviceFileError&) {
  }
}

void read_data_sheet_as_drive(Bytes input) {
  std::istringstream text{std::string(text_of(input))};
  try {
    describe::DeviceFile device = describe::read_eds(text, "fuzz");
    check_entries(device.entries);
    switch_on<described::CanDrive>(described::make_can_blueprint(std::move(device)));
  } catch (const describe::DeviceFileError&) {
  }
}

void read_information_memory(Bytes image) {
  const master::SiiContent content = master::parse_sii(image);
  constexpr std::size_t row = 8;  // bytes of a PDO, of its entries and of a sync manager
  std::size_t rows = content.sync_managers.size();
  for (const auto* pdos : {&content.rx_pdos, &content.tx_pdos}) {
    for (const master::Pdo& pdo : *pdos) rows += 1 + pdo.entries.size();
  }
  require(rows * row <= image.size() && content.fmmus.size() <= image.size());
}

// ---- Lines and scenarios ----

void check_diagnostics(const std::vector<line::Diagnostic>& diagnostics, std::string_view text) {
  const auto lines = static_cast<std::size_t>(std::count(text.begin(), text.end(), '\n')) + 1;
  for (const line::Diagnostic& diagnostic : diagnostics) {
    require(!diagnostic.what.empty() && diagnostic.line <= lines && !to_string(diagnostic).empty());
  }
}

void check_scenario(const scenario::ScenarioFile& file, std::string_view text) {
  check_diagnostics(file.diagnostics, text);
  if (!file.diagnostics.empty()) return;
  require(file.scenario.duration > scenario::Time{} && file.scenario.rules.size() <= 256);
  for (const scenario::Rule& rule : file.scenario.rules) {
    require(!rule.word.empty() && rule.chance >= 0 && rule.chance <= 1 && rule.every > 0);
  }
}

void read_scenario(Bytes input) { check_scenario(scenario::parse_scenario(text_of(input), "fuzz"), text_of(input)); }
void read_rules(Bytes input) { check_scenario(scenario::parse_rules(text_of(input), "fuzz"), text_of(input)); }

void read_line(Bytes input) {
  const std::string_view text = text_of(input);
  // The folder of the file does not exist, so that a description that the line names is not found.
  const line::LineFile file = line::parse_line_file(text, "/nowhere/fuzz.toml", line::all_products());
  check_diagnostics(file.diagnostics, text);
  check_diagnostics(file.warnings, text);
  if (!file.diagnostics.empty()) return;
  require(!file.settings.axes.empty() && !line::bus_names(file.settings).empty());
  for (const line::AxisSettings& axis : file.settings.axes) require(axis.product != nullptr);
}

// ---- Parameters ----

void read_parameters(Bytes input) {
  const auto read = [](const std::string& text) {
    std::istringstream in(text);
    return master::ParameterFile::read(in, "fuzz");
  };
  try {
    const master::ParameterFile file = read(std::string(text_of(input)));
    const std::string text = file.text();
    const master::ParameterFile again = read(text);
    require(again.text() == text && again.values.size() == file.values.size());
    for (std::size_t i = 0; i < file.values.size(); ++i) {
      require(again.values[i].bytes == file.values[i].bytes && again.values[i].type == file.values[i].type);
      require(master::bytes_for(file.values[i], std::uint8_t{1}).size() == file.values[i].bytes.size());
    }
  } catch (const master::MasterError&) {
  }
}

// A drive whose parameters are a file of FoE.
struct FileDrive {
  FileDrive() : device(settings_with(medium)) {}
  static products::Settings settings_with(dictionary::Medium& medium) {
    products::Settings settings;
    settings.store = &medium;
    return settings;
  }

  std::array<std::byte, 32768> memory{};
  dictionary::RamMedium medium{memory};
  products::Generic402Ec device;
  products::ParameterFile file{device.dictionary(), device.drive(), &medium};
};

ethercat::FoeError put_file(products::ParameterFile& file, Bytes text, std::size_t packet) {
  ethercat::FoeError error = file.open(products::ParameterFile::name, 0, true);
  std::uint32_t position = 0;
  for (bool last = false; error == ethercat::FoeError::none && !last;) {
    const Bytes piece = fuzz::take_bytes(text, packet);
    last = piece.size() < packet;
    error = file.write(position, piece, last);
    position += static_cast<std::uint32_t>(piece.size());
  }
  require((error == ethercat::FoeError::none) == file.reason().empty());
  return error;
}

std::vector<std::uint8_t> get_file(products::ParameterFile& file) {
  std::vector<std::uint8_t> text(products::ParameterFile::capacity);
  std::size_t count = 0;
  require(file.open(products::ParameterFile::name, 0, false) == ethercat::FoeError::none);
  require(file.read(0, text, count) == ethercat::FoeError::none);
  text.resize(count);
  return text;
}

void write_parameters_over_foe(Bytes input) {
  static FileDrive drive;
  drive.memory.fill(std::byte{0});
  drive.device.power_on({}, products::Time{0});
  const std::vector<std::uint8_t> before = get_file(drive.file);
  const std::size_t packet = 16U + fuzz::take_byte(input);
  if (put_file(drive.file, input, packet) != ethercat::FoeError::none) {
    require(get_file(drive.file) == before);
    return;
  }
  const std::vector<std::uint8_t> after = get_file(drive.file);
  require(put_file(drive.file, after, packet) == ethercat::FoeError::none && get_file(drive.file) == after);
}

// ---- The non-volatile memory of a device ----

struct Objects {
  std::uint32_t heartbeat = 0;
  std::int16_t ranged = 0;
  std::int64_t wide = 0;
  dictionary::Blob<12> text;
  std::uint8_t not_saved = 0;
};

constexpr auto table = dictionary::make_table<[] {
  using namespace dictionary;
  TableBuilder<8> t;
  t.add(number_constant(0x1018, 1, ObjectCode::var, "", Type::unsigned32, 0x123));
  t.add(var(0x1400, "", SERVODROME_FIELD(Objects, heartbeat), Access::rw, Pdo::none, {.saved = true}));
  t.add(var(0x2000, "", SERVODROME_FIELD(Objects, ranged), Access::rw, Pdo::none,
            {.minimum = -100, .maximum = 100, .saved = true}));
  t.add(var(0x2001, "", SERVODROME_FIELD(Objects, text), Access::rw, Pdo::none, {.saved = true}));
  t.add(var(0x2002, "", SERVODROME_FIELD(Objects, not_saved), Access::rw));
  t.add(var(0x6064, "", SERVODROME_FIELD(Objects, wide), Access::ro, Pdo::none, {.saved = true}));
  return t;
}>();

constexpr std::size_t bank_bytes = 256;
using StoreMemory = std::array<std::byte, 2 * bank_bytes>;

// Makes the bank valid: mark, version, length and checksum. So records of any content get behind the checksum.
void seal(StoreMemory& memory, std::size_t bank, std::size_t length) {
  dictionary::StoreHeader header;
  const auto bytes = std::span(memory).subspan(bank, bank_bytes);
  std::memcpy(&header, bytes.data(), sizeof header);
  header.version = dictionary::StoreHeader::current_version;
  header.payload_length = static_cast<std::uint32_t>(std::min(length, bank_bytes - sizeof header));
  header.mark = dictionary::StoreHeader::valid_mark;
  const auto words = std::as_bytes(std::span(&header, 1)).first(offsetof(dictionary::StoreHeader, crc));
  header.crc = dictionary::crc32(bytes.subspan(sizeof header, header.payload_length), dictionary::crc32(words));
  std::memcpy(bytes.data(), &header, sizeof header);
}

void load_store(Bytes input) {
  using dictionary::AbortCode;
  using dictionary::Area;
  const std::uint8_t choice = fuzz::take_byte(input);
  StoreMemory memory{};
  const std::size_t size = std::min(input.size(), memory.size());
  std::memcpy(memory.data(), input.data(), size);
  if ((choice & 1) != 0) seal(memory, 0, size);
  if ((choice & 2) != 0) seal(memory, bank_bytes, choice);
  dictionary::RamMedium medium(memory);
  dictionary::Store store(medium);
  const auto check = [&](Objects& objects) {
    dictionary::Dictionary dictionary(table, std::as_writable_bytes(std::span(&objects, 1)));
    dictionary.load_defaults(Area::all, 1);
    if (store.load(dictionary, Area::all) != dictionary::Store::Loaded::values) {
      dictionary.load_defaults(Area::all, 1);
    }
    require(objects.ranged >= -100 && objects.ranged <= 100 && objects.text.length <= objects.text.bytes.size());
    require(objects.not_saved == 0);
    // The old records of the other areas may leave no room for the new ones.
    if ((choice & 4) != 0) store.save(dictionary, Area::communication);
    require(store.save(dictionary, Area::all) == AbortCode::none);
  };
  Objects first;
  Objects second;
  check(first);
  check(second);
  require(first.heartbeat == second.heartbeat && first.ranged == second.ranged && first.wide == second.wide);
  require(first.text.length == second.text.length && first.text.bytes == second.text.bytes);
}

// ---- Recordings ----

void read_recording(Bytes input) {
  try {
    const fit::Table recording = fit::read_table(text_of(input), "fuzz");
    for (const fit::Column& column : recording.columns) {
      require(column.clock < recording.clocks.size());
      require(column.values.size() == recording.clocks[column.clock].size());
    }
    const fit::Motor motor{.rated_torque_nm = 1.0,
                           .rated_current_a = 1.0,
                           .torque_constant_nm_per_a = 1.0,
                           .pole_pairs = 4,
                           .counts_per_revolution = 1000.0,
                           .rotor_inertia_kgm2 = 1e-4};
    const fit::Signals signals = fit::signals_of(recording, motor, {}, recording.columns.front().axis);
    require(std::is_sorted(signals.seconds.begin(), signals.seconds.end()));
    for (const std::vector<double>& values : signals.values) {
      require(values.empty() || values.size() == signals.seconds.size());
    }
  } catch (const fit::Error&) {
  }
}

constexpr fuzz::Parser parsers[] = {read_slave_description,
                                    read_data_sheet_as_drive,
                                    read_information_memory,
                                    read_scenario,
                                    read_rules,
                                    read_line,
                                    read_parameters,
                                    write_parameters_over_foe,
                                    load_store,
                                    read_recording,
                                    fuzz::read_words};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::parse_with(parsers, {data, size});
  return 0;
}
