#include "studio/service_objects.hpp"

#include <exception>
#include <fmt/format.h>
#include <numeric>

#include "catalogue/product.hpp"
#include "master/abort_text.hpp"
#include "studio/task.hpp"

namespace servodrome::studio {
namespace {

// Duration of an access: so time passes even for a caller that only reads.
constexpr master::Time access_time = line::tick_length;

}  // namespace

// Returns false if no time can pass any more, because a task is being ended.
bool ServiceObjects::pass(master::Time span) {
  if (!wait_) return false;
  const master::Time until = line_.now() + std::max(span, access_time);
  if (std::uncaught_exceptions() == 0) {
    wait_(until);
    return true;
  }
  // During exception handling, cleaning up may still wait.
  try {
    wait_(until);
    return true;
  } catch (const Task::Ended&) {
    return false;
  }
}

void ServiceObjects::wait(master::Time span) {
  if (wait_ && !pass(span)) throw master::MasterError("the job has ended", where(), "start the job again");
}

void ServiceObjects::require_power() const {
  if (axis_.powered()) return;
  throw master::ObjectError("the axis has no power", where(), "switch it on", false);
}

void ServiceObjects::refuse(master::ObjectAddress object, dictionary::AbortCode abort, bool upload) const {
  throw master::ObjectError(master::text_of_failed_access(upload, abort, true),
                            fmt::format("{}, {}", where(), master::text_of(object)),
                            master::remedy_of_failed_access(abort, true), master::is_absent(abort));
}

const dictionary::Entry& ServiceObjects::find(master::ObjectAddress object, bool upload) const {
  require_power();
  dictionary::AbortCode abort{};
  const dictionary::Entry* entry = axis_.device().dictionary().find(object.index, object.sub, abort);
  if (entry == nullptr) refuse(object, abort, upload);
  return *entry;
}

std::vector<std::byte> ServiceObjects::upload(master::ObjectAddress object) {
  pass(access_time);
  return read_now(object);
}

std::vector<std::vector<std::size_t>> ServiceObjects::read_together(
    std::span<const master::ObjectAddress> objects) const {
  std::vector<std::size_t> all(objects.size());
  std::iota(all.begin(), all.end(), std::size_t{0});
  return {std::move(all)};
}

std::vector<std::vector<std::byte>> ServiceObjects::upload_together(std::span<const master::ObjectAddress> objects) {
  pass(access_time);
  std::vector<std::vector<std::byte>> values;
  for (const master::ObjectAddress object : objects) values.push_back(read_now(object));
  return values;
}

std::vector<std::byte> ServiceObjects::read_now(master::ObjectAddress object) {
  const dictionary::Entry& entry = find(object, true);
  dictionary::ReadValue value;
  const dictionary::AbortCode abort = axis_.device().dictionary().read(entry, value);
  if (abort != dictionary::AbortCode::none) refuse(object, abort, true);
  return {value.bytes.begin(), value.bytes.end()};
}

void ServiceObjects::download(master::ObjectAddress object, std::span<const std::byte> data) {
  pass(access_time);
  const dictionary::Entry& entry = find(object, false);
  const dictionary::AbortCode abort = axis_.device().dictionary().write(entry, data);
  if (abort != dictionary::AbortCode::none) refuse(object, abort, false);
  axis_.send_waiting(line_.now());
}

master::AxisOptions options_for(const line::Axis& axis) {
  master::AxisOptions options;
  options.product = &catalogue::product_of(axis.settings().product->name);
  // A simulated drive resets a fault within some cycles.
  options.reset_timeout = std::chrono::milliseconds(200);
  return options;
}

catalogue::AxisUnits units_of(line::Line& line, line::Axis& axis) {
  ServiceObjects objects(line, axis);
  master::Axis402 master_axis(objects, options_for(axis));
  if (const auto units = master_axis.units()) return *units;
  const double counts = axis.plant().parameters().encoder.counts_per_revolution;
  return master_axis.units(counts).value_or(catalogue::AxisUnits{counts, counts, counts});
}

}  // namespace servodrome::studio
