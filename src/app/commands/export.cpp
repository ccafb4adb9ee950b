#include <cerrno>
#include <cstdio>
#include <cstring>
#include <fmt/format.h>
#include <memory>

#include "app/commands.hpp"
#include "describe/description.hpp"
#include "line/nearest_name.hpp"
#include "line/registry.hpp"

namespace servodrome::app {
namespace {

struct Options {
  std::string format;
  std::string product;
  std::string output;
};

std::string document(const std::string& format, const line::Product& product) {
  const describe::Description description = product.describe();
  if (format == "modbus") {
    if (product.serial == nullptr) {
      throw Failure::wrong_use(fmt::format("export: a `{}` has no Modbus registers", product.name));
    }
    return describe::register_list(product.serial->registers, description.table);
  }
  if (format == "eds") return describe::eds(description);
  if (format == "csv") return describe::csv(description.table);
  return describe::markdown(description);
}

void write(const std::string& path, const std::string& text) {
  std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::fopen(path.c_str(), "wb"), &std::fclose);
  const bool written =
      file && std::fwrite(text.data(), 1, text.size(), file.get()) == text.size() && std::fflush(file.get()) == 0;
  if (!written) {
    throw Failure::did_not_work(fmt::format("cannot write {}: {}; choose a folder that exists and may be written to",
                                            path, std::strerror(errno)));
  }
}

void run(const Options& options) {
  const line::Product* product = line::find_product(line::all_products(), options.product);
  if (product == nullptr) {
    std::vector<std::string_view> names;
    for (const line::Product& known : line::all_products()) names.push_back(known.name);
    throw Failure::wrong_use(fmt::format("export: there is no product \"{}\"; {}", options.product,
                                         line::suggestion(options.product, names)));
  }
  const std::string text = document(options.format, *product);
  write(options.output.empty() || options.output == "-" ? "/dev/stdout" : options.output, text);
}

}  // namespace

void add_export(CLI::App& app) {
  const auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand("export", "Write a product's data sheet, object reference or register list");
  command
      ->add_option("FORMAT", options->format,
                   "eds (CiA 306), csv or md (Markdown) of its objects, modbus (csv of its registers)")
      ->required()
      ->check(CLI::IsMember({"eds", "csv", "md", "modbus"}));
  command->add_option("PRODUCT", options->product, "A name that `servodrome products` lists")->required();
  command->add_option("-o,--output", options->output, "File to write; standard output if not given");
  command->callback([options] { run(*options); });
}

}  // namespace servodrome::app
