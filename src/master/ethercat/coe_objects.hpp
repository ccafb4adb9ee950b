#pragma once

#include "master/ethercat/operation.hpp"

namespace servodrome::master {

// The objects of an EtherCAT slave. Access is by SDO, except for objects that are mapped in a running exchange: these
// use the process data, because the next cycle would overwrite a value written by SDO. A write to a mapped object
// returns when the slave has applied it.
class CoeObjects final : public ObjectClient {
 public:
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
  bool exchanges() const { return exchange_ != nullptr && exchange_->runs(); }

  EthercatSlave& slave_;
  CyclicExchange* exchange_ = nullptr;
  std::size_t member_ = 0;
};

}  // namespace servodrome::master
