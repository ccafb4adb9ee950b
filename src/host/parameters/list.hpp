#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "dictionary/entry.hpp"
#include "host/ethercat/coe_client.hpp"
#include "host/object_catalogue.hpp"
#include "host/parameters/rules.hpp"

namespace servodrome::host {

// One parameter of a drive: an object that can be read and written and that is no command.
struct Parameter {
  ObjectAddress address{};
  dictionary::Type type = dictionary::Type::unsigned32;
  std::string name{};  // "Homing speeds.Speed during search for switch"
  std::string unit{};
  // Of numbers other than REAL32, as the dictionary has them; nothing: the type is the only limit.
  std::optional<std::int64_t> minimum{};
  std::optional<std::int64_t> maximum{};
  std::optional<std::int64_t> factory{};  // without what the node-ID adds; of a REAL32 its bits
  bool adds_node_id = false;              // the factory value is `factory` + node-ID
  bool retained = true;                   // the drive can keep it over power-off
};

// The parameters of one kind of drive, in order of address.
class ParameterList {
 public:
  // By the product's own table. `with_connection`: node-ID, bit rate and the like as well.
  static ParameterList of_dictionary(std::span<const dictionary::Entry> table, const ParameterRules& rules,
                                     bool with_connection = false);
  // By an electronic data sheet, which does not say what a drive keeps.
  static ParameterList of_data_sheet(const ObjectCatalogue& sheet, const ParameterRules& rules,
                                     bool with_connection = false);
  // By what an EtherCAT slave says of itself (SDO information, ETG.1000.6 clause 5.6.3). Throws HostError.
  static ParameterList of_slave(CoeClient& coe, const ParameterRules& rules, bool with_connection = false);

  const std::vector<Parameter>& all() const { return parameters_; }
  const Parameter* find(ObjectAddress address) const;
  const ParameterRules& rules() const { return *rules_; }

 private:
  explicit ParameterList(const ParameterRules& rules) : rules_(&rules) {}
  void add(Parameter parameter, bool with_connection);

  const ParameterRules* rules_;
  std::vector<Parameter> parameters_;
};

}  // namespace servodrome::host
