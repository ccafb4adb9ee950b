#pragma once

#include "host/ethercat/operation.hpp"

namespace servodrome::host {

// The objects of an EtherCAT slave: by SDO, and those among the process data of a running exchange by it, since the
// next cycle would overwrite what an SDO writes there. A write of one of these returns when the slave has acted on it.
class CoeObjects final : public ObjectClient {
 public:
  // `slave` and `exchange`, in which it is `member`, outlive this. Without exchange: by SDO only.
  explicit CoeObjects(EthercatSlave& slave) : slave_(slave) {}
  CoeObjects(EthercatSlave& slave, CyclicExchange& exchange, std::size_t member)
      : slave_(slave), exchange_(&exchange), member_(member) {}

  std::vector<std::byte> upload(ObjectAddress object) override;
  void download(ObjectAddress object, std::span<const std::byte> data) override;
  Time now() const override { return slave_.master().now(); }
  // Throws EthercatError when the slave has left OP meanwhile, or is not there any more.
  void wait(Time span) override;
  // Its position, 1 for the first.
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

}  // namespace servodrome::host
