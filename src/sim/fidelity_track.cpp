#include <charconv>
#include <cmath>
#include <cstdlib>
#include <fork1s/sim/fidelity.hpp>
#include <sstream>

namespace fork1s {
namespace {

std::vector<std::string> Split(const std::string& text, char at) {
  std::vector<std::string> parts;
  std::stringstream stream(text);
  for (std::string part; std::getline(stream, part, at);) parts.push_back(part);
  if (!text.empty() && text.back() == at) parts.emplace_back();  // getline passes over an empty last part
  return parts;
}

auto Refuse(const std::string& what) {
  return Fail(
      ErrorCode::kUsage, "detail",
      what +
          "; write [TIME:]WORD[+WORD...] with commas between entries, words being object, interface, "
          "parents, all, modes=K, exact, expanded, curved and twist, as in interface,2:object+modes=0");
}

Expected<void> Read(const std::string& word, Fidelity& fidelity) {
  for (DetailLevel level :
       {DetailLevel::kObject, DetailLevel::kInterface, DetailLevel::kParents, DetailLevel::kAll})
    if (word == Name(level)) return fidelity.level = level, Expected<void>();
  if (const auto recovery = RecoveryNamed(word)) return fidelity.recovery = *recovery, Expected<void>();
  if (word.rfind("modes=", 0) == 0) {
    const char *first = word.data() + 6, *last = word.data() + word.size();
    int modes = -1;
    const auto read = std::from_chars(first, last, modes);
    if (read.ec == std::errc() && read.ptr == last && modes >= 0)
      return fidelity.modes = modes, Expected<void>();
  }
  return Refuse("'" + word + "' is no level of detail");
}

}  // namespace

Expected<FidelityTrack> FidelityTrack::Parse(const std::string& text, const Fidelity& initial) {
  FidelityTrack track;
  Fidelity fidelity = initial;
  for (const std::string& part : Split(text, ',')) {
    Entry entry;
    std::string words = part;
    if (const auto colon = part.find(':'); colon != std::string::npos) {
      const std::string time = part.substr(0, colon);
      char* end = nullptr;
      entry.time = std::strtod(time.c_str(), &end);
      if (time.empty() || *end != 0 || !std::isfinite(entry.time) || entry.time < 0)
        return Refuse("'" + time + "' is no time in s, 0 or more");
      words = part.substr(colon + 1);
    }
    if (words.empty()) return Refuse("'" + part + "' names no level of detail");
    for (const std::string& word : Split(words, '+'))
      if (auto read = Read(word, fidelity); !read) return tl::unexpected(read.error());
    if (!track.entries.empty() && entry.time <= track.entries.back().time)
      return Refuse("times must increase, and '" + part + "' does not");
    entry.fidelity = fidelity;
    track.entries.push_back(entry);
  }
  if (track.entries.empty()) return Refuse("no level of detail is given");
  return track;
}

}  // namespace fork1s
