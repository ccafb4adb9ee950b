#include "app/command_tree.hpp"

#include <fmt/format.h>

#include "line/registry.hpp"

namespace servodrome::app {
namespace {

// CLI11 writes the values of IsMember as "TEXT:{eds,csv}".
std::vector<std::string> choices_in(const std::string& type_name) {
  std::vector<std::string> choices;
  const std::size_t begin = type_name.find(":{");
  const std::size_t end = type_name.rfind('}');
  if (begin == std::string::npos || end == std::string::npos) return choices;
  std::string word;
  for (const char c : type_name.substr(begin + 2, end - begin - 2) + ",") {
    if (c != ',') {
      word += c;
    } else {
      choices.push_back(std::exchange(word, {}));
    }
  }
  return choices;
}

// In CLI11 a flag has a text type with zero expected values.
bool takes_value(const CLI::Option& option) { return option.get_type_size() != 0 && option.get_expected_max() != 0; }

CommandNode command_node_of(const CLI::App& app, const std::string& before) {
  CommandNode node{.path = before + app.get_name(), .name = app.get_name(), .description = app.get_description()};
  for (const CLI::Option* option : app.get_options()) {
    auto& list = option->get_positional() ? node.positionals : node.options;
    list.push_back(argument_of(*option, option->get_positional()));
  }
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; })) {
    node.commands.push_back(command_node_of(*command, node.path + " "));
  }
  return node;
}

void collect_commands(const CommandNode& node, std::vector<const CommandNode*>& all) {
  all.push_back(&node);
  for (const CommandNode& command : node.commands) collect_commands(command, all);
}

}  // namespace

CommandArgument argument_of(const CLI::Option& option, bool positional) {
  CommandArgument argument{.default_value = option.get_default_str(),
                           .description = option.get_description(),
                           .required = option.get_required(),
                           .repeated = option.get_expected_max() > 1};
  if (positional) {
    argument.names = {option.get_single_name()};
  } else {
    for (const std::string& name : option.get_snames()) argument.names.push_back("-" + name);
    for (const std::string& name : option.get_lnames()) argument.names.push_back("--" + name);
  }
  if (!takes_value(option)) return argument;
  const std::string type = option.get_type_name();
  const bool number = type.starts_with("FLOAT") || type.starts_with("INT") || type.starts_with("UINT");
  argument.value = number ? CommandArgument::Value::number : CommandArgument::Value::text;
  argument.choices = choices_in(type);
  if (argument.names.back() == "PRODUCT" || argument.names.back() == "--product") {
    for (const line::Product& product : line::all_products()) argument.choices.emplace_back(product.name);
  }
  return argument;
}

std::string CommandArgument::value_text() const {
  if (value == Value::none) return {};
  // A list of all products would be long and incomplete, because files can add products.
  if (!choices.empty() && names.back() != "PRODUCT" && names.back() != "--product") {
    return fmt::format("{}", fmt::join(choices, "|"));
  }
  return value == Value::number ? "NUMBER" : "TEXT";
}

CommandNode command_tree(const CLI::App& app) { return command_node_of(app, ""); }

std::vector<const CommandNode*> all_commands(const CommandNode& root) {
  std::vector<const CommandNode*> all;
  collect_commands(root, all);
  return all;
}

std::string usage_of(const CommandNode& node) {
  std::string usage = "[OPTIONS]";
  for (const CommandArgument& positional : node.positionals) {
    const std::string name = positional.names.back() + (positional.repeated ? "..." : "");
    usage += positional.required ? fmt::format(" {}", name) : fmt::format(" [{}]", name);
  }
  if (!node.commands.empty()) usage += " COMMAND";
  return usage;
}

}  // namespace servodrome::app
