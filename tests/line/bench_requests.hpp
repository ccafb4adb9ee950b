#pragma once

#include <fmt/format.h>
#include <random>
#include <string>

#include "line/bench/line_bench.hpp"

namespace servodrome::line::test {

// Generates requests that are mostly valid, so that they also reach the code behind the first checks.
class RequestGenerator {
 public:
  explicit RequestGenerator(std::uint64_t seed) : random_(seed) {}

  api::Request next() {
    api::Request request;
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

  // A message of a client of the stream, mostly valid.
  std::string message() {
    static constexpr std::array rates{"1", "1000", "16000", "0", "-1", "1e9", "\"x\""};
    std::string text;
    switch (pick(4)) {
      case 0: text = fmt::format(R"({{"unsubscribe":{{"id":{}}}}})", pick(12)); break;
      case 1: text = fmt::format(R"({{"watch":{{"axes":{}}}}})", one_of(rates)); break;
      default:
        text = fmt::format(R"({{"subscribe":{{"id":{},"channels":[{}],"rate_hz":{}}}}})", pick(12), channels(),
                           one_of(rates));
        break;
    }
    if (pick(10) == 0) spoil(text);
    return text;
  }

 private:
  std::string channels() {
    static constexpr std::array what{R"("signal":"velocity_rpm")", R"("signal":"state")",   R"("signal":"DI0")",
                                     R"("signal":"nothing")",      R"("object":"6041:00")", R"("object":"6064")",
                                     R"("object":"1008:00")",      R"("object":"zz:99")",   R"("object":"0x6081:0")",
                                     R"("signal":"DI99999")",      R"("object":7)",         R"("x":1)"};
    static constexpr std::array axes{"left", "right", "middle"};
    std::string list;
    for (std::size_t n = pick(4) == 0 ? 17 : pick(4); n-- > 0;) {
      list += fmt::format(R"({}{{"axis":"{}",{}}})", list.empty() ? "" : ",", one_of(axes), one_of(what));
    }
    return list;
  }

  std::string recording() {
    static constexpr std::array triggers{R"({"kind":"now"})",
                                         R"({"kind":"edge","channel":0,"level":0})",
                                         R"({"kind":"level","channel":3,"level":1})",
                                         R"({"kind":"fault"})",
                                         R"({"kind":"state","axis":"left","state":"x"})",
                                         R"({"kind":"state"})",
                                         R"({"kind":7})",
                                         R"({})"};
    static constexpr std::array durations{"0", "1", "20", "3600000", "-1", "1e300"};
    return fmt::format(R"({{"channels":[{}],"rate_hz":{},"duration_ms":{},"pre_ms":{},"trigger":{}}})", channels(),
                       1 + pick(16000), one_of(durations), one_of(durations), one_of(triggers));
  }

  std::size_t pick(std::size_t count) { return static_cast<std::size_t>(random_() % count); }
  template <std::size_t Count>
  std::string one_of(const std::array<const char*, Count>& words) {
    return words[pick(Count)];
  }

  // An address with a method that it supports, and a body with keys that it accepts.
  api::Request near_right() {
    struct Example {
      api::Method method;
      const char* target;
      std::array<const char*, 4> keys;
    };
    static constexpr std::array examples{
        Example{api::Method::put, "/axes/right/objects/6081/0", {"value", "value", "value", "value"}},
        Example{api::Method::put, "/axes/left/objects/6040/0", {"value", "value", "value", "value"}},
        Example{api::Method::put, "/axes/right/objects/6060/0", {"value", "value", "value", "value"}},
        Example{api::Method::put, "/axes/left/inputs", {"DI0", "DI1", "DI2", "DI5"}},
        Example{
            api::Method::put, "/axes/right/plant", {"locked_rotor", "load_torque_nm", "supply_v", "position_counts"}},
        Example{api::Method::post, "/axes/right/faults", {"inject", "inject", "inject", "inject"}},
        Example{api::Method::delete_, "/axes/right/faults", {"inject", "inject", "inject", "inject"}},
        Example{api::Method::post, "/axes/left/power", {"action", "action", "action", "action"}},
        Example{api::Method::post, "/buses/can0/disturb", {"drop", "seed", "axis", "cut"}},
        Example{api::Method::delete_, "/buses/can0/disturb", {"drop", "drop", "drop", "drop"}},
        Example{api::Method::post, "/buses/rs/disturb", {"drop", "seed", "corrupt", "cut"}},
        Example{api::Method::post, "/recordings", {"channels", "rate_hz", "duration_ms", "trigger"}},
    };
    if (pick(16) == 0) return {.method = api::Method::post, .target = "/api/v1/recordings", .body = recording()};
    const Example& example = examples[pick(examples.size())];
    api::Request request{.method = example.method, .target = std::string("/api/v1") + example.target};
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
                                       "/api/v2/axes",       "/api/v1/clock?x=1",
                                       "/api/v1/line",       "/api/v1/recordings",
                                       "/api/v1/stream",     "/api/v1/recordings/x"};
    static constexpr std::array of_recording{"", "/stop", "/data", "/data.csv", "/x"};
    if (pick(3) == 0) return one_of(others);
    if (pick(8) == 0) return fmt::format("/api/v1/recordings/{}{}", pick(200), one_of(of_recording));
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

  static constexpr std::array methods_{api::Method::get,     api::Method::put, api::Method::post,
                                       api::Method::delete_, api::Method::put, api::Method::other};
  std::mt19937_64 random_;
};

}  // namespace servodrome::line::test
