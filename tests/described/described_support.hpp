#pragma once

#include <fmt/format.h>
#include <fstream>
#include <gtest/gtest.h>
#include <memory>
#include <string>

#include "described/blueprint.hpp"
#include "drive/drive.hpp"
#include "line/described_product.hpp"
#include "line/line.hpp"
#include "line/line_file.hpp"
#include "source_dir.hpp"

// One described drive on a line in virtual time, operated through its objects like a master does.
namespace servodrome::described::test {

using namespace std::chrono_literals;
using dictionary::AbortCode;

inline std::string data_file(const std::string& name) {
  return std::string(SERVODROME_SOURCE_DIR "/tests/data/described/") + name;
}

inline std::string line_text(const std::string& file, std::uint32_t counts, bool ethercat = false,
                             const std::string& more = {}) {
  return fmt::format(
      "clock = \"virtual\"\n[[bus]]\nname = \"bus\"\ntype = \"{}\"\n[[axis]]\nname = \"axis\"\ndescription = "
      "\"{}\"\n{}\n"
      "[axis.travel]\ncounts_per_unit = {}\nnegative_limit = -10\npositive_limit = 10\n"
      "home = {{ from = -0.5, to = 0.5 }}\n",
      ethercat ? "ethercat" : "can", file, more, counts);
}

inline line::LineSettings settings_of(const std::string& text) {
  line::LineFile file = line::parse_line_file(text, "", line::all_products());
  if (!file.diagnostics.empty()) throw std::runtime_error(to_string(file.diagnostics.front()));
  return std::move(file.settings);
}

class Rig {
 public:
  explicit Rig(const std::string& file, const std::string& more = {}, const std::string& device = {})
      : product(line::describe_product(file, device)),
        ethercat(product->fieldbus == line::Fieldbus::ethercat),
        line_(settings_of(line_text(file, counts(), ethercat, more))) {
    pass(50ms);
  }

  std::uint32_t counts() const {
    return product->blueprint->encoder_counts != 0 ? product->blueprint->encoder_counts : 131072;
  }
  line::Axis& axis() { return *line_.axes().front(); }
  dictionary::Dictionary& objects() { return axis().device().bus_dictionary(); }
  const Blueprint& blueprint() const { return *product->blueprint; }
  line::Line& line() { return line_; }

  void pass(line::Time span) { line_.run_until(line_.now() + span); }
  std::int64_t read(std::uint16_t index, std::uint8_t sub = 0) { return objects().number(index, sub); }
  AbortCode write(std::uint16_t index, std::uint8_t sub, std::int64_t value) {
    return objects().set_number(index, sub, value);
  }
  void set(std::uint16_t index, std::int64_t value) {
    ASSERT_EQ(write(index, 0, value), AbortCode::none) << fmt::format("{:04X}h", index);
  }
  // 6061h shows the mode if the mode object is write-only.
  void enable(std::int64_t mode) {
    set(0x6060, mode);
    for (const int word : {0x06, 0x07, 0x0F}) {
      set(0x6040, word);
      pass(50ms);
    }
    ASSERT_EQ(read(0x6041) & 0x6F, 0x27) << fmt::format("statusword {:04X}h", read(0x6041));
    ASSERT_EQ(read(0x6061), mode);
  }
  bool wait_for(std::int64_t bits, line::Time most = 60s) {
    for (line::Time waited{}; waited < most; waited += 10ms) {
      if ((read(0x6041) & bits) == bits) return true;
      pass(10ms);
    }
    return false;
  }
  void home(std::int64_t method) {
    enable(6);
    set(0x6098, method);
    set(0x6040, 0x1F);
    ASSERT_TRUE(wait_for(0x1400)) << fmt::format("statusword {:04X}h", read(0x6041));
    set(0x6040, 0x0F);
    pass(20ms);
  }
  // Moves to a position in user units, in profile position.
  void move(std::int64_t target) {
    enable(1);
    set(0x607A, target);
    set(0x6040, 0x1F);
    ASSERT_TRUE(wait_for(0x1000));
    set(0x6040, 0x0F);
    pass(10ms);
    ASSERT_TRUE(wait_for(0x0400)) << fmt::format("statusword {:04X}h", read(0x6041));
  }

  std::shared_ptr<const line::Product> product;
  bool ethercat;

 private:
  line::Line line_;
};

}  // namespace servodrome::described::test
