#pragma once

#include "catalogue/product.hpp"
#include "line/line.hpp"
#include "studio/drives.hpp"

namespace servodrome::studio {

// The axes of a line, accessed through their service ports, in the line's time.
class LineDrives final : public Drives {
 public:
  // The line must outlive this object.
  explicit LineDrives(line::Line& line) : line_(line) {}

  master::Time now() const override { return line_.now(); }
  std::vector<std::string> names() const override;
  void require_ready(const std::string& axis) const override;
  std::unique_ptr<master::ObjectClient> open(const std::string& axis, Wait wait) override;
  master::AxisOptions options(const std::string& axis) const override;
  std::string product(const std::string& axis) const override;
  bool has_cycles(const std::string&) const override { return true; }
  api::Json in_cycles(const std::string& axis, master::ObjectClient& objects, const master::CanDrive& exchanged,
                      const std::function<bool()>& cancelled,
                      const std::function<void(const char* doing, double share)>& progress, const Work& work) override;
  std::vector<std::string> injected(const std::string& axis) const override;
  std::optional<catalogue::AxisUnits> units(const std::string& axis) override;
  master::AxisLimits limits(const std::string& axis) override;
  Travel travel(const std::string& axis) override;
  std::uint64_t commands(const std::string& axis) const override { return find(axis).commands(); }
  std::vector<std::optional<JobError>> stop_all() override;

 private:
  line::Axis& find(const std::string& axis) const;

  line::Line& line_;
};

}  // namespace servodrome::studio
