#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <span>
#include <string>

#include "app/drive_link.hpp"
#include "axis/object_catalogue.hpp"

// Object names on the command line, and objects as JSON.
namespace servodrome::app {

// Calls ObjectCatalogue::resolve; throws Failure, since the name comes from the user.
master::ObjectAddress resolve(const master::ObjectCatalogue& catalogue, const std::string& text);
// Returns true if the catalogue contains an object with this name or address.
bool knows(const master::ObjectCatalogue& catalogue, const std::string& text);

// A number, a text, true or false; null if the type is unknown, or is none of these.
nlohmann::ordered_json value_json(std::span<const std::byte> bytes, std::optional<dictionary::Type> type);
// {"node", "object", "index", "sub", "name", "type", "value", "bytes"}; "value" is omitted if it would be null.
nlohmann::ordered_json object_json(const master::ObjectCatalogue& catalogue, unsigned node_id,
                                   master::ObjectAddress object, std::span<const std::byte> bytes,
                                   std::optional<dictionary::Type> type);

// The objects of --eds; nullopt: no path is given. Throws Failure if the file cannot be read.
std::optional<master::ObjectCatalogue> data_sheet(const std::string& eds);

// The source of object names for a command line: --eds, or the standard, or the drive's product.
class ObjectNames {
 public:
  // `eds`: the given path, or "". Throws Failure if it cannot be read.
  explicit ObjectNames(const std::string& eds);

  const master::ObjectCatalogue& without_drive() const {
    return sheet_ ? *sheet_ : master::ObjectCatalogue::standard();
  }
  bool has_eds() const { return sheet_.has_value(); }
  // Asks the drive for its product, since names, types and units may be specific to it.
  const master::ObjectCatalogue& of(DriveLink& link) const;

 private:
  std::optional<master::ObjectCatalogue> sheet_;
};

}  // namespace servodrome::app
