#pragma once

#include <vector>

#include "axis/cyclic/cyclic_bus.hpp"
#include "master/canopen/pdo_set_up.hpp"
#include "master/object_client.hpp"

namespace servodrome::master {

// A CyclicBus of one drive without process data: reads and writes its objects by requests, at a fixed period of the
// client's clock. For clients whose accesses are short compared to the period, such as the service port of a simulated
// drive. Every cycle makes the same accesses in the same order, so that the delay of each access is constant.
class ObjectCyclicBus final : public CyclicBus {
 public:
  // `objects` must outlive this.
  ObjectCyclicBus(ObjectClient& objects, std::vector<PdoObject> outputs, std::vector<PdoObject> inputs, Time period);

  Time period() const override { return period_; }
  Time now() const override { return objects_.now(); }
  void wait(Time span) override;
  std::size_t size() const override { return 1; }
  ProcessImage& image(std::size_t) override { return image_; }
  bool is_fresh(std::size_t) const override { return fresh_; }
  void on_cycle(std::function<void()> action) override { action_ = std::move(action); }
  // Rethrows the drive's ObjectError if it refused an access; throws MasterError after too many cycles in a row in
  // which an access, a read or a write, had no answer.
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
  std::vector<std::vector<std::size_t>> together_;  // sets of input numbers that one access reads
  Image image_;
  Time period_;
  Time next_;
  Time inputs_taken_{};
  bool fresh_ = false;
  unsigned lost_in_a_row_ = 0;  // cycles in which an access had no answer
  std::function<void()> action_{};
  std::exception_ptr refused_{};
  CycleCounters counters_{};
};

}  // namespace servodrome::master
