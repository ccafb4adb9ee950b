#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <span>
#include <string>

#include "app/drive_link.hpp"
#include "host/object_catalogue.hpp"

// Objects as the command line names them, and prints them as JSON.
namespace servodrome::app {

// ObjectCatalogue::resolve; throws Failure, since the user named it.
host::ObjectAddress resolve(const host::ObjectCatalogue& catalogue, const std::string& text);
// Does the catalogue have an object of this name or address?
bool knows(const host::ObjectCatalogue& catalogue, const std::string& text);

// A number, a text, true or false; null where the type is not known, or is none of these.
nlohmann::ordered_json value_json(std::span<const std::byte> bytes, std::optional<dictionary::Type> type);
// {"node", "object", "index", "sub", "name", "type", "value", "bytes"}; without "value" where that would be null.
nlohmann::ordered_json object_json(const host::ObjectCatalogue& catalogue, unsigned node_id, host::ObjectAddress object,
                                   std::span<const std::byte> bytes, std::optional<dictionary::Type> type);

// What objects are called on a command line: as --eds says, or the standard, or the product that the drive is.
class ObjectNames {
 public:
  // `eds`: the path given, or "". Throws Failure if it cannot be read.
  explicit ObjectNames(const std::string& eds);

  const host::ObjectCatalogue& without_drive() const { return given_; }
  bool has_eds() const { return has_eds_; }
  // The drive is asked which product it is: names may be the maker's own, and types and units other than the
  // standard's.
  const host::ObjectCatalogue& of(DriveLink& link) const;

 private:
  bool has_eds_;
  host::ObjectCatalogue given_;
};

}  // namespace servodrome::app
