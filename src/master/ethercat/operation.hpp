#pragma once

#include "master/ethercat/cyclic_exchange.hpp"
#include "master/ethercat/distributed_clocks.hpp"

namespace servodrome::master {

struct OperationOptions {
  CyclicOptions cyclic{};
  // True: SYNC0, if the slave's SII has a DC mode with SYNC0: with the cycle of that mode, which usually is the period;
  // otherwise free run.
  bool distributed_clocks = false;
  ClockOptions clock{};
  Time sync0_shift{0};
  // Time from a frame to SYNC0; nullopt: half the shortest of the period and the cycles of SYNC0.
  std::optional<Time> before_sync0{};
  // Value for 10F1h sub 2, the limit of the slave's error counter for lost cycles with SYNC0: a lost cycle adds 3, a
  // received one subtracts 1; 0: no limit. nullopt: the slave's value is not changed.
  std::optional<std::uint16_t> sync_error_limit{};
  // True: stops at SAFEOP, where inputs arrive but outputs have no effect (ETG.1000.6 6.4.1).
  bool inputs_only = false;
};

// Writes 1C32h and 1C33h sub 1, in PREOP: SYNC0; or free run if the slave supports it, otherwise sync manager events.
// Does nothing if the slave does not have these objects or refuses the write.
void set_synchronisation(EthercatSlave& slave, bool sync0);

// Brings slaves to OP (or SAFEOP) and exchanges process data while this object exists and the master waits; the
// destructor returns them to PREOP. Outputs start with the present values of the objects. All calls throw EthercatError
// or CoeError.
class EthercatOperation {
 public:
  // `line`: all slaves of the segment, for the clocks. `slaves` must outlive this.
  EthercatOperation(EthercatMaster& master, std::span<const FoundSlave> line, std::span<EthercatSlave* const> slaves,
                    const OperationOptions& options = {});
  ~EthercatOperation();
  EthercatOperation(const EthercatOperation&) = delete;
  EthercatOperation& operator=(const EthercatOperation&) = delete;

  CyclicExchange& exchange() { return *exchange_; }
  const CyclicExchange& exchange() const { return *exchange_; }
  // nullopt without distributed clocks.
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

}  // namespace servodrome::master
