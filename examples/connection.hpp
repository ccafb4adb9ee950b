#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "line/line.hpp"
#include "master/canopen/bus.hpp"
#include "master/ethercat/master.hpp"
#include "master/object_client.hpp"

// The connection of a program to its drives: over the link that the command line names, or, without a link, to a line
// in the program's own process, in virtual time. The rest of the program is the same in both cases.
namespace examples {

class Can {
 public:
  // `link`: empty for the line in `line_file` (of lines/).
  Can(std::string_view link, std::string_view line_file);

  servodrome::master::Bus& bus() { return *bus_; }

 private:
  std::unique_ptr<servodrome::line::Line> line_;
  std::unique_ptr<servodrome::master::Bus> bus_;
  servodrome::master::Bus::Subscription watching_;  // for Ctrl-C, while the bus runs
};

class Ethercat {
 public:
  Ethercat(std::string_view link, std::string_view line_file);
  // The program's own line, as a line file describes it.
  static Ethercat on_line(std::string_view link, std::string_view line_text);

  servodrome::master::EthercatMaster& master() { return *master_; }
  // The line in this process, which has the true shaft positions; nullptr if the program uses a link.
  servodrome::line::Line* line() { return line_.get(); }

 private:
  Ethercat() = default;
  void open(std::string_view link, std::string_view text, const std::string& name);

  std::unique_ptr<servodrome::line::Line> line_;
  std::unique_ptr<servodrome::master::EthercatMaster> master_;
};

// Returns true after Ctrl-C. A program that waits by itself must poll it. The places that use it describe what stops
// the axis.
bool interrupted();
void throw_if_interrupted();

// For programs that write controlwords themselves: commands a quick stop if an exception (Ctrl-C also causes one) ends
// the program.
class QuickStopOnFailure {
 public:
  explicit QuickStopOnFailure(servodrome::master::ObjectClient& drive);
  ~QuickStopOnFailure();
  QuickStopOnFailure(const QuickStopOnFailure&) = delete;
  QuickStopOnFailure& operator=(const QuickStopOnFailure&) = delete;

 private:
  servodrome::master::ObjectClient& drive_;
  int exceptions_;
};

// Throws if `is` differs from the expected value, so that a program that failed ends with exit status 1.
void expect_near(const char* what, double is, double should_be, double tolerance);

// main() calls it: runs `program` with the given link, or with "". Prints an error; exit status 0, 1 on an error, or 2
// for wrong use.
int run(int argc, char** argv, const char* usage, const std::function<void(std::string_view link)>& program);

}  // namespace examples
