#pragma once

#include "api/change_log.hpp"
#include "studio/commissioning.hpp"

namespace servodrome::studio {

// The change log over the API: it is shown, and changes are undone. docs/bench-api.md, "Changes".
class ChangeRoutes {
 public:
  // Both must outlive this object.
  ChangeRoutes(const api::ChangeLog& log, Subjects& subjects) : log_(log), subjects_(subjects) {}

  api::RouteGroup group();

  const api::ChangeLog& log() const { return log_; }
  Subjects& subjects() { return subjects_; }

 private:
  const api::ChangeLog& log_;
  Subjects& subjects_;
};

// A change in the form of the API.
api::Json view_of(const api::Change& change, const api::ChangeLog& log);

}  // namespace servodrome::studio
