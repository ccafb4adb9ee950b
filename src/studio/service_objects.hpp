#pragma once

#include <functional>

#include "host/axis402.hpp"
#include "line/line.hpp"

namespace servodrome::studio {

// The objects of an axis at its drive's service port, without a bus between: what a maker's own commissioning tool is
// connected to. Objects that the fieldbus does not see are there as well. Who puts things back on the way out of a task
// that is ended still reaches them; only wait() throws HostError then.
class ServiceObjects final : public host::ObjectClient {
 public:
  // Lets the line's time pass until it is `until`; may throw to leave the caller.
  using Wait = std::function<void(host::Time until)>;

  // `line` and `axis`, which is the line's, outlive this. Without `wait` an access takes no time, and none can pass.
  ServiceObjects(line::Line& line, line::Axis& axis, Wait wait = {})
      : line_(line), axis_(axis), wait_(std::move(wait)) {}

  std::vector<std::byte> upload(host::ObjectAddress object) override;
  void download(host::ObjectAddress object, std::span<const std::byte> data) override;
  // All in one access: at the same tick.
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

// How a host drives this axis.
host::AxisOptions options_for(const line::Axis& axis);

// What a revolution is in the drive's units: as the drive tells, else, since it counts in increments then, its
// encoder's. Throws HostError if it cannot be asked.
host::AxisUnits units_of(line::Line& line, line::Axis& axis);

}  // namespace servodrome::studio
