#pragma once

#include <gtest/gtest.h>

#include "dictionary/medium.hpp"
#include "ethercat_rig.hpp"

// FoE with a device, like a master's file transfer.
namespace servodrome::test {

template <typename DeviceType>
struct FoeRig : EthercatRig<DeviceType> {
  using EthercatRig<DeviceType>::EthercatRig;
  static constexpr std::size_t packet = EthercatRig<DeviceType>::mailbox_bytes - 12;

  struct FoeAnswer {
    unsigned operation = 0;  // 3 data, 4 acknowledgement, 5 error
    std::uint32_t value = 0;
    std::string text;
  };
  FoeAnswer foe(std::uint8_t operation, std::uint32_t value, const std::string& data) {
    Bytes content = little_endian(operation, std::uint8_t{0}, value);
    content.insert(content.end(), data.begin(), data.end());
    this->post(4, content);
    const Bytes mail = this->fetch();
    if (mail.size() < 12) return {};
    EXPECT_EQ(mail[5] & 0x0F, 4);
    return {mail[6], ethercat::load_u32(&mail[8]), std::string(mail.begin() + 12, mail.end())};
  }
  // Returns the file; after an error "!", its code and its text.
  std::string receive(const std::string& name) {
    std::string all;
    for (FoeAnswer answer = foe(1, 0, name);;) {
      if (answer.operation != 3) return failure(answer);
      all += answer.text;
      const bool last = answer.text.size() < packet;
      answer = foe(4, answer.value, "");
      if (last) return all;
    }
  }
  // Returns "" if the file was accepted.
  std::string transmit(const std::string& name, const std::string& text) {
    FoeAnswer answer = foe(2, 0, name);
    std::uint32_t number = 0;
    for (std::size_t at = 0; answer.operation == 4; at += packet) {
      EXPECT_EQ(answer.value, number);
      if (at > text.size()) return "";
      answer = foe(3, ++number, text.substr(at, packet));
      if (answer.operation == 4 && text.size() - at < packet) return "";
    }
    return failure(answer);
  }

 private:
  static std::string failure(const FoeAnswer& answer) {
    std::array<char, 16> code{};
    std::snprintf(code.data(), code.size(), "!%04X ", answer.value);
    return code.data() + answer.text;
  }
};

}  // namespace servodrome::test
