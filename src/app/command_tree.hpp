#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

// What the commands are, as their definitions (CLI11) have it: for the manual page and the shells' completions.
namespace servodrome::app {

struct CommandArgument {
  enum class Value : std::uint8_t { none, number, text };  // of a text any file may be the one

  std::vector<std::string> names{};  // "-o", "--output"; of a positional its one name
  Value value = Value::none;
  std::vector<std::string> choices{};
  std::string default_value{};
  std::string description{};
  bool required = false;
  bool repeated = false;

  // "NUMBER", "TEXT", "eds|csv" or nothing.
  std::string value_text() const;
};

struct CommandNode {
  std::string path;  // "servodrome params save"
  std::string name;
  std::string description{};
  std::vector<CommandArgument> positionals{};
  std::vector<CommandArgument> options{};
  std::vector<CommandNode> commands{};
};

CommandArgument argument_of(const CLI::Option& option, bool positional);
CommandNode command_tree(const CLI::App& app);

// Every node of the tree, from the top down.
std::vector<const CommandNode*> all_commands(const CommandNode& root);

// "[OPTIONS] FORMAT PRODUCT": what follows the path in a line of usage.
std::string usage_of(const CommandNode& node);

}  // namespace servodrome::app
