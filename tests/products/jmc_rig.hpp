#pragma once

#include "ethercat_rig.hpp"
#include "line/model_plant.hpp"
#include "products/jmc_ec/jmc_ec.hpp"

// A JMC EC drive of one of its ratings on the plant that belongs to it.
namespace servodrome::test {

inline plant::Parameters jmc_plant(std::string_view rating = products::jmc_ec::default_rating) {
  plant::Parameters parameters;
  line::fit_model(products::jmc_ec::find_rating(rating).model, parameters);
  parameters.supply.charged_at_start = true;
  return parameters;
}

inline products::Settings jmc_settings(std::string_view rating = products::jmc_ec::default_rating) {
  products::Settings settings;
  settings.model = rating;
  return settings;
}

struct JmcRig : EthercatRig<products::JmcEc> {
  explicit JmcRig(std::string_view rating = products::jmc_ec::default_rating)
      : EthercatRig(jmc_plant(rating), jmc_settings(rating)) {}
  JmcRig(const plant::Parameters& parameters, const products::Settings& settings) : EthercatRig(parameters, settings) {}

  // Outputs and inputs of the first PDOs, 1600h and 1A00h.
  void control(std::uint16_t word) {
    if (outputs.empty()) {
      set(0x6040, 0, word);
    } else {
      put<std::uint16_t>(0, word);
      exchange();
    }
  }
};

}  // namespace servodrome::test
