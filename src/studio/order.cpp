#include "studio/order.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/format.h>
#include <numbers>

#include "catalogue/product.hpp"
#include "links/nearest_name.hpp"
#include "links/time.hpp"
#include "studio/excitation.hpp"
#include "studio/tuning_order.hpp"

namespace servodrome::studio {
namespace {

using api::ApiError;
using api::BodyReader;
using CarryOut = std::function<void(master::Axis402&, Conduct&)>;

constexpr double longest_timeout_s = 3600.0;
constexpr double usual_timeout_s = 60.0;

catalogue::AxisUnits reported(const ReadUnits& units, const char* remedy) {
  if (const auto known = units()) return *known;
  throw master::MasterError("the drive does not report its units per revolution", "", remedy);
}

// Reads the numbers of one request, converted to the drive's units.
class Numbers {
 public:
  Numbers(BodyReader& body, const Scale& scale, const ReadUnits& units) : body_(body), scale_(scale), units_(units) {}

  template <typename T>
  std::optional<T> position(const char* key) {
    return whole<T>(key, scale_.units().position);
  }
  template <typename T>
  std::optional<T> velocity(const char* key) {
    return whole<T>(key, scale_.units().velocity);
  }
  std::optional<std::uint32_t> acceleration(const char* key) {
    return whole<std::uint32_t>(key, scale_.units().acceleration);
  }
  // A count: it has no unit and must be a whole number.
  template <typename T>
  std::optional<T> counted(const char* key) {
    const std::optional<double> number = body_.number(key);
    if (number && *number != std::round(*number)) {
      throw ApiError{422, fmt::format("{} is {:g}", key, *number), key, "write a whole number"};
    }
    return whole<T>(key, 1.0);
  }
  // Reads a number and multiplies it by `scale`, the object's units per unit of the key.
  template <typename T>
  std::optional<T> whole(const char* key, double scale) {
    const std::optional<double> number = body_.number(key);
    if (!number) return std::nullopt;
    const double units = std::round(*number * scale);
    if (units >= static_cast<double>(std::numeric_limits<T>::min()) &&
        units <= static_cast<double>(std::numeric_limits<T>::max())) {
      return static_cast<T>(units);
    }
    throw ApiError{
        422, fmt::format("{} is {:g}, which is {:g} units of the drive", key, *number, units), key,
        fmt::format("the object accepts {} .. {}", std::numeric_limits<T>::min(), std::numeric_limits<T>::max())};
  }
  template <typename T>
  T required(const char* key, std::optional<T> (Numbers::*read)(const char*)) {
    body_.required(key);
    return (this->*read)(key).value_or(T{});
  }
  master::MotionProfile profile(bool with_velocity) {
    master::MotionProfile profile;
    if (with_velocity) profile.velocity = velocity<std::uint32_t>("velocity");
    profile.acceleration = acceleration("acceleration");
    profile.deceleration = acceleration("deceleration");
    if (!profile.deceleration) profile.deceleration = profile.acceleration;
    return profile;
  }
  master::Time timeout() {
    const double seconds = body_.number("timeout_s", 0.0, longest_timeout_s).value_or(usual_timeout_s);
    return links::from_seconds(seconds);
  }
  BodyReader& body() { return body_; }
  const Scale& scale() const { return scale_; }
  std::optional<Order::Target> target{};  // of a move that stays within the travel
  // In the drive's units, whatever units the request uses.
  std::optional<catalogue::AxisUnits> revolution() const { return units_(); }
  catalogue::AxisUnits needed_revolution(const char* remedy) const { return reported(units_, remedy); }

