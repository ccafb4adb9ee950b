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

// Where a program's drives are: behind the link that its command line names, or, without one, on a line in the
// program's own process, in virtual time. What comes after is the same.
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
  // A line of one's own, as a line file has it.
  static Ethercat on_line(std::string_view link, std::string_view line_text);

  servodrome::master::EthercatMaster& master() { return *master_; }
  // The line in this process, with the true shafts; nullptr behind a link.
  servodrome::line::Line* line() { return line_.get(); }

 private:
  Ethercat() = default;
  void open(std::string_view link, std::string_view text, const std::string& name);

  std::unique_ptr<servodrome::line::Line> line_;
  std::unique_ptr<servodrome::master::EthercatMaster> master_;
};

// Ctrl-C was pressed. A program that waits by itself asks for it; what stops the axis is said where it is used.
bool interrupted();
void throw_if_interrupted();

// For programs that write controlwords themselves: a quick stop when they are left by an exception, Ctrl-C among them.
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

// Throws if `is` is not what it should be, so that a program that went wrong ends with exit status 1.
void expect_near(const char* what, double is, double should_be, double tolerance);

// main(): runs `program` with the link that was given, or "". Says what went wrong; exit status 0, 1, or 2 for wrong
// use.
int run(int argc, char** argv, const char* usage, const std::function<void(std::string_view link)>& program);

}  // namespace examples
