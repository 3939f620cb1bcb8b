// Elements of an XML text by where they stand in it, to change a text and leave the rest as it was written.
#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <vector>

namespace fork1s::internal {

/// A start tag by where it stands in the text.
struct XmlTag {
  struct Attribute {
    std::size_t begin, end;              // with the space before it
    std::size_t value_begin, value_end;  // without quotes
  };
  std::string name;
  std::size_t begin = 0, end = 0;  // "<" and behind ">"
  std::size_t close = 0;           // "<" of the end tag; that of "/>" where it has none
  bool closes_itself = false;
  int parent = -1;
  std::map<std::string, Attribute> attributes;
};

/// Of a text that a parser has taken: only what separates tags is looked at.
std::vector<XmlTag> FindTags(const std::string& text);

}  // namespace fork1s::internal
