#include "studio/line_changes.hpp"

#include "api/author.hpp"

namespace servodrome::studio {
namespace {

std::vector<std::string> names_of(const line::Line& line) {
  std::vector<std::string> names;
  for (const auto& axis : line.axes()) names.push_back(axis->settings().name);
  return names;
}

// Every object of a table begins with sub-index 0.
const char* object_name_of(const dictionary::Entry& entry) {
  const dictionary::Entry* head = &entry;
  while (head->sub != 0) --head;
  return head->name;
}

}  // namespace

LineChanges::LineChanges(line::Line& line, WallClock wall_clock)
    : line_(line), wall_clock_(wall_clock), log_(names_of(line)) {
  for (const auto& axis : line.axes()) {
    const auto number = static_cast<std::uint32_t>(masters_.size());
    masters_.push_back(master_of(line, *axis));
    taps_.push_back(std::make_unique<Tap>(*this, number, axis->device().dictionary(), false));
    taps_.push_back(std::make_unique<Tap>(*this, number, axis->device().bus_dictionary(), true));
  }
}

LineChanges::~LineChanges() = default;

LineChanges::Master LineChanges::master_of(const line::Line& line, const line::Axis& axis) {
  Master master;
  const line::AxisSettings& its = axis.settings();
  if (its.bus) master.on_fieldbus = "SDO on " + line.buses()[*its.bus]->settings.name;
  if (its.ethercat) {
    const std::string& bus = line.ethercat_buses()[its.ethercat->bus]->settings.name;
    master.on_fieldbus = "SDO on " + bus;
    master.file = "FoE on " + bus;
  }
  if (its.serial) {
    const std::string& bus = line.serial_buses()[its.serial->bus]->settings.name;
    master.modbus = "Modbus on " + bus;
    master.serial10 = "10-byte protocol on " + bus;
  }
  return master;
}

// The service port belongs to the server and, while the server does not use it, to the drive's RS485 port.
std::string_view LineChanges::writer(std::uint32_t axis, bool of_fieldbus) const {
  const Master& master = masters_[axis];
  if (of_fieldbus) return master.on_fieldbus;
  if (!api::Author::present().empty()) return api::Author::present();
  const products::SerialPort* port = line_.axes()[axis]->serial_port();
  if (port == nullptr) return master.file;
  return port->protocol() == products::SerialProtocol::serial10 ? master.serial10 : master.modbus;
}

LineChanges::Tap::Tap(LineChanges& changes, std::uint32_t axis, dictionary::Dictionary& dictionary, bool of_fieldbus)
    : changes_(changes), axis_(axis), dictionary_(dictionary), of_fieldbus_(of_fieldbus) {
  dictionary_.set_recorder(this);
}

LineChanges::Tap::~Tap() { dictionary_.set_recorder(nullptr); }

void LineChanges::Tap::before(const dictionary::Entry&, std::span<const std::byte> value) {
  before_ = api::KeptValue(value);
}

void LineChanges::Tap::written(const dictionary::Entry& entry, std::span<const std::byte> value) {
  api::Change change;
  change.at = changes_.line_.axes()[axis_]->ticks() * line::tick_length;
  change.wall = changes_.wall_clock_();
  change.axis = axis_;
  change.entry = &entry;
  change.object_name = object_name_of(entry);
  change.before = before_;
  change.after = api::KeptValue(value);
  changes_.log_.add(change, changes_.writer(axis_, of_fieldbus_));
}

}  // namespace servodrome::studio
