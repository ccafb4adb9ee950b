#pragma once

#include <functional>

#include "axis/axis402.hpp"
#include "catalogue/product.hpp"
#include "line/line.hpp"

namespace servodrome::studio {

// Access to the objects of an axis through its drive's service port, without a bus, as a maker's commissioning tool
// does. It also reaches objects that the fieldbus does not. Code that restores values while its task is being ended can
// still access them; only wait() throws MasterError then.
class ServiceObjects final : public master::ObjectClient {
 public:
  // Waits until the line's time is `until`; may throw to leave the caller.
  using Wait = std::function<void(master::Time until)>;

  // `line` and its axis `axis` must outlive this object. Without `wait`, accesses take no time and waiting does
  // nothing.
  ServiceObjects(line::Line& line, line::Axis& axis, Wait wait = {})
      : line_(line), axis_(axis), wait_(std::move(wait)) {}

  std::vector<std::byte> upload(master::ObjectAddress object) override;
  void download(master::ObjectAddress object, std::span<const std::byte> data) override;
  // Reads all objects in one access, at the same tick.
  std::vector<std::vector<std::size_t>> read_together(std::span<const master::ObjectAddress> objects) const override;
  std::vector<std::vector<std::byte>> upload_together(std::span<const master::ObjectAddress> objects) override;
  master::Time now() const override { return line_.now(); }
  void wait(master::Time span) override;
  std::uint16_t address() const override { return axis_.device().node_id(); }
  std::string where() const override { return axis_.settings().name; }

 private:
  bool pass(master::Time span);
  std::vector<std::byte> read_now(master::ObjectAddress object);
  const dictionary::Entry& find(master::ObjectAddress object, bool upload) const;
  void require_power() const;
  [[noreturn]] void refuse(master::ObjectAddress object, dictionary::AbortCode abort, bool upload) const;

  line::Line& line_;
  line::Axis& axis_;
  Wait wait_;
};

// Options with which a master operates this axis.
master::AxisOptions options_for(const line::Axis& axis);

// A revolution in the drive's units. If the drive has no such information it counts in increments, so the counts of its
// encoder are used. Throws MasterError if the access fails.
catalogue::AxisUnits units_of(line::Line& line, line::Axis& axis);

}  // namespace servodrome::studio
