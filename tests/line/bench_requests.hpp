#pragma once

#include <random>
#include <string>

#include "line/bench/api.hpp"

namespace servodrome::line::test {

// Requests that are right more often than not, so that what lies behind the first check is reached as well.
class RequestGenerator {
 public:
  explicit RequestGenerator(std::uint64_t seed) : random_(seed) {}

  bench::Request next() {
    bench::Request request;
    if (pick(2) == 0) {
      request = near_right();
    } else {
      request.method = methods_[pick(methods_.size())];
      request.target = target();
      request.body = body();
    }
    if (pick(20) == 0) spoil(request.target);
    if (pick(20) == 0) spoil(request.body);
    return request;
  }

 private:
  std::size_t pick(std::size_t count) { return static_cast<std::size_t>(random_() % count); }
  template <std::size_t Count>
  std::string one_of(const std::array<const char*, Count>& words) {
    return words[pick(Count)];
  }

  // An address with a method it has, and a body with keys it takes.
  bench::Request near_right() {
    struct Example {
      bench::Method method;
      const char* target;
      std::array<const char*, 4> keys;
    };
    static constexpr std::array examples{
        Example{bench::Method::put, "/axes/right/objects/6081/0", {"value", "value", "value", "value"}},
        Example{bench::Method::put, "/axes/left/objects/6040/0", {"value", "value", "value", "value"}},
        Example{bench::Method::put, "/axes/right/objects/6060/0", {"value", "value", "value", "value"}},
        Example{bench::Method::put, "/axes/left/inputs", {"DI0", "DI1", "DI2", "DI5"}},
        Example{
            bench::Method::put, "/axes/right/plant", {"locked_rotor", "load_torque_nm", "supply_v", "position_counts"}},
        Example{bench::Method::post, "/axes/right/faults", {"inject", "inject", "inject", "inject"}},
        Example{bench::Method::delete_, "/axes/right/faults", {"inject", "inject", "inject", "inject"}},
        Example{bench::Method::post, "/axes/left/power", {"action", "action", "action", "action"}},
        Example{bench::Method::post, "/buses/can0/disturb", {"drop", "seed", "axis", "cut"}},
        Example{bench::Method::delete_, "/buses/can0/disturb", {"drop", "drop", "drop", "drop"}},
        Example{bench::Method::post, "/buses/rs/disturb", {"drop", "seed", "corrupt", "cut"}},
    };
    const Example& example = examples[pick(examples.size())];
    bench::Request request{.method = example.method, .target = std::string("/api/v1") + example.target};
    if (pick(8) != 0) request.body = "{\"" + one_of(example.keys) + "\":" + value() + "}";
    return request;
  }

  std::string target() {
    static constexpr std::array axes{"left", "right", "middle", "", "%00"};
    static constexpr std::array what{"", "/power", "/inputs", "/plant", "/faults", "/objects", "/x"};
    static constexpr std::array indexes{"6040", "6041", "0x6060", "607A", "6081", "1018", "1008", "1010",
                                        "1021", "2401", "FFFFF",  "zz",   "60FF", "1600", "1017", "6098"};
    static constexpr std::array subs{"0", "1", "0x2", "ff", "100", "-1"};
    static constexpr std::array others{"/api/v1/axes",       "/api/v1/buses",
                                       "/api/v1/buses/can0", "/api/v1/buses/can0/disturb",
                                       "/api/v1/buses/rs",   "/api/v1/buses/x/disturb",
                                       "/api/v1/clock",      "/api/v1/clock/advance",
                                       "/api/v1/version",    "/",
                                       "/api/v2/axes",       "/api/v1/clock?x=1"};
    if (pick(3) == 0) return one_of(others);
    const std::string axis = "/api/v1/axes/" + one_of(axes);
    if (pick(2) == 0) return axis + one_of(what);
    return axis + "/objects/" + one_of(indexes) + "/" + one_of(subs);
  }

  std::string value() {
    static constexpr std::array values{"0",
                                       "1",
                                       "-1",
                                       "true",
                                       "false",
                                       "null",
                                       "1e300",
                                       "0.5",
                                       "15",
                                       "6",
                                       "7",
                                       "65535",
                                       "4294967296",
                                       "18446744073709551615",
                                       "-9223372036854775808",
                                       "\"left\"",
                                       "\"off\"",
                                       "\"cycle\"",
                                       "\"encoder_loss\"",
                                       "\"0x7380\"",
                                       "\"00ff\"",
                                       "\"\\u0000\"",
                                       "[]",
                                       "{}",
                                       "[[1]]",
                                       "1e999",
                                       "\"on\"",
                                       "2",
                                       "0.25"};
    return one_of(values);
  }

  std::string body() {
    static constexpr std::array keys{"value",
                                     "action",
                                     "DI0",
                                     "DI5",
                                     "DI99",
                                     "locked_rotor",
                                     "load_torque_nm",
                                     "inject",
                                     "ms",
                                     "drop",
                                     "delay",
                                     "delay_ms",
                                     "corrupt",
                                     "seed",
                                     "id",
                                     "id_mask",
                                     "limit",
                                     "cut",
                                     "axis",
                                     "supply_v",
                                     "ambient_c",
                                     "friction_nm",
                                     "load_inertia_kgm2",
                                     "position_counts",
                                     "nonsense"};
    static constexpr std::array whole{"",
                                      "{}",
                                      "[]",
                                      "null",
                                      "{",
                                      "\xff",
                                      "{\"value\":1}",
                                      "{\"ms\":1}",
                                      "{\"inject\":\"open_phase_u\"}",
                                      "{\"action\":\"on\"}"};
    if (pick(3) == 0) return one_of(whole);
    std::string text = "{";
    for (std::size_t count = 1 + pick(3); count > 0; --count) {
      text += "\"" + one_of(keys) + "\":" + value() + (count > 1 ? "," : "}");
    }
    return text;
  }

  void spoil(std::string& text) {
    if (text.empty()) return;
    char& victim = text[pick(text.size())];
    victim = static_cast<char>(random_());
  }

  static constexpr std::array methods_{bench::Method::get,     bench::Method::put, bench::Method::post,
                                       bench::Method::delete_, bench::Method::put, bench::Method::other};
  std::mt19937_64 random_;
};

}  // namespace servodrome::line::test
