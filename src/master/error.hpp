#pragma once

#include <stdexcept>
#include <string>

namespace servodrome::master {

// The error of master, axis and tools, and the base class of their specific errors. It contains what happened, where
// (link, node, object), and the remedy. what() joins the three in one sentence.
class MasterError : public std::runtime_error {
 public:
  MasterError(std::string happened, std::string where, std::string remedy)
      : std::runtime_error(where + ": " + happened + "; " + remedy),
        happened_(std::move(happened)),
        where_(std::move(where)),
        remedy_(std::move(remedy)) {}

  const std::string& happened() const { return happened_; }
  const std::string& where() const { return where_; }
  const std::string& remedy() const { return remedy_; }

 private:
  std::string happened_;
  std::string where_;
  std::string remedy_;
};

}  // namespace servodrome::master
