#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

// The tree of commands and options, read from the CLI11 definitions, for the manual page and shell completion.
namespace servodrome::app {

struct CommandArgument {
  enum class Value : std::uint8_t { none, number, text };  // a text may be a file name

  std::vector<std::string> names{};  // "-o", "--output"; a positional has one name
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

// All nodes of the tree, parents before children.
std::vector<const CommandNode*> all_commands(const CommandNode& root);

// "[OPTIONS] FORMAT PRODUCT": the part after the path in a usage line.
std::string usage_of(const CommandNode& node);

}  // namespace servodrome::app
