#pragma once

#include <filesystem>
#include <string>

#include "api/http.hpp"

namespace servodrome::api {

// Serves only the files of the studio's page: GET / and every address outside the API. An address without a dot is a
// place within the page and returns index.html.
class StaticFiles {
 public:
  // If the folder's name is empty or it has no index.html, the server returns a note that explains how to build the
  // page.
  explicit StaticFiles(const std::string& folder);

  bool has_page() const { return !folder_.empty(); }
  Response answer(const Request& request) const;

 private:
  std::filesystem::path folder_;  // symbolic links resolved; empty: there is no page
};

}  // namespace servodrome::api
