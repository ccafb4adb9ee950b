#include "app/script_file.hpp"

#include <fmt/format.h>
#include <map>
#include <memory>

#include "app/commands.hpp"
#include "app/drive_link.hpp"
#include "line/registry.hpp"

namespace servodrome::app {
namespace {

// The objects of products, as their bus sees them.
class Catalogues {
 public:
  explicit Catalogues(const BusOptions& options) {
    const BusKind kind = bus_kind(options).kind;
    serial_ = kind == BusKind::modbus || kind == BusKind::serial10;
  }
  const master::ObjectCatalogue* of(const std::string& name) {
    const line::Product* const product = line::find_product(line::all_products(), name);
    if (product == nullptr) return nullptr;
    auto& place = made_[name];
    if (!place) {
      const describe::Description description = product->describe();
      place = std::make_unique<master::ObjectCatalogue>(
          master::ObjectCatalogue::of(serial_ ? description.service_table : description.table));
    }
    return place.get();
  }

 private:
  bool serial_ = false;
  std::map<std::string, std::unique_ptr<master::ObjectCatalogue>> made_;
};

}  // namespace

master::script::Script parse_script(const std::string& text, const std::string& name, const BusOptions& bus,
                                    const master::ObjectCatalogue* sheet) {
  try {
    if (sheet != nullptr) return master::script::parse(text, name, *sheet);
    Catalogues catalogues(bus);
    named_product(bus);  // throws if there is no such product
    const master::ObjectCatalogue* const own = catalogues.of(bus.product);
    return master::script::parse(text, name, own != nullptr ? *own : master::ObjectCatalogue::standard(),
                                 [&catalogues](const std::string& product) { return catalogues.of(product); });
  } catch (const master::script::ScriptMistakes& mistakes) {
    throw Failure::wrong_use(fmt::format("the script has mistakes, and nothing was moved:\n{}", mistakes.what()));
  }
}

}  // namespace servodrome::app
