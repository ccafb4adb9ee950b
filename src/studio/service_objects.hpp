#pragma once

#include <functional>

#include "host/axis402.hpp"
#include "line/line.hpp"

namespace servodrome::studio {

// Access to the objects of an axis through its drive's service port, without a bus, as a maker's commissioning tool
// does. It also reaches objects that the fieldbus does not. Code that restores values while its task is being ended can
// still access them; only wait() throws HostError then.
class ServiceObjects final : public host::ObjectClient {
 public:
  // Waits until the line's time is `until`; may throw to leave the caller.
  using Wait = std::function<void(host::Time until)>;

  // `line` and its axis `axis` must outlive this object. Without `wait`, accesses take no time and waiting does
  // nothing.
  ServiceObjects(line::Line& line, line::Axis& axis, Wait wait = {})
      : line_(line), axis_(axis), wait_(std::move(wait)) {}

  std::vector<std::byte> upload(host::ObjectAddress object) override;
  void download(host::ObjectAddress object, std::span<const std::byte> data) override;
  // Reads all objects in one access, at the same tick.
  std::vector<std::vector<std::size_t>> read_together(std::span<const host::ObjectAddress> objects) const override;
  std::vector<std::vector<std::byte>> upload_together(std::span<const host::ObjectAddress> objects) override;
  host::Time now() const override { return line_.now(); }
  void wait(host::Time span) override;
  std::uint16_t address() const override { return axis_.device().node_id(); }
  std::string where() const override { return axis_.settings().name; }

 private:
  bool pass(host::Time span);
  std::vector<std::byte> read_now(host::ObjectAddress object);
  const dictionary::Entry& find(host::ObjectAddress object, bool upload) const;
  void require_power() const;
  [[noreturn]] void refuse(host::ObjectAddress object, dictionary::AbortCode abort, bool upload) const;

  line::Line& line_;
  line::Axis& axis_;
  Wait wait_;
};

// Options with which a host operates this axis.
host::AxisOptions options_for(const line::Axis& axis);

// A revolution in the drive's units. If the drive has no such information it counts in increments, so the counts of its
// encoder are used. Throws HostError if the access fails.
host::AxisUnits units_of(line::Line& line, line::Axis& axis);

}  // namespace servodrome::studio
