#pragma once

#include <functional>

#include "axis/axis402.hpp"
#include "tools/script/script.hpp"

namespace servodrome::master::script {

// A script failed at a step: what() is "FILE:LINE:COLUMN: message". The axes have been commanded to stop.
class ScriptFailure : public std::runtime_error {
 public:
  ScriptFailure(const std::string& file, Place place, const std::string& message);
  Place place() const { return place_; }
  const std::string& message() const { return message_; }

 private:
  Place place_;
  std::string message_;
};

struct RunOptions {
  // Callbacks before and after each step; `said` is the output of the step ("6064:00 = 5"), empty for most.
  std::function<void(const Step&)> began{};
  std::function<void(const Step&, Time took, const std::string& said)> done{};
  Axis402::Progress progress{};       // called during motions
  std::function<bool()> cancelled{};  // true ends the script; must be the same as in the options of the axes
  Time poll_interval = std::chrono::milliseconds(5);
};

// Runs a script. `axes`: the axes that it declares, in that order, on one bus.
//
// Before any motion it reads the data that it needs from the axes: their units, and the size of objects that are not in
// the catalogue. During every wait it monitors the axes that it has enabled: a fault ends the script. At the end, also
// after an error, it stops every axis that it has enabled. These axes remain enabled at rest.
//
// Throws ScriptFailure.
void run(const Script& script, std::span<Axis402* const> axes, const RunOptions& options = {});

}  // namespace servodrome::master::script
