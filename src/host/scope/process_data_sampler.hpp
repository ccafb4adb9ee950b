#pragma once

#include "host/cyclic/cyclic_bus.hpp"
#include "host/scope/sampler.hpp"

namespace servodrome::host::scope {

// What was set up at a drive to sample it, for as long as it lives.
class Session {
 public:
  virtual ~Session() = default;
  virtual ObjectClient& objects() = 0;
  // Puts back what was changed. Throws HostError.
  virtual void close() {}
};

// Process data that hold the channels.
class ProcessDataSession : public Session {
 public:
  virtual CyclicBus& bus() = 0;  // of the one drive
};

// How a period of samples is made of cycles: none is longer than `longest`.
struct CyclePeriod {
  Time cycle{};
  unsigned cycles = 1;  // from sample to sample
};
CyclePeriod cycles_of(Time period, Time longest);

// The channels are among the session's inputs.
std::unique_ptr<Sampler> make_process_data_sampler(std::unique_ptr<ProcessDataSession> session,
                                                   std::vector<Channel> channels, unsigned cycles, std::string way);

// By reading the session's objects.
std::unique_ptr<Sampler> make_polled_sampler(std::unique_ptr<Session> session, std::vector<Channel> channels,
                                             Time period, std::string way);

}  // namespace servodrome::host::scope
