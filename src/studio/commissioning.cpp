#include "studio/commissioning.hpp"

#include <fmt/format.h>

#include "catalogue/product.hpp"
#include "line/bench/line_bench.hpp"
#include "master/abort_text.hpp"

namespace servodrome::studio {

using api::ApiError;

namespace {

// Reads the objects of a device that does not run.
class DeviceObjects final : public master::ObjectClient {
 public:
  explicit DeviceObjects(products::Device& device) : device_(device) {}

  std::vector<std::byte> upload(master::ObjectAddress object) override {
    dictionary::AbortCode abort{};
    const dictionary::Entry* entry = device_.dictionary().find(object.index, object.sub, abort);
    dictionary::ReadValue value;
    if (entry != nullptr) abort = device_.dictionary().read(*entry, value);
    if (abort == dictionary::AbortCode::none) return {value.bytes.begin(), value.bytes.end()};
    throw master::ObjectError(dictionary::text(abort), text_of(object), "", master::is_absent(abort));
  }
  void download(master::ObjectAddress object, std::span<const std::byte>) override {
    throw master::ObjectError("stored values are only read", text_of(object), "", false);
  }
  master::Time now() const override { return {}; }
  void wait(master::Time) override {}
  std::uint16_t address() const override { return device_.node_id(); }
  std::string where() const override { return "non-volatile memory"; }

 private:
  products::Device& device_;
};

}  // namespace

Subject LineSubjects::open(api::Call& call) {
  line::Axis& axis = line::bench::axis_argument(line_, call);
  if (!axis.powered()) {
    throw ApiError{409, "the axis has no power", axis.settings().name,
                   "switch it on: POST .../power {\"action\": \"on\"}"};
  }
  products::Device& device = axis.device();
  const bool on_fieldbus = axis.settings().bus || axis.settings().ethercat;
  Subject subject{.client = std::make_unique<ServiceObjects>(line_, axis),
                  .product = std::string(axis.settings().product->name),
                  .table = on_fieldbus ? device.bus_dictionary().table() : device.dictionary().table()};
  if (axis.settings().bus) subject.node_id = device.node_id();
  subject.stored = [&axis](const master::ParameterList& list) {
    const auto stored = axis.stored_device();
    DeviceObjects objects(*stored);
    return master::read_parameters(objects, list, stored->node_id()).values;
  };
  return subject;
}

master::ParameterList Subject::parameters(bool with_connection) const {
  return master::ParameterList::of_dictionary(table, catalogue::product_of(product).rules, with_connection);
}

ApiError api_error(const master::MasterError& error, unsigned status) {
  return {status, error.happened(), error.where(), error.remedy()};
}

}  // namespace servodrome::studio
