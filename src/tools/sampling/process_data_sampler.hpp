#pragma once

#include "axis/cyclic/cyclic_bus.hpp"
#include "tools/sampling/sampler.hpp"

namespace servodrome::master::sampling {

// Set-up of a drive for sampling, for as long as this object exists.
class Session {
 public:
  virtual ~Session() = default;
  virtual ObjectClient& objects() = 0;
  // Restores what was changed. Throws MasterError.
  virtual void close() {}
};

// A session whose process data contain the channels.
class ProcessDataSession : public Session {
 public:
  virtual CyclicBus& bus() = 0;  // of this one drive
};

// Divides a sampling period into cycles of at most `longest`.
struct CyclePeriod {
  Time cycle{};
  unsigned cycles = 1;  // cycles between two samples
};
CyclePeriod cycles_of(Time period, Time longest);

// The channels must be inputs of the session.
std::unique_ptr<Sampler> make_process_data_sampler(std::unique_ptr<ProcessDataSession> session,
                                                   std::vector<Channel> channels, unsigned cycles, std::string way);

// Samples by reading the session's objects.
std::unique_ptr<Sampler> make_polled_sampler(std::unique_ptr<Session> session, std::vector<Channel> channels,
                                             Time period, std::string way);

}  // namespace servodrome::master::sampling
