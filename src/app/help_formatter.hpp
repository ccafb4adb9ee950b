#pragma once

#include <CLI/CLI.hpp>

namespace servodrome::app {

// `--help` for people: lines no longer than the width of a terminal, and value types in words.
class HelpFormatter final : public CLI::Formatter {
 public:
  std::string make_option(const CLI::Option* option, bool is_positional) const override;
  std::string make_option_usage(const CLI::Option* option) const override;
  std::string make_description(const CLI::App* app) const override;
  std::string make_subcommand(const CLI::App* command) const override;
  std::string make_footer(const CLI::App* app) const override;
};

}  // namespace servodrome::app
