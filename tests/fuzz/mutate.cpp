#include "mutate.hpp"

#include <algorithm>
#include <cctype>

namespace fork1s::fuzz {

std::string Mutator::Change(const std::vector<std::string>& inputs) {
  std::string input = inputs[Below(inputs.size())];
  for (std::size_t changes = 1 + Below(5); changes > 0; --changes) ChangeOnce(input, inputs);
  return input;
}

std::string_view Mutator::Piece(std::string_view text, std::string_view begin, std::string_view end) {
  if (text.empty()) return {};
  std::size_t first = text.find(begin, Below(text.size()));
  if (first == std::string_view::npos) first = text.find(begin);
  if (first == std::string_view::npos) return {};
  const std::size_t last = text.find(end, first + begin.size());
  if (last == std::string_view::npos) return {};
  return text.substr(first, last + end.size() - first);
}

bool Mutator::ChangeXml(std::string& input, const std::vector<std::string>& inputs) {
  const auto place = [&input](std::string_view piece) {
    return static_cast<std::size_t>(piece.data() - input.data());
  };
  const std::string& other = Below(2) ? input : inputs[Below(inputs.size())];
  switch (Below(5)) {
    case 0: {  // an element without content goes, or comes from elsewhere
      const std::string_view here = Piece(input, "<", ">");
      if (here.empty()) return false;
      const std::string there(Piece(other, "<", ">"));
      if (there.size() > 2 && there[there.size() - 2] == '/') {
        input.insert(place(here), there);
      } else if (here[here.size() - 2] == '/') {
        input.erase(place(here), here.size());
      }
      return true;
    }
    case 1: {  // the value of an attribute becomes another's
      const std::string_view here = Piece(input, "=\"", "\"");
      if (here.empty()) return false;
      const std::string there(Piece(other, "=\"", "\""));
      if (!there.empty()) input.replace(place(here), here.size(), there);
      return true;
    }
    default:
      ChangeNumber(input, Below(input.size() + 1));
      return true;
  }
}

void Mutator::ChangeNumber(std::string& input, std::size_t at) {
  static constexpr const char* kNumbers[] = {"0",   "-1",  "1",     "1e308",      "-1e308", "1e-300", "nan",
                                             "inf", "1e9", "1e-12", "2147483647", "",       "0x10",   "1e"};
  const auto is_number = [](char c) {
    return std::isdigit(static_cast<unsigned char>(c)) || c == '.' || c == '-';
  };
  const auto first = std::find_if(input.begin() + static_cast<std::ptrdiff_t>(at), input.end(), is_number);
  const auto last = std::find_if_not(first, input.end(), is_number);
  // Half of the numbers only change a little: what is refused at once tells nothing.
  if (first == last) return;
  if (Below(2)) {
    char& digit = *(first + static_cast<std::ptrdiff_t>(Below(static_cast<std::size_t>(last - first))));
    if (digit != '.') digit = static_cast<char>('0' + Below(10));
  } else {
    input.replace(first, last, kNumbers[Below(std::size(kNumbers))]);
  }
}

void Mutator::ChangeOnce(std::string& input, const std::vector<std::string>& inputs) {
  const bool is_xml = input.find("</") != std::string::npos;
  if (is_xml && Below(12) && ChangeXml(input, inputs)) return;
  const std::size_t at = Below(input.size() + 1);
  switch (Below(7)) {
    case 0:
      if (at < input.size()) input[at] = static_cast<char>(input[at] ^ (1 << Below(8)));
      break;
    case 1:
      if (at < input.size()) input[at] = static_cast<char>(Below(256));
      break;
    case 2:
      input.insert(at, 1 + Below(8), static_cast<char>(Below(256)));
      break;
    case 3:
      input.erase(at, 1 + Below(24));
      break;
    case 4: {  // a stretch of this or another input
      const std::string& other = inputs[Below(inputs.size())];
      if (other.empty()) break;
      const std::size_t from = Below(other.size());
      input.insert(at, other.substr(from, 1 + Below(64)));
      break;
    }
    default:
      ChangeNumber(input, at);
  }
}

}  // namespace fork1s::fuzz
