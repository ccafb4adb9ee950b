#pragma once

#include <algorithm>
#include <array>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "line/bench/line_bench.hpp"
#include "line/support.hpp"
#include "links/ethercat/memory_client.hpp"
#include "master/ethercat/scan.hpp"
#include "master/ethercat/slave.hpp"
#include "studio/change_routes.hpp"
#include "studio/commissioning.hpp"
#include "studio/jobs.hpp"
#include "studio/line_changes.hpp"

namespace servodrome::studio {

// An axis of each product, named after it, in virtual time, and their bench API.
class CommissioningRig : public testing::Test {
 protected:
  // `only`: the name of the only product; empty: all.
  static std::string line_of_all(const std::string& only = "") {
    std::string text = "clock = \"virtual\"\n[[bus]]\nname = \"can0\"\n[[bus]]\nname = \"ecat\"\ntype = \"ethercat\"\n";
    int node = 0;
    for (const line::Product& product : line::all_products()) {
      if (!only.empty() && product.name != only) continue;
      const bool can = product.fieldbus == line::Fieldbus::can;
      text += fmt::format("[[axis]]\nname = \"{0}\"\nproduct = \"{0}\"\nbus = \"{1}\"\n", product.name,
                          can ? "can0" : "ecat");
      if (can) text += fmt::format("node = {}\n", ++node);
    }
    return text;
  }
  CommissioningRig() : CommissioningRig(line_of_all()) {}
  explicit CommissioningRig(const std::string& line_file) : line_(line::test::settings_of(line_file)) {
    pass(std::chrono::milliseconds(300));
  }

  api::Response ask(api::Method method, const std::string& target, const std::string& body = {}) {
    const std::array groups{parameter_routes(subjects_), pdo_routes(subjects_), jobs_.routes(), change_routes_.group()};
    return line::bench::handle(
        line_, {.method = method, .target = "/api/v1/" + target, .body = body, .client = client_}, groups);
  }
  // Returns the answer of a request that must succeed.
  nlohmann::json json_of(api::Method method, const std::string& target, const std::string& body = {}) {
    const api::Response response = ask(method, target, body);
    EXPECT_LT(response.status, 300U) << target << " " << response.body;
    return response.body.empty() ? nlohmann::json() : nlohmann::json::parse(response.body);
  }
  nlohmann::json get(const std::string& target) { return json_of(api::Method::get, target); }
  nlohmann::json value(const std::string& axis, const std::string& object) {
    return get("axes/" + axis + "/objects/" + object)["value"];
  }
  // All slaves, as a master does.
  void to_pre_operational() {
    master::EthercatMaster master(std::make_unique<links::MemoryEthercatClient>(line_.ethercat_buses()[0]->bus, line_));
    for (const master::FoundSlave& found : master::scan_slaves(master)) {
      master::EthercatSlave(master, found).to_pre_operational();
    }
  }
  void pass(line::Time span) { line_.run_until(line_.now() + span); }
  // Returns the job when it is over, or after `longest`; polls every `look`.
  nlohmann::json over(nlohmann::json job, line::Time longest, line::Time look) {
    for (const line::Time end = line_.now() + longest; line_.now() < end && job["state"] == "running";) {
      pass(look);
      job = get(fmt::format("jobs/{}", job["id"].get<int>()));
    }
    return job;
  }

  std::string client_{};  // sender of the requests, for the change log
  line::Line line_;
  LineChanges changes_{line_};
  LineJobs jobs_{line_};
  LineSubjects subjects_{line_};
  ChangeRoutes change_routes_{changes_.log(), subjects_};
};

// A valid GoogleTest name for such a test.
inline std::string name_of_test(const testing::TestParamInfo<std::string>& product) {
  std::string name = product.param;
  std::replace(name.begin(), name.end(), '-', '_');
  return name;
}

// Names of the products, as parameters of tests.
inline std::vector<std::string> names_of_products() {
  std::vector<std::string> names;
  for (const line::Product& product : line::all_products()) names.emplace_back(product.name);
  return names;
}

}  // namespace servodrome::studio
