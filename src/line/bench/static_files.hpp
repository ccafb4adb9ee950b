#pragma once

#include <filesystem>
#include <string>

#include "line/bench/http.hpp"

namespace servodrome::line::bench {

// The files of the studio's page, and nothing beside them: GET / and everything that is no address of the API. What has
// no dot in its name is a place within the page.
class StaticFiles {
 public:
  // A folder that has no index.html serves a note that says how to build the page; so does an empty name.
  explicit StaticFiles(const std::string& folder);

  bool has_page() const { return !folder_.empty(); }
  Response answer(const Request& request) const;

 private:
  std::filesystem::path folder_;  // without links; empty: there is no page
};

}  // namespace servodrome::line::bench
