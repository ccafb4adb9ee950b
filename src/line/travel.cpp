#include "line/travel.hpp"

#include <cmath>
#include <fmt/format.h>

namespace servodrome::line {
namespace {

// Reads positions and distances of the travel and converts them to counts. Integers are converted without rounding.
class TravelUnit {
 public:
  explicit TravelUnit(TableReader& travel) {
    travel.read("counts_per_unit", counts_per_unit_);
    if (counts_per_unit_ <= 0) {
      travel.complain("counts_per_unit", fmt::format("{} is not positive", counts_per_unit_),
                      "give the encoder counts in one unit of the positions below; 1 if they are counts");
      counts_per_unit_ = 1;
    }
  }

  void read(TableReader& table, std::string_view key, std::int64_t& counts) const {
    const toml::node* node = table.node(key);
    if (node == nullptr) return;
    if (const auto* integer = node->as_integer();
        integer != nullptr && counts_per_unit_ == std::trunc(counts_per_unit_) && counts_per_unit_ < 0x1p62) {
      std::int64_t product = 0;
      if (!__builtin_mul_overflow(integer->get(), static_cast<std::int64_t>(counts_per_unit_), &product) &&
          std::abs(static_cast<double>(product)) <= static_cast<double>(plant::largest_position_counts)) {
        counts = product;
        return;
      }
      table.complain(key, "lies beyond 2^61 counts", "give a position nearer to 0");
      return;
    }
    double units = 0;
    const std::size_t complaints = table.report().diagnostics.size();
    table.read(key, units);
    if (table.report().diagnostics.size() != complaints) return;
    const double product = units * counts_per_unit_;
    if (std::abs(product) > static_cast<double>(plant::largest_position_counts)) {
      table.complain(key, "lies beyond 2^61 counts", "give a position nearer to 0");
      return;
    }
    counts = std::llround(product);
  }

 private:
  double counts_per_unit_ = 1;
};

enum class Side : std::uint8_t { below, above, region };

class SwitchReader {
 public:
  SwitchReader(const TravelUnit& unit, const Product& product, plant::Parameters& parameters)
      : unit_(unit), product_(product), parameters_(parameters) {}

  // Reads `[axis.travel] key = 100` or `key = { at = 100, hysteresis = 2, ... }` for a limit switch,
  // `key = { from = 1, to = 2, ... }` for any other switch.
  void read(TableReader& travel, std::string_view key, Side side, int wire) {
    const toml::node* node = travel.node(key);
    if (node == nullptr) return;
    plant::Switch fitted;
    if (side != Side::region && node->is_number()) {
      unit_.read(travel, key, side == Side::below ? fitted.to_counts : fitted.from_counts);
      fitted.wire = static_cast<std::uint8_t>(wire);
      add(travel, key, fitted);
      return;
    }
    if (!node->is_table()) {
      travel.complain(key, "is neither a position nor a table",
                      side == Side::region ? fmt::format("write {} = {{ from = 100, to = 200 }}", key)
                                           : fmt::format("write {} = 100, or {} = {{ at = 100 }}", key, key));
      return;
    }
    TableReader table(*node->as_table(), travel.name_of(key), travel.report());
    if (read_table(table, side, wire, fitted)) add(travel, key, fitted);
  }

  void read_more(TableReader& travel) {
    for (const toml::table* one : travel.tables("switch")) {
      TableReader table(*one, travel.name_of("switch"), travel.report());
      plant::Switch fitted;
      if (!read_table(table, Side::region, -1, fitted)) continue;
      add(table, "wire", fitted);
      keys_.back() = "switch";
    }
  }

  std::vector<std::string> keys() && { return std::move(keys_); }

 private:
  bool read_table(TableReader& table, Side side, int wire, plant::Switch& fitted) {
    if (side == Side::region) {
      unit_.read(table, "from", fitted.from_counts);
      unit_.read(table, "to", fitted.to_counts);
      if (fitted.from_counts > fitted.to_counts) {
        table.complain("from", "lies beyond `to`", "exchange them");
        return false;
      }
    } else {
      if (table.node("at") == nullptr) {
        table.complain("at", "is missing", "give the position at which the switch acts");
        return false;
      }
      unit_.read(table, "at", side == Side::below ? fitted.to_counts : fitted.from_counts);
    }
    unit_.read(table, "hysteresis", fitted.hysteresis_counts);
    table.read("normally_closed", fitted.normally_closed);
    table.read("wire", wire);
    table.finish();
    if (wire < 0 || wire >= product_.input_wires) {
      table.complain("wire", wire < 0 ? "is missing" : fmt::format("{} is not an input of the product", wire),
                     fmt::format("`{}` has the input wires 0 .. {}", product_.name, product_.input_wires - 1));
      return false;
    }
    fitted.wire = static_cast<std::uint8_t>(wire);
    return true;
  }

  void add(TableReader& at, std::string_view key, const plant::Switch& fitted) {
    keys_.emplace_back(key);
    if (parameters_.switch_count == plant::most_switches) {
      at.complain(key, "exceeds the number of switches", fmt::format("a travel has at most {}", plant::most_switches));
      return;
    }
    for (std::size_t i = 0; i < parameters_.switch_count; ++i) {
      if (parameters_.switches[i].wire != fitted.wire) continue;
      at.complain(key, fmt::format("wire {} is taken by `{}`", fitted.wire, keys_[i]),
                  "give each switch a wire of its own: wire = N");
      return;
    }
    parameters_.switches[parameters_.switch_count++] = fitted;
  }

  const TravelUnit& unit_;
  const Product& product_;
  plant::Parameters& parameters_;
  std::vector<std::string> keys_;
};

}  // namespace

std::vector<std::string> read_travel(TableReader& travel, const Product& product, plant::Parameters& parameters) {
  const TravelUnit unit(travel);
  unit.read(travel, "start", parameters.encoder.start_position_counts);
  unit.read(travel, "low_stop", parameters.load.low_stop_counts);
  unit.read(travel, "high_stop", parameters.load.high_stop_counts);
  SwitchReader switches(unit, product, parameters);
  switches.read(travel, "negative_limit", Side::below, product.wiring.negative_limit);
  switches.read(travel, "positive_limit", Side::above, product.wiring.positive_limit);
  switches.read(travel, "home", Side::region, product.wiring.home);
  switches.read_more(travel);
  travel.finish();
  return std::move(switches).keys();
}

}  // namespace servodrome::line
