#pragma once

#include <CLI/CLI.hpp>

namespace servodrome::app {

// `--help` as people read it: lines no longer than a terminal is wide, and what a value is in words.
class HelpFormatter final : public CLI::Formatter {
 public:
  std::string make_option(const CLI::Option* option, bool is_positional) const override;
  std::string make_option_usage(const CLI::Option* option) const override;
  std::string make_description(const CLI::App* app) const override;
  std::string make_subcommand(const CLI::App* command) const override;
  std::string make_footer(const CLI::App* app) const override;
};

}  // namespace servodrome::app
