#pragma once

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>
#include <string>

// Requests to the API of a server that runs: `servodrome up` or `servodrome studio`.
namespace servodrome::app {

// Where the server is.
struct ApiOptions {
  std::string server = "127.0.0.1:8402";  // ADDRESS:PORT
  std::string token{};                    // empty: $SERVODROME_TOKEN
};

// Adds --server and --token.
void add_api_options(CLI::App& command, ApiOptions& options);

// Sends a request to /api/v1/`path`; with `body` as JSON unless it is null. Returns the answer. Throws Failure: with
// the server's what, where and hint if it refuses, or if the look-up of its name or the answer takes longer than 10 s.
nlohmann::ordered_json ask_api(const ApiOptions& options, const char* method, const std::string& path,
                               const nlohmann::ordered_json& body = nullptr);

}  // namespace servodrome::app
