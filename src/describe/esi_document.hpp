#pragma once

#include <map>
#include <optional>
#include <pugixml.hpp>
#include <string>
#include <vector>

#include "describe/device_file.hpp"

// The XML document of an ESI file, shared by its readers.
namespace servodrome::describe {

// The text of a node without surrounding blanks.
std::string text_of(const pugi::xml_node& node);
// The English text (LcId 1033) if there are several languages, otherwise the first.
std::string english(const pugi::xml_node& parent, const char* child);
// "1" or "true".
bool is_set(const pugi::xml_attribute& attribute);
// Parses a HexDecValue of ETG.2000: decimal, or hexadecimal after #x; makers also write 0x. Empty if it is not a
// number.
std::optional<std::int64_t> parse_xml_number(std::string_view text);
// The base type with this name of IEC 61131-3; for an unknown name, the type with this length.
dictionary::Type type_of_name(std::string_view name, unsigned bits);

class EsiDocument {
 public:
  // Throws DeviceFileError if the text is not XML, or not an EtherCATInfo.
  EsiDocument(const std::string& text, const std::string& file);

  pugi::xml_node root() const { return document_.child("EtherCATInfo"); }
  unsigned line_of(const pugi::xml_node& node) const;
  [[noreturn]] void refuse(const pugi::xml_node& at, const std::string& key, const std::string& problem,
                           const std::string& remedy) const;
  // Returns a mandatory number. Throws DeviceFileError if it is missing.
  std::int64_t number(const pugi::xml_node& node, const char* key) const;
  std::int64_t number(const pugi::xml_attribute& attribute, const pugi::xml_node& of, const char* key) const;

 private:
  std::string file_;
  std::string text_;                    // as UTF-8; offsets refer to it
  std::vector<std::size_t> line_ends_;  // offsets in it
  pugi::xml_document document_;
};

// Reads the objects of a Dictionary element.
class EsiDictionaryReader {
 public:
  EsiDictionaryReader(const EsiDocument& document, EntryAdder& adder) : document_(document), adder_(adder) {}

  // Returns false if it has no objects.
  bool read(const pugi::xml_node& dictionary);

 private:
  void read_object(const pugi::xml_node& object);
  // Refuses parts of an object of which there would be too many.
  void check_number_of(const std::vector<FileEntry>& parts, std::int64_t more, const pugi::xml_node& at) const;
  void read_parts(const pugi::xml_node& object, const pugi::xml_node& type, const FileEntry& common);
  void set_type(FileEntry& entry, const std::string& type, const pugi::xml_node& at, unsigned bits) const;
  void set_flags(FileEntry& entry, const pugi::xml_node& flags) const;
  void set_values(FileEntry& entry, const pugi::xml_node& info) const;
  pugi::xml_node data_type(const std::string& name) const;

  const EsiDocument& document_;
  EntryAdder& adder_;
  std::map<std::string, pugi::xml_node> types_;
};

}  // namespace servodrome::describe
