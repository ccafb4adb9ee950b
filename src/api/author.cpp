#include "api/author.hpp"

#include <utility>

namespace servodrome::api {
namespace {

thread_local std::string present_author;

}  // namespace

Author::Author(std::string name) : former_(std::exchange(present_author, std::move(name))) {}

Author::~Author() { present_author = std::move(former_); }

const std::string& Author::present() { return present_author; }

}  // namespace servodrome::api
