#include "app/help_formatter.hpp"

#include <fmt/format.h>
#include <sstream>

#include "app/command_tree.hpp"

namespace servodrome::app {
namespace {

constexpr std::size_t help_width = 100;
constexpr std::size_t help_column = 28;

// Wraps the words of `text` into lines that begin at `column`; the first line already has `used` characters.
std::string wrapped_help(const std::string& text, std::size_t column, std::size_t used) {
  std::istringstream words(text);
  std::string lines;
  std::size_t at = used;
  for (std::string word; words >> word;) {
    if (at > column && at + 1 + word.size() > help_width) {
      lines += "\n";
      at = 0;
    }
    if (at < column) {
      lines += std::string(column - at, ' ');
      at = column;
    } else if (at > column) {
      lines += ' ';
      ++at;
    }
    lines += word;
    at += word.size();
  }
  return lines + "\n";
}

std::string help_entry(const std::string& head, const std::string& text) {
  std::string lines = "  " + head;
  if (lines.size() + 2 > help_column) {
    lines += "\n";
    return lines + wrapped_help(text, help_column, 0);
  }
  return lines + wrapped_help(text, help_column, lines.size());
}

}  // namespace

std::string HelpFormatter::make_option(const CLI::Option* option, bool is_positional) const {
  const CommandArgument argument = argument_of(*option, is_positional);
  std::string head = fmt::format("{}", fmt::join(argument.names, ", "));
  const std::string value = argument.value_text();
  if (!is_positional && !value.empty()) head += " " + value;
  std::string text = argument.description;
  if (is_positional && !argument.choices.empty() && argument.names.back() != "PRODUCT") text += " (" + value + ")";
  if (argument.required && !is_positional) text += " (required)";
  if (!argument.default_value.empty()) text += fmt::format(" (default: {})", argument.default_value);
  return help_entry(head, text);
}

std::string HelpFormatter::make_option_usage(const CLI::Option* option) const {
  const std::string name = option->get_single_name() + (option->get_expected_max() > 1 ? "..." : "");
  return option->get_required() ? name : "[" + name + "]";
}

std::string HelpFormatter::make_description(const CLI::App* app) const {
  return wrapped_help(app->get_description(), 0, 0);
}

std::string HelpFormatter::make_subcommand(const CLI::App* command) const {
  return help_entry(command->get_name(), command->get_description());
}

std::string HelpFormatter::make_footer(const CLI::App* app) const {
  if (!app->get_subcommands([](const CLI::App*) { return true; }).empty()) {
    return wrapped_help(
        "`servodrome COMMAND --help` shows a command's options. Exit status: 0: success; 1: failure; 2: wrong use; 128 "
        "and the signal's number: ended by a signal.",
        0, 0);
  }
  return {};
}

}  // namespace servodrome::app
