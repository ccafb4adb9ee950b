#pragma once

#include <functional>

#include "host/axis402.hpp"
#include "host/script/script.hpp"

namespace servodrome::host::script {

// A script stopped at a step: what() is "FILE:LINE:COLUMN: message". The axes were told to stop.
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
  // Before and after each step; the second with what it has to say ("6064:00 = 5", empty for most).
  std::function<void(const Step&)> began{};
  std::function<void(const Step&, Time took, const std::string& said)> done{};
  Axis402::Progress progress{};       // of motions
  std::function<bool()> cancelled{};  // true ends the script; the same as the axes have in their options
  Time poll_interval = std::chrono::milliseconds(5);
};

// Carries out a script. `axes` are those it declares, in that order, on one bus.
//
// Before anything moves it asks the axes for what it needs: their units, and the size of objects whose type the
// catalogue does not have. However it ends, every axis that it enabled is told to stop, and is left enabled at rest.
// Axes that it has enabled are watched in every wait: a fault ends the script.
//
// Throws ScriptFailure.
void run(const Script& script, std::span<Axis402* const> axes, const RunOptions& options = {});

}  // namespace servodrome::host::script
