#include "api/static_files.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <fmt/format.h>
#include <fstream>
#include <optional>

#include "api/error.hpp"

namespace servodrome::api {
namespace {

constexpr std::uintmax_t largest_file = 16 * 1024 * 1024;

// The page may only load, show and contact what comes from this server.
constexpr const char* content_security_policy =
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; connect-src 'self'; "
    "font-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

constexpr const char* page_note = R"(<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>Servodrome</title></head><body>
<h1>Servodrome</h1>
<p>The line is running. The studio's page is not built: <code>./run</code> builds it, or
<code>servodrome up --studio FOLDER</code> gives its folder.</p>
<p>The bench API is at <a href="/api/v1/axes">/api/v1/axes</a>.</p>
</body></html>
)";

struct FileType {
  std::string_view extension;
  const char* content_type;
};
constexpr std::array file_types{
    FileType{".html", "text/html; charset=utf-8"},
    FileType{".js", "text/javascript; charset=utf-8"},
    FileType{".css", "text/css; charset=utf-8"},
    FileType{".json", "application/json"},
    FileType{".webmanifest", "application/manifest+json"},
    FileType{".map", "application/json"},
    FileType{".svg", "image/svg+xml"},
    FileType{".png", "image/png"},
    FileType{".ico", "image/x-icon"},
    FileType{".woff2", "font/woff2"},
    FileType{".wasm", "application/wasm"},
    FileType{".txt", "text/plain; charset=utf-8"},
};

const char* type_of(const std::filesystem::path& path) {
  for (const FileType& type : file_types) {
    if (path.extension() == type.extension) return type.content_type;
  }
  return "application/octet-stream";
}

// Allows only the characters that builds use in file names. Percent escapes are not decoded, so %2e cannot stand for a
// dot.
bool is_plain(std::string_view path) {
  const auto plain = [](char c) {
    return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '-' || c == '_' || c == '.' || c == '/' || c == '@';
  };
  return path.starts_with('/') && std::all_of(path.begin(), path.end(), plain) &&
         path.find("/.") == std::string_view::npos && path.find("//") == std::string_view::npos;
}

Response page_response(const Request& request, std::string body, const char* type) {
  Response response{200, std::move(body), {}, type};
  response.fields = {{"Content-Security-Policy", content_security_policy},
                     {"Referrer-Policy", "no-referrer"},
                     {"Cross-Origin-Resource-Policy", "same-origin"}};
  // Browsers ignore this field, and print a warning, on connections that they do not trust (from another machine
  // without TLS).
  if (request.from_loopback) response.fields.emplace_back("Cross-Origin-Opener-Policy", "same-origin");
  return response;
}

Response nothing_there(std::string_view path) {
  return error_response({404, "unknown address", std::string(path.substr(0, 200)),
                         "the page is at /, the API below /api/v1/ (docs/bench-api.md)"});
}

// Returns the file, with symbolic links resolved, if it is in the folder.
std::optional<std::filesystem::path> file_within(const std::filesystem::path& folder, std::string_view path) {
  std::error_code error;
  const auto file = std::filesystem::canonical(folder / path.substr(1), error);
  if (error || !std::filesystem::is_regular_file(file, error)) return std::nullopt;
  const auto [end, ignored] = std::mismatch(folder.begin(), folder.end(), file.begin(), file.end());
  if (end != folder.end() || std::filesystem::file_size(file, error) > largest_file || error) return std::nullopt;
  return file;
}

}  // namespace

StaticFiles::StaticFiles(const std::string& folder) {
  std::error_code error;
  const auto found = std::filesystem::canonical(folder, error);
  if (!error && std::filesystem::is_regular_file(found / "index.html", error)) folder_ = found;
}

Response StaticFiles::answer(const Request& request) const {
  const std::string_view path = std::string_view(request.target).substr(0, request.target.find('?'));
  if (request.method != Method::get) {
    Response refusal = error_response(
        {405, "this address does not support the method", std::string(path.substr(0, 200)), "it has GET"});
    refusal.allow = "GET";
    return refusal;
  }
  if (!is_plain(path)) return nothing_there(path);
  const bool is_place = path.find('.') == std::string_view::npos;
  if (folder_.empty())
    return is_place ? page_response(request, page_note, "text/html; charset=utf-8") : nothing_there(path);
  const auto file = file_within(folder_, is_place ? "/index.html" : path);
  if (!file) return nothing_there(path);
  std::ifstream stream(*file, std::ios::binary);
  std::string bytes{std::istreambuf_iterator<char>(stream), {}};
  if (!stream && !stream.eof()) return nothing_there(path);
  const auto tag = fmt::format("\"{:016x}-{:x}\"", std::hash<std::string>()(bytes), bytes.size());
  Response response = page_response(request, std::move(bytes), type_of(*file));
  // The names of files in /assets contain a hash of their content, so browsers may cache them forever.
  const bool is_asset = path.starts_with("/assets/");
  response.fields.emplace_back("Cache-Control", is_asset ? "public, max-age=31536000, immutable" : "no-cache");
  response.fields.emplace_back("ETag", tag);
  if (request.if_none_match.find(tag) != std::string::npos) {
    response.status = 304;
    response.body.clear();
  }
  return response;
}

}  // namespace servodrome::api
