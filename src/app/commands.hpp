#pragma once

#include <CLI/CLI.hpp>
#include <memory>
#include <stdexcept>
#include <string>

namespace servodrome::app {

// Ends a command that could not do its task, with exit status 1 or 2. Caught in main.
class Failure : public std::runtime_error {
 public:
  static Failure did_not_work(const std::string& message) { return {1, message}; }
  static Failure wrong_use(const std::string& message) { return {2, message}; }

  static Failure lost_output() {
    return did_not_work("the output is not complete: standard output could not be written; is the disk full?");
  }

  int exit_status() const { return exit_status_; }

 private:
  Failure(int exit_status, const std::string& message) : std::runtime_error(message), exit_status_(exit_status) {}

  int exit_status_;
};

// Prints to standard error, if possible; the command continues.
void warn(const std::string& message);

template <typename Options>
struct AddedCommand {
  CLI::App* command;
  Options* options;
};

// Adds a command to `app`, or a subcommand to a command. It calls `run` with its options; they live as long as `app`.
template <typename Options>
AddedCommand<Options> add_command(CLI::App& app, const std::string& name, const std::string& description,
                                  void (*run)(const Options&)) {
  const auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand(name, description);
  command->callback([options, run] { run(*options); });
  return {command, options.get()};
}

void add_up(CLI::App& app);
void add_check(CLI::App& app);
void add_products(CLI::App& app);
void add_export(CLI::App& app);
void add_scan(CLI::App& app);
void add_get(CLI::App& app);
void add_set(CLI::App& app);
void add_home(CLI::App& app);
void add_move(CLI::App& app);
void add_disable(CLI::App& app);
void add_monitor(CLI::App& app);
void add_nmt(CLI::App& app);
void add_prove(CLI::App& app);
void add_state(CLI::App& app);
void add_conform(CLI::App& app);
void add_faults(CLI::App& app);
void add_jog(CLI::App& app);
void add_torque(CLI::App& app);
void add_probe(CLI::App& app);
void add_run(CLI::App& app);
void add_params(CLI::App& app);
void add_sniff(CLI::App& app);
void add_studio(CLI::App& app);
void add_scope(CLI::App& app);
void add_tune(CLI::App& app);
void add_clone(CLI::App& app);
void add_fit(CLI::App& app);
void add_trial(CLI::App& app);
void add_changes(CLI::App& app);

}  // namespace servodrome::app
