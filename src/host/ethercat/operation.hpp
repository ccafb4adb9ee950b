#pragma once

#include "host/ethercat/cyclic_exchange.hpp"
#include "host/ethercat/distributed_clocks.hpp"

namespace servodrome::host {

struct OperationOptions {
  CyclicOptions cyclic{};
  // SYNC0 of the period, where the slave's SII has a DC mode with SYNC0; else free run.
  bool distributed_clocks = false;
  ClockOptions clock{};
  Time sync0_shift{0};
  // Frames come this long before SYNC0; half a period if not given.
  std::optional<Time> before_sync0{};
  // 10F1h sub 2, which lost cycles a slave bears in operation with SYNC0 (each adds 3, one that came takes 1 away; 0:
  // any number); as the slave has it if not given.
  std::optional<std::uint16_t> sync_error_limit{};
  // No further than SAFEOP: inputs come, outputs do not act (ETG.1000.6 6.4.1).
  bool inputs_only = false;
};

// 1C32h and 1C33h sub 1, in PREOP: SYNC0, or free run where the slave knows it, or sync manager events. A slave that
// has no such object, or does not let it be written, decides by itself.
void set_synchronisation(EthercatSlave& slave, bool sync0);

// Takes slaves to OP (or SAFEOP) and keeps them there, as long as it lives and the master waits; then back to PREOP.
// Outputs begin with the values that the objects have. All calls throw EthercatError or CoeError.
class EthercatOperation {
 public:
  // `line`: all slaves of the segment, for the clocks. `slaves` outlive this.
  EthercatOperation(EthercatMaster& master, std::span<const FoundSlave> line, std::span<EthercatSlave* const> slaves,
                    const OperationOptions& options = {});
  ~EthercatOperation();
  EthercatOperation(const EthercatOperation&) = delete;
  EthercatOperation& operator=(const EthercatOperation&) = delete;

  CyclicExchange& exchange() { return *exchange_; }
  const CyclicExchange& exchange() const { return *exchange_; }
  // Nothing without distributed clocks.
  std::optional<DistributedClocks>& clocks() { return clocks_; }
  std::size_t member_of(const EthercatSlave& slave) const;

 private:
  void start_clocks(std::span<const FoundSlave> line, const OperationOptions& options);
  void take_present_values();

  EthercatMaster& master_;
  std::vector<EthercatSlave*> slaves_;
  std::optional<DistributedClocks> clocks_;
  std::uint64_t sync0_start_ = 0;
  std::optional<CyclicExchange> exchange_;
};

}  // namespace servodrome::host
