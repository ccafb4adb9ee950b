#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "axis/object_catalogue.hpp"
#include "catalogue/product.hpp"
#include "dictionary/entry.hpp"
#include "master/ethercat/coe_client.hpp"

namespace servodrome::master {

// A parameter of a drive: an object that can be read and written and is not a command.
struct Parameter {
  ObjectAddress address{};
  dictionary::Type type = dictionary::Type::unsigned32;
  std::string name{};  // for example "Homing speeds.Speed during search for switch"
  std::string unit{};
  // Limits of numbers other than REAL32, from the dictionary; nullopt: only the type limits the value.
  std::optional<std::int64_t> minimum{};
  std::optional<std::int64_t> maximum{};
  std::optional<std::int64_t> factory{};  // factory value without the node-ID; of a REAL32 its bits
  bool adds_node_id = false;              // the factory value is `factory` + node-ID
  bool retained = true;                   // the drive can store it in non-volatile memory
};

// All parameters of one kind of drive, sorted by address.
class ParameterList {
 public:
  // From the product's own table. `with_connection`: includes the connection settings, such as node-ID and bit rate.
  static ParameterList of_dictionary(std::span<const dictionary::Entry> table, const catalogue::ParameterRules& rules,
                                     bool with_connection = false);
  // From an electronic data sheet, which does not define what a drive can store.
  static ParameterList of_data_sheet(const ObjectCatalogue& sheet, const catalogue::ParameterRules& rules,
                                     bool with_connection = false);
  // From the SDO information of an EtherCAT slave (ETG.1000.6 clause 5.6.3). Throws MasterError.
  static ParameterList of_slave(CoeClient& coe, const catalogue::ParameterRules& rules, bool with_connection = false);

  const std::vector<Parameter>& all() const { return parameters_; }
  const Parameter* find(ObjectAddress address) const;
  const catalogue::ParameterRules& rules() const { return *rules_; }

 private:
  explicit ParameterList(const catalogue::ParameterRules& rules) : rules_(&rules) {}
  void add(Parameter parameter, bool with_connection);

  const catalogue::ParameterRules* rules_;
  std::vector<Parameter> parameters_;
};

}  // namespace servodrome::master
