#include "app/line_files.hpp"

#include <fmt/format.h>

#include "app/commands.hpp"
#include "described/blueprint.hpp"
#include "line/described_product.hpp"
#include "line/line_file.hpp"
#include "line/toml_text.hpp"
#include "links/link_scheme.hpp"

namespace servodrome::app {

namespace {

line::LineSettings settings_of(line::LineFile loaded, const std::string& name) {
  if (loaded.diagnostics.empty()) return std::move(loaded.settings);
  std::string message = fmt::format("{} cannot be run:", name);
  for (const line::Diagnostic& diagnostic : loaded.diagnostics) message += "\n" + to_string(diagnostic);
  throw Failure::wrong_use(message);
}

}  // namespace

line::LineSettings load_line(const std::string& file) {
  if (!file.empty()) return settings_of(line::load_line_file(file, line::all_products()), file);
  return settings_of(line::parse_line_file(line::default_line_text(), "default.toml", line::all_products()),
                     "the built-in line");
}

line::LineSettings line_of_descriptions(const DescriptionFiles& descriptions) {
  constexpr auto usual_encoder = static_cast<std::uint32_t>(plant::Encoder{}.counts_per_revolution);
  std::string text;
  if (!descriptions.data_sheets.empty()) {
    text += fmt::format("[[bus]]\nname = \"can0\"\nlinks = [\"{}\"]\n", links::scheme::socketcand.example);
  }
  if (!descriptions.slaves.empty()) {
    text +=
        fmt::format("[[bus]]\nname = \"ecat\"\ntype = \"ethercat\"\nlinks = [\"{}\"]\n", links::scheme::udp.example);
  }
  unsigned number = 0;
  const auto add = [&](const std::string& file, const std::string& device, line::Fieldbus wanted, const char* option) {
    if (file.ends_with(".toml")) {
      throw Failure::wrong_use(fmt::format("{} {}: this is a line file; give it without {}, `servodrome up {}`", option,
                                           file, option, file));
    }
    std::uint32_t counts = usual_encoder;
    try {
      const auto product = line::describe_product(file, device);
      if (product->fieldbus != wanted) {
        throw Failure::wrong_use(fmt::format(
            "{} {}: this is {}", option, file,
            wanted == line::Fieldbus::can ? "an ESI file; give it with --esi" : "no ESI file; give it with --eds"));
      }
      if (product->blueprint->encoder_counts != 0) counts = product->blueprint->encoder_counts;
    } catch (const describe::DeviceFileError& error) {
      throw Failure::wrong_use(error.what());
    }
    ++number;
    text += fmt::format("[[axis]]\nname = \"axis{}\"\ndescription = {}\n", number, line::toml_quoted(file));
    if (!device.empty()) text += fmt::format("device = {}\n", line::toml_quoted(device));
    if (wanted == line::Fieldbus::can) text += fmt::format("node = {}\n", number);
    text += fmt::format(
        "[axis.travel]\ncounts_per_unit = {}\nlow_stop = -11\nhigh_stop = 11\nnegative_limit = -10\n"
        "positive_limit = 10\nhome = {{ from = -0.5, to = 0.5 }}\n",
        counts);
  };
  for (const std::string& file : descriptions.data_sheets) add(file, "", line::Fieldbus::can, "--eds");
  for (const std::string& file : descriptions.slaves) add(file, descriptions.device, line::Fieldbus::ethercat, "--esi");
  return settings_of(line::parse_line_file(text, "", line::all_products()), "the line of the descriptions");
}

}  // namespace servodrome::app