 private:
  BodyReader& body_;
  const Scale& scale_;
  const ReadUnits& units_;
};

CarryOut enable(Numbers&) {
  return [](master::Axis402& axis, Conduct&) { axis.enable(); };
}
CarryOut disable(Numbers&) {
  return [](master::Axis402& axis, Conduct&) { axis.disable(); };
}
CarryOut reset_fault(Numbers&) {
  return [](master::Axis402& axis, Conduct&) { axis.reset_fault(); };
}
CarryOut quick_stop(Numbers&) {
  return [](master::Axis402& axis, Conduct&) { axis.quick_stop(); };
}
CarryOut stop(Numbers&) {
  return [](master::Axis402& axis, Conduct&) { axis.stop(); };
}

CarryOut home(Numbers& numbers) {
  master::HomingRequest request;
  request.method = numbers.counted<std::int8_t>("method");
  request.switch_speed = numbers.velocity<std::uint32_t>("speed");
  request.zero_speed = numbers.velocity<std::uint32_t>("zero_speed");
  request.acceleration = numbers.acceleration("acceleration");
  request.offset = numbers.position<std::int32_t>("offset");
  return [request, timeout = numbers.timeout()](master::Axis402& axis, Conduct&) { axis.home(request, timeout); };
}

CarryOut move(Numbers& numbers) {
  const auto to = numbers.position<std::int32_t>("to");
  const auto by = numbers.position<std::int32_t>("by");
  if (to.has_value() == by.has_value()) {
    throw ApiError{400, to ? "both to and by are given" : "neither to nor by is given", "to",
                   "give the target position under \"to\", or the distance under \"by\""};
  }
  // `beyond`: for example to try a limit switch.
  const bool beyond = numbers.body().boolean("beyond").value_or(false);
  if (!beyond) numbers.target = Order::Target{to ? *to : *by, by.has_value()};
  const master::MotionProfile profile = numbers.profile(true);
  return [to, by, profile, timeout = numbers.timeout()](master::Axis402& axis, Conduct&) {
    if (to) {
      axis.move_to(*to, profile, timeout);
    } else {
      axis.move_by(*by, profile, timeout);
    }
  };
}

CarryOut velocity(Numbers& numbers) {
  const auto target = numbers.required<std::int32_t>("velocity", &Numbers::velocity<std::int32_t>);
  const master::MotionProfile profile = numbers.profile(false);
  return [target, profile, timeout = numbers.timeout()](master::Axis402& axis, Conduct&) {
    axis.run_at(target, profile, timeout);
  };
}

CarryOut torque(Numbers& numbers) {
  constexpr double permille_per_percent = 10.0;
  numbers.body().required("percent");
  const auto target = numbers.whole<std::int16_t>("percent", permille_per_percent).value_or(std::int16_t{});
  const master::TorqueProfile profile{.slope = numbers.whole<std::uint32_t>("slope", permille_per_percent)};
  return [target, profile, timeout = numbers.timeout()](master::Axis402& axis, Conduct&) {
    axis.run_torque(target, profile, timeout);
  };
}

CarryOut jog(Numbers& numbers) {
  const auto target = numbers.required<std::int32_t>("velocity", &Numbers::velocity<std::int32_t>);
  const master::MotionProfile profile = numbers.profile(false);
  return [target, profile](master::Axis402& axis, Conduct& conduct) {
    axis.jog(profile, [&](const master::AxisStatus&) -> std::optional<std::int32_t> {
      if (conduct.released()) return std::nullopt;
      return target;
    });
  };
}

// The common parameters of a sweep and a step. Torque is in percent of the rated torque, whatever units the request
// uses.
Excitation excitation(Numbers& numbers) {
  struct Choice {
    const char* name;
    Excitation::Of of;
  };
  constexpr std::array choices{Choice{"velocity", Excitation::Of::velocity}, Choice{"torque", Excitation::Of::torque},
                               Choice{"position", Excitation::Of::position}};
  constexpr double permille_per_percent = 10.0;
  const std::string of = numbers.body().string("of").value_or("velocity");
  const auto* const choice =
      std::find_if(choices.begin(), choices.end(), [&of](const Choice& one) { return of == one.name; });
  if (choice == choices.end()) {
    throw ApiError{422, fmt::format("of is \"{}\"", of.substr(0, 40)), "of",
                   "send \"velocity\", \"torque\" or \"position\""};
  }
  const catalogue::AxisUnits& scale = numbers.scale().units();
  const std::array factors{scale.velocity, permille_per_percent, scale.position};
  numbers.body().required("amplitude");
  const double factor = factors[static_cast<std::size_t>(choice->of)];
  Excitation excitation{.of = choice->of};
  excitation.amplitude = choice->of == Excitation::Of::torque
                             ? numbers.whole<std::int16_t>("amplitude", factor).value_or(0)
                             : numbers.whole<std::int32_t>("amplitude", factor).value_or(0);
  if (excitation.amplitude == 0.0)
    throw ApiError{422, "the amplitude is 0", "amplitude", "give an amplitude other than 0"};
  // CiA 402 counts velocities and accelerations in the same position units.
  constexpr catalogue::AxisUnits same{1.0, 1.0, 1.0};
  const auto travel = numbers.body().number("travel", 0.0);
  const catalogue::AxisUnits revolution =
      travel ? numbers.revolution().value_or(same) : numbers.needed_revolution("give \"travel\" in its own units");
  excitation.revolution = revolution;
  excitation.travel = travel ? *travel * scale.position : revolution.position;
  return excitation;
}

CarryOut excited_by(const Numbers& numbers, Excitation excitation) {
  const double distance = commanded_distance(excitation);
  if (distance > excitation.travel) {
    const double unit = numbers.scale().units().position;
    throw ApiError{422,
                   fmt::format("the axis would move by {:.4g}, and the travel permits {:.4g} from its start",
                               distance / unit, excitation.travel / unit),
                   "amplitude", "give a smaller amplitude, a shorter time, a higher frequency or more travel"};
  }
  return [excitation = std::move(excitation)](master::Axis402& axis, Conduct& conduct) {
    excite(axis, excitation, conduct.released);
  };
}

CarryOut sweep(Numbers& numbers) {
  constexpr double lowest_hz = 0.1;
  constexpr double highest_hz = 400.0;  // limit for targets every millisecond
  Excitation sines = excitation(numbers);
  sines.seconds = numbers.body().number("seconds", 0.1, 60.0).value_or(4.0);
  const double from_hz = numbers.body().number("from_hz", lowest_hz, highest_hz).value_or(2.0);
  const double to_hz = numbers.body().number("to_hz", lowest_hz, highest_hz).value_or(200.0);
  sines.shape = sine_sweep(from_hz, to_hz, sines.seconds);
  sines.steepness = 2.0 * std::numbers::pi * std::max(from_hz, to_hz);
  return excited_by(numbers, std::move(sines));
}

CarryOut step_and_back(Numbers& numbers) {
  constexpr double steepness = 1000.0;  // the full step within a millisecond
  Excitation step_response = excitation(numbers);
  step_response.seconds = 2.0 * numbers.body().number("seconds", 0.01, 30.0).value_or(0.2);
  step_response.shape = step(step_response.seconds);
  step_response.steepness = steepness;
  return excited_by(numbers, std::move(step_response));
}

constexpr double usual_tuning_travel = 4.0;  // revolutions

TuningOrder tuning_order(Numbers& numbers) {
  TuningOrder order{.revolution = numbers.needed_revolution(
                        "the measurement counts revolutions: it needs a drive that reports them")};
  order.tuner.travel_revolutions = numbers.body().number("travel", 0.5, 1000.0).value_or(usual_tuning_travel);
  return order;
}

CarryOut tune(Numbers& numbers) {
  BodyReader& body = numbers.body();
  TuningOrder order = tuning_order(numbers);
  order.session.bandwidth_hz = body.number("bandwidth_hz", 1.0, 1000.0);
  order.session.apply = body.boolean("apply").value_or(false);
  order.tuner.torque_limit = body.number("torque_percent", 1.0, 300.0).value_or(60.0) / 100.0;
  order.tuner.seconds = body.number("seconds", 4.0, 600.0).value_or(order.tuner.seconds);
  return [order](master::Axis402& axis, Conduct& conduct) { tune_axis(axis, order, conduct); };
}

CarryOut tune_itself(Numbers& numbers) {
  const TuningOrder order = tuning_order(numbers);
  return [order](master::Axis402& axis, Conduct& conduct) { let_axis_tune_itself(axis, order, conduct); };
}

struct Kind {
  const char* name;
  CarryOut (*read)(Numbers& numbers);
  bool moves = false;
  bool takes_over = false;
  bool lives_on_signs = false;
};
constexpr std::array kinds{
    Kind{.name = "enable", .read = enable},
    Kind{.name = "disable", .read = disable, .takes_over = true},
    Kind{.name = "reset_fault", .read = reset_fault},
    Kind{.name = "quick_stop", .read = quick_stop, .takes_over = true},
    Kind{.name = "stop", .read = stop, .takes_over = true},
    Kind{.name = "home", .read = home, .moves = true},
    Kind{.name = "move", .read = move, .moves = true},
    Kind{.name = "velocity", .read = velocity, .moves = true},
    Kind{.name = "torque", .read = torque, .moves = true},
    Kind{.name = "jog", .read = jog, .moves = true, .lives_on_signs = true},
    Kind{.name = "sweep", .read = sweep, .moves = true},
    Kind{.name = "step", .read = step_and_back, .moves = true},
    Kind{.name = "tune", .read = tune, .moves = true},
    Kind{.name = "tune_itself", .read = tune_itself, .moves = true},
};

const Kind& kind_of(const std::string& name) {
  for (const Kind& kind : kinds) {
    if (name == kind.name) return kind;
  }
  std::vector<std::string_view> names;
  for (const Kind& kind : kinds) names.push_back(kind.name);
  throw ApiError{422, fmt::format("there is no job \"{}\"", name.substr(0, 40)), "do", links::suggestion(name, names)};
}

Scale scale_of(const std::string& name, const ReadUnits& units) {
  if (name == "drive") return Scale();
  if (name == "revolutions") return Scale(reported(units, "give numbers in its own units: \"units\": \"drive\""));
  throw ApiError{422, fmt::format("there are no units \"{}\"", name.substr(0, 40)), "units",
                 "send \"drive\" or \"revolutions\""};
}

}  // namespace

Order read_order(const std::string& text, const ReadUnits& units) {
  BodyReader body(text);
  body.required("do");
  const Kind& kind = kind_of(body.string("do").value_or(""));
  // A stop has no numbers: it does not wait for the drive's units.
  const std::string given = body.string("units").value_or("drive");
  const std::string name_of_units = kind.takes_over && given == "revolutions" ? "drive" : given;
  Order order{.what = kind.name,
              .moves = kind.moves,
              .takes_over = kind.takes_over,
              .lives_on_signs = kind.lives_on_signs,
              .in_revolutions = name_of_units == "revolutions",
              .scale = scale_of(name_of_units, units)};
  Numbers numbers(body, order.scale, units);
  const auto job = body.integer("after", UINT64_MAX);
  const auto within_s = body.number("after_within_s", 0.0);
  const auto start = body.string("after_start");
  if (job) order.after = Order::After{*job, within_s, start};
  if (!job && (within_s || start)) {
    throw ApiError{400, fmt::format("{} is given without after", within_s ? "after_within_s" : "after_start"), "after",
                   "send the number of the job before this one as \"after\""};
  }
  order.carry_out = kind.read(numbers);
  order.target = numbers.target;
  body.finish();
  return order;
}

}  // namespace servodrome::studio
