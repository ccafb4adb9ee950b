#pragma once

#include <vector>

#include "host/canopen/pdo_set_up.hpp"
#include "host/cyclic/cyclic_bus.hpp"
#include "host/object_client.hpp"

namespace servodrome::host {

// One drive whose objects are read and written one by one on a fixed grid of its client's clock, as if they were
// process data: for clients whose accesses are quick beside the period, as the service port of a simulated drive. The
// same accesses in the same order in every cycle, so that each is always as late as the last time.
class ObjectCyclicBus final : public CyclicBus {
 public:
  // `objects` outlives this.
  ObjectCyclicBus(ObjectClient& objects, std::vector<PdoObject> outputs, std::vector<PdoObject> inputs, Time period);

  Time period() const override { return period_; }
  Time now() const override { return objects_.now(); }
  void wait(Time span) override;
  std::size_t size() const override { return 1; }
  ProcessImage& image(std::size_t) override { return image_; }
  bool is_fresh(std::size_t) const override { return fresh_; }
  void on_cycle(std::function<void()> action) override { action_ = std::move(action); }
  // Throws what the drive answered if it refused an access, and HostError if it has been silent for long.
  void check() const override;
  CycleCounters counters() const override { return counters_; }
  Time inputs_taken() const override { return inputs_taken_; }

  static constexpr unsigned tolerated_losses = 10;  // cycles in a row

 private:
  struct Value {
    PdoObject object;
    std::array<std::uint8_t, 8> bytes{};
  };
  class Image final : public ProcessImage {
   public:
    Image(std::vector<Value>& outputs, std::vector<Value>& inputs, std::string where)
        : outputs_(outputs), inputs_(inputs), where_(std::move(where)) {}
    std::optional<ProcessObject> output(ObjectAddress object) override { return find(outputs_, object); }
    std::optional<ProcessObject> input(ObjectAddress object) override { return find(inputs_, object); }
    std::string where() const override { return where_; }

   private:
    static std::optional<ProcessObject> find(std::vector<Value>& values, ObjectAddress object);

    std::vector<Value>& outputs_;
    std::vector<Value>& inputs_;
    std::string where_;
  };

  void cycle();
  void read(const std::vector<std::size_t>& places);

  ObjectClient& objects_;
  std::vector<Value> outputs_;
  std::vector<Value> inputs_;
  std::vector<std::vector<std::size_t>> together_;  // places among the inputs that one access reads
  Image image_;
  Time period_;
  Time next_;
  Time inputs_taken_{};
  bool fresh_ = false;
  unsigned lost_in_a_row_ = 0;
  std::function<void()> action_{};
  std::exception_ptr refused_{};
  CycleCounters counters_{};
};

}  // namespace servodrome::host
