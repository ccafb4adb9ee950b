#pragma once

#include "master/ethercat/operation.hpp"

namespace servodrome::master {

// The objects of an EtherCAT slave. Access is by SDO, except for objects that are mapped in a running exchange: these
// use the process data, because the next cycle would overwrite a value written by SDO. A write to a mapped object
// returns when the slave has applied it.
//
// A slave whose application hangs still exchanges process data with a correct working counter, but its inputs do not
// change. So if the inputs do not change for `longest_unchanged`, upload() compares statusword and position with their
// values by SDO. If the values differ, or the SDO gets no answer, it throws EthercatError. After a difference, upload()
// reads objects by SDO only. After an SDO without an answer, it uses the inputs for another `longest_unchanged` before
// it compares them again. In both cases the caller can still stop the axis.
class CoeObjects final : public ObjectClient {
 public:
  static constexpr Time longest_unchanged = std::chrono::milliseconds(500);

  // `slave`, and `exchange` in which the slave is number `member`, must outlive this. Without an exchange all access is
  // by SDO.
  explicit CoeObjects(EthercatSlave& slave) : slave_(slave) {}
  CoeObjects(EthercatSlave& slave, CyclicExchange& exchange, std::size_t member)
      : slave_(slave), exchange_(&exchange), member_(member) {}

  std::vector<std::byte> upload(ObjectAddress object) override;
  void download(ObjectAddress object, std::span<const std::byte> data) override;
  Time now() const override { return slave_.master().now(); }
  // Throws EthercatError if the slave has left OP or does not answer any more. Other slaves of the exchange may.
  void wait(Time span) override;
  // Position of the slave on the segment; 1: the first.
  std::uint16_t address() const override { return slave_.found().position; }
  std::string where() const override { return slave_.where(); }
  std::optional<Emergency> latest_emergency() override;

  EthercatSlave& slave() { return slave_; }

 private:
  void set_wait_limit(std::optional<Time> longest) override { slave_.limit_wait(longest); }
  bool exchanges() const { return exchange_ != nullptr && exchange_->runs(); }
  bool inputs_have_changed() const;
  void watch_inputs();
  // True if the value by SDO differs from the input in one of the bits `mask`, or by more than `tolerance`, while the
  // inputs do not change.
  bool differs(ObjectAddress object, std::uint32_t mask, std::int64_t tolerance);

  EthercatSlave& slave_;
  CyclicExchange* exchange_ = nullptr;
  std::size_t member_ = 0;
  std::vector<std::uint8_t> inputs_;  // as the last upload() found them
  // Time of the last change of an input or, if it is later, of the last comparison or the first write of an output
  // after a comparison.
  Time unchanged_since_{};
  bool compared_ = false;  // by SDO, with fresh inputs, since the last change of an input or write of an output
  bool inputs_are_stale_ = false;
};

}  // namespace servodrome::master
