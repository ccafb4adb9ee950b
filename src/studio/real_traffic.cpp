#include "studio/real_traffic.hpp"

#include <fmt/format.h>

#include "studio/real_bench.hpp"

namespace servodrome::studio {
namespace {

class BusTap final : public line::TrafficTap {
 public:
  BusTap(BusTraffic& traffic, line::TrafficRing& ring) : traffic_(traffic), ring_(ring) { traffic_.want(true); }
  ~BusTap() override { traffic_.want(false); }
  BusTap(const BusTap&) = delete;
  BusTap& operator=(const BusTap&) = delete;
  void flush() override { traffic_.fetch(ring_); }

 private:
  BusTraffic& traffic_;
  line::TrafficRing& ring_;
};

// The frames that this program sends on a bus, and the answers.
class RealTraffic final : public TrafficSource {
 public:
  RealTraffic(RealDrives& drives, std::size_t bus) : drives_(drives), bus_(bus) {}

  const std::string& name() const override { return plan().link; }
  Medium medium() const override {
    if (plan().type == "can") return Medium::can;
    return plan().type == "ethercat" ? Medium::ethercat : Medium::serial;
  }
  std::unique_ptr<line::TrafficTap> tap(line::TrafficRing& ring) override {
    return std::make_unique<BusTap>(drives_.buses()[bus_]->traffic(), ring);
  }
  std::string sender(std::uint32_t sender) const override {
    if (sender == 0) return "";
    const unsigned node_id = sender & 0x7FU;
    for (const RealDrives::Axis& axis : drives_.all()) {
      if (axis.bus == bus_ && axis.address == node_id) return axis.name;
    }
    return node_id == 0 ? "another" : fmt::format("node {}", node_id);
  }
  void introduce(TrafficDecoders& decoders) override {
    for (const RealDrives::Axis& axis : drives_.all()) {
      if (axis.bus == bus_) introduce(decoders, axis);
    }
    if (medium() == Medium::ethercat) introduce_process_data(decoders);
  }

 private:
  const BusPlan& plan() const { return drives_.buses()[bus_]->plan(); }

  static void introduce_serial(TrafficDecoders& decoders, const RealDrives::Axis& axis) {
    const line::SerialInterface* interface = axis.tables->serial;
    const auto table = axis.device->dictionary().table();
    const auto model = interface != nullptr
                           ? master::SerialModel::of(table, interface->registers, interface->profile, axis.product)
                           : master::SerialModel::of(table, {}, nullptr, axis.product);
    decoders.serial.set_model(axis.address, model);
    decoders.modbus_tcp.set_model(axis.address, model);
  }

  void introduce(TrafficDecoders& decoders, const RealDrives::Axis& axis) const {
    switch (medium()) {
      case Medium::can: {
        const auto node_id = static_cast<std::uint8_t>(axis.address);
        decoders.can.set_model(node_id, master::DeviceModel::of(axis.device->bus_dictionary().table(), axis.product));
        break;
      }
      case Medium::ethercat:
        decoders.ethercat.set_model(axis.address,
                                    master::DeviceModel::of(axis.device->bus_dictionary().table(), axis.product));
        break;
      case Medium::serial: introduce_serial(decoders, axis); break;
    }
  }

  // Presets the positions of the drives' process data, which were configured before the recording began.
  void introduce_process_data(TrafficDecoders& decoders) {
    for (const RealDrives::ProcessDataRegisters& one : drives_.process_data_of(bus_)) {
      decoders.ethercat.preset(one.position, one.station, one.offset, one.bytes);
    }
  }

  RealDrives& drives_;
  std::size_t bus_;
};

}  // namespace

std::unique_ptr<TrafficSource> find_real_traffic(RealDrives& drives, const api::Call& call) {
  return std::make_unique<RealTraffic>(drives, bus_argument(drives, call));
}

}  // namespace servodrome::studio
