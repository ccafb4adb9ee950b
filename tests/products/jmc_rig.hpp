#pragma once

#include "ethercat_rig.hpp"
#include "line/model_plant.hpp"
#include "products/jmc_ec/jmc_ec.hpp"

// A JMC EC drive of one of its ratings, with the corresponding plant.
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

// With factory settings: P01-02 standard, rigidity 13, which is slow.
struct FactoryJmcRig : EthercatRig<products::JmcEc> {
  explicit FactoryJmcRig(std::string_view rating = products::jmc_ec::default_rating)
      : EthercatRig(jmc_plant(rating), jmc_settings(rating)) {}
  FactoryJmcRig(const plant::Parameters& parameters, const products::Settings& settings)
      : EthercatRig(parameters, settings) {}

  // Panel parameters in the steps of the manual.
  dictionary::AbortCode set_panel(std::uint8_t group, std::uint8_t number, std::int64_t value) {
    const products::jmc_ec::ParameterId id{group, number};
    return set(id.index(), id.sub(), value);
  }
  std::int64_t panel(std::uint8_t group, std::uint8_t number) {
    const products::jmc_ec::ParameterId id{group, number};
    return get(id.index(), id.sub());
  }
  std::int64_t monitor(std::uint8_t item) {
    return get(products::jmc_ec::monitor_index, static_cast<std::uint8_t>(item + 1));
  }

  // Removes the limits of the default gear: 607Fh is 216 rpm, 60C5h 25 rev/s^2.
  void open_limits() {
    set(0x607F, 0, 400000);
    set(0x60C5, 0, 4000000);
    set(0x60C6, 0, 4000000);
    set(0x6083, 0, 400000);
    set(0x6084, 0, 400000);
    set(0x6085, 0, 800000);
  }

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

// Commissioned with manual gains, so that motion is fast and exact. Without a memory a power cycle restores the factory
// settings.
struct JmcRig : FactoryJmcRig {
  explicit JmcRig(std::string_view rating = products::jmc_ec::default_rating) : FactoryJmcRig(rating) { commission(); }
  JmcRig(const plant::Parameters& parameters, const products::Settings& settings)
      : FactoryJmcRig(parameters, settings) {
    commission();
  }

 private:
  void commission() {
    set_panel(1, 2, 0);     // manual gains
    set_panel(2, 0, 1000);  // position 100/s
    set_panel(2, 10, 700);  // velocity 70 Hz,
    set_panel(2, 11, 150);  // integral 15 ms,
    set_panel(2, 3, 1000);  // full feed-forwards, without delay
    set_panel(2, 4, 0);
    set_panel(2, 19, 100);
    set_panel(2, 20, 0);
    set_panel(8, 19, 30);  // filters 0.3 ms
    set_panel(8, 20, 20);
  }
};

}  // namespace servodrome::test
