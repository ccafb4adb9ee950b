#include <cstdio>
#include <fmt/format.h>
#include <vector>

#include "app/commands.hpp"
#include "app/whole_file.hpp"
#include "describe/description.hpp"
#include "line/registry.hpp"
#include "links/nearest_name.hpp"

namespace servodrome::app {
namespace export_command {

struct Options {
  std::string format;
  std::string product;
  std::string output;
};

// Names of the products for which this export is possible.
template <typename Can>
std::string names_of_products(Can can) {
  std::string names;
  for (const line::Product& product : line::all_products()) {
    if (can(product)) names += fmt::format("{}`{}`", names.empty() ? "" : ", ", product.name);
  }
  return names;
}

std::string document(const std::string& format, const line::Product& product) {
  const describe::Description description = product.describe();
  if (format == "modbus") {
    if (product.serial == nullptr) {
      throw Failure::wrong_use(fmt::format("export: a `{}` has no Modbus registers", product.name));
    }
    return describe::register_list(product.serial->registers, description.service_table);
  }
  if (format == "esi" || format == "sii") {
    if (!description.ethercat) {
      throw Failure::wrong_use(
          fmt::format("export: a `{}` is not on EtherCAT; these are: {}", product.name,
                      names_of_products([](const line::Product& one) { return one.describe().ethercat.has_value(); })));
    }
    if (format == "esi") return describe::esi(description);
    const std::vector<std::uint8_t> image = describe::sii(description);
    return {image.begin(), image.end()};
  }
  if (format == "eds") return describe::eds(description);
  if (format == "csv") return describe::csv(description.table);
  return describe::markdown(description);
}

void run(const Options& options) {
  const line::Product* product = line::find_product(line::all_products(), options.product);
  if (product == nullptr) {
    std::vector<std::string_view> names;
    for (const line::Product& known : line::all_products()) names.push_back(known.name);
    throw Failure::wrong_use(fmt::format("export: there is no product \"{}\"; {}", options.product,
                                         links::suggestion(options.product, names)));
  }
  const std::string text = document(options.format, *product);
  if (options.output.empty() || options.output == "-") {
    std::fwrite(text.data(), 1, text.size(), stdout);  // errors are detected when the output is closed in main
  } else {
    write_whole_file(options.output, text);
  }
}

}  // namespace export_command

void add_export(CLI::App& app) {
  const auto [command, options] = add_command(
      app, "export", "Write a product's data sheet, object reference or register list", export_command::run);
  command
      ->add_option(
          "FORMAT", options->format,
          "eds (CiA 306), csv or md (Markdown) of its objects, esi (EtherCAT slave information, XML), sii (the "
          "bytes of an EtherCAT slave's information memory), modbus (csv of its registers)")
      ->required()
      ->check(CLI::IsMember({"eds", "csv", "md", "esi", "sii", "modbus"}));
  command->add_option("PRODUCT", options->product, "A name that `servodrome products` lists")->required();
  command->add_option("-o,--output", options->output, "File to write; standard output if not given");
}

}  // namespace servodrome::app
