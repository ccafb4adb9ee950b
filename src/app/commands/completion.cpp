// `completion` and `manual`: shell completion and the manual page, generated from the command definitions.
#include <fmt/format.h>

#include "app/manual_page.hpp"
#include "app/reference_commands.hpp"
#include "app/shell_completion.hpp"

namespace servodrome::app {

void add_completion(CLI::App& app) {
  const auto shell = std::make_shared<std::string>();
  CLI::App* command = app.add_subcommand(
      "completion", "Print the completion script of a shell: `source <(servodrome completion bash)`");
  command->add_option("SHELL", *shell, "bash, zsh or fish")->required()->check(CLI::IsMember({"bash", "zsh", "fish"}));
  command->callback([shell, &app] {
    const CommandNode root = command_tree(app);
    fmt::print("{}", *shell == "bash"  ? bash_completion(root)
                     : *shell == "zsh" ? zsh_completion(root)
                                       : fish_completion(root));
  });
}

void add_manual(CLI::App& app) {
  CLI::App* command =
      app.add_subcommand("manual", "Print the manual page: `servodrome manual > servodrome.1; man ./servodrome.1`");
  command->callback([&app] { fmt::print("{}", manual_page(command_tree(app))); });
}

}  // namespace servodrome::app
