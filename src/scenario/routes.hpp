#pragma once

#include <memory>

#include "api/routes.hpp"
#include "line/line.hpp"

namespace servodrome::scenario {

class Director;

// The routes of the API for a scenario on a running line: GET, PUT and DELETE /api/v1/scenario, POST .../master,
// GET .../actions, GET and POST .../rules, and DELETE .../rules/NAME.
class Routes {
 public:
  explicit Routes(line::Line& line);
  ~Routes();
  Routes(const Routes&) = delete;
  Routes& operator=(const Routes&) = delete;

  static std::span<const api::Route> table();
  // The group refers to this object.
  api::RouteGroup group() { return {table(), this}; }

  enum class Extra : std::uint8_t { none, standard_expectations };
  // Begins a scenario in place of the present one, and returns its director, which is valid until the next one begins.
  // Throws ApiError with line and column of the first error; the present scenario then goes on.
  Director& begin(const std::string& text, const std::string& file, Extra extra);
  // The director of the present scenario, or of the last one; nullptr: no scenario has begun yet.
  Director* director() const { return director_.get(); }

  // The present scenario is part of a trial: until end_trial() requests neither replace nor end it.
  void begin_trial() { in_trial_ = true; }
  void end_trial() { in_trial_ = false; }

  // Begins a scenario in place of the present one. Throws ApiError with line and column of the first error, and
  // ApiError 409 during a trial.
  api::Json begin(const std::string& body);
  // The rules and verdicts of the present scenario, or of the last one. Throws ApiError 404 if no scenario has begun
  // yet.
  api::Json show() const;
  // The rules of the present scenario; empty if there is no scenario.
  api::Json rules() const;
  // Adds the rules of a text to the present scenario. Without one, a scenario without rules begins first. Throws
  // ApiError.
  api::Json add_rules(const std::string& body);
  // Removes a rule from the scenario. Throws ApiError 404, and ApiError 409 for a rule of a running
  // trial that add_rules() has not added.
  api::Json remove_rule(const std::string& name);
  // Reports that the master has ended: {"success": true}.
  api::Json master_ended(const std::string& body);
  // Ends the scenario and decides its expectations. Throws ApiError 409 during a trial.
  api::Json end();

 private:
  void begin(std::unique_ptr<Director> next);
  void refuse_in_trial() const;

  line::Line& line_;
  std::unique_ptr<Director> director_;
  bool in_trial_ = false;
};

}  // namespace servodrome::scenario
