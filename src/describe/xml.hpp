#pragma once

#include <initializer_list>
#include <string>
#include <string_view>
#include <utility>

namespace servodrome::describe {

// Writes an XML document with an indentation of two spaces; closes every element that it opens.
class Xml {
 public:
  using Attributes = std::initializer_list<std::pair<std::string_view, std::string>>;

  Xml() : text_("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n") {}

  void leaf(std::string_view name, std::string_view content, Attributes attributes = {}) {
    begin(name, attributes);
    text_ += '>';
    escape(content);
    end(name);
  }
  void empty(std::string_view name, Attributes attributes = {}) {
    begin(name, attributes);
    text_ += "/>\n";
  }
  // `content()` writes the content of the element.
  template <typename Content>
  void node(std::string_view name, Attributes attributes, Content content) {
    begin(name, attributes);
    text_ += ">\n";
    ++depth_;
    content();
    --depth_;
    indent();
    end(name);
  }
  template <typename Content>
  void node(std::string_view name, Content content) {
    node(name, {}, content);
  }

  std::string take() { return std::move(text_); }

 private:
  void indent() { text_.append(2 * depth_, ' '); }
  void begin(std::string_view name, Attributes attributes) {
    indent();
    text_ += '<';
    text_ += name;
    for (const auto& [key, value] : attributes) {
      text_ += ' ';
      text_ += key;
      text_ += "=\"";
      escape(value);
      text_ += '"';
    }
  }
  void end(std::string_view name) {
    text_ += "</";
    text_ += name;
    text_ += ">\n";
  }
  // XML 1.0 does not permit control characters in any form.
  void escape(std::string_view content) {
    for (const char letter : content) {
      switch (letter) {
        case '&': text_ += "&amp;"; break;
        case '<': text_ += "&lt;"; break;
        case '>': text_ += "&gt;"; break;
        case '"': text_ += "&quot;"; break;
        default: text_ += static_cast<unsigned char>(letter) < 0x20 ? ' ' : letter;
      }
    }
  }

  std::string text_;
  std::size_t depth_ = 0;
};

}  // namespace servodrome::describe
