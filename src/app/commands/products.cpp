#include <fmt/format.h>
#include <memory>
#include <nlohmann/json.hpp>

#include "app/commands.hpp"
#include "line/registry.hpp"

namespace servodrome::app {

void add_products(CLI::App& app) {
  const auto json = std::make_shared<bool>(false);
  CLI::App* command = app.add_subcommand("products", "List the drive products that can be simulated");
  command->add_flag("--json", *json, "Print JSON");
  command->callback([json] {
    nlohmann::ordered_json list = nlohmann::ordered_json::array();
    for (const line::Product& product : line::all_products()) {
      list.push_back({{"name", product.name}, {"title", product.title}});
      if (!*json) fmt::print("{:<14}{}\n", product.name, product.title);
    }
    if (*json) fmt::print("{}\n", nlohmann::ordered_json{{"products", std::move(list)}}.dump(2));
  });
}

}  // namespace servodrome::app
