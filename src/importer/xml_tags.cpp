#include "xml_tags.hpp"

#include <cctype>

namespace fork1s::internal {
namespace {

void ReadAttributes(const std::string& text, XmlTag& tag, std::size_t at) {
  const auto is_space = [&](std::size_t i) { return std::isspace(static_cast<unsigned char>(text[i])) != 0; };
  const std::size_t stop = tag.end - (tag.closes_itself ? 2 : 1);
  while (at < stop) {
    const std::size_t before = at;
    while (at < stop && is_space(at)) ++at;
    const std::size_t name = at;
    while (at < stop && !is_space(at) && text[at] != '=') ++at;
    const std::string key = text.substr(name, at - name);
    while (at < stop && text[at] != '"' && text[at] != '\'') ++at;
    if (at >= stop || key.empty()) return;
    const std::size_t value_end = text.find(text[at], at + 1);
    tag.attributes[key] = {before, value_end + 1, at + 1, value_end};
    at = value_end + 1;
  }
}

}  // namespace

std::vector<XmlTag> FindTags(const std::string& text) {
  std::vector<XmlTag> tags;
  std::vector<int> open;
  for (std::size_t at = text.find('<'); at != std::string::npos; at = text.find('<', at)) {
    const auto skip = [&](const char* begin, const char* end) {
      if (text.compare(at, std::char_traits<char>::length(begin), begin) != 0) return false;
      at = text.find(end, at);
      at = at == std::string::npos ? text.size() : at + std::char_traits<char>::length(end);
      return true;
    };
    if (skip("<!--", "-->") || skip("<![CDATA[", "]]>") || skip("<?", "?>") || skip("<!", ">")) continue;
    if (text.compare(at, 2, "</") == 0) {
      if (!open.empty()) {
        tags[static_cast<std::size_t>(open.back())].close = at;
        open.pop_back();
      }
      at = text.find('>', at);
      continue;
    }
    XmlTag tag;
    tag.begin = at;
    std::size_t end = at + 1;
    while (end < text.size() && std::isspace(static_cast<unsigned char>(text[end])) == 0 &&
           text[end] != '>' && text[end] != '/')
      ++end;
    tag.name = text.substr(at + 1, end - at - 1);
    const std::size_t attributes = end;
    char quote = 0;
    for (; end < text.size() && (quote != 0 || text[end] != '>'); ++end) {
      if (quote != 0)
        quote = text[end] == quote ? 0 : quote;
      else if (text[end] == '"' || text[end] == '\'')
        quote = text[end];
    }
    tag.end = end + 1;
    tag.closes_itself = end > 0 && text[end - 1] == '/';
    tag.close = tag.closes_itself ? tag.end - 2 : tag.end;
    tag.parent = open.empty() ? -1 : open.back();
    ReadAttributes(text, tag, attributes);
    if (!tag.closes_itself) open.push_back(static_cast<int>(tags.size()));
    tags.push_back(std::move(tag));
    at = end;
  }
  return tags;
}

}  // namespace fork1s::internal
