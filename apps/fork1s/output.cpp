#include "output.hpp"
#include "print.hpp"

#include <fmt/core.h>

namespace fork1s::app {

Json ToJson(const MatrixX& m) {
  if (m.size() == 0) return nullptr;
  Json rows = Json::array();
  for (Eigen::Index i = 0; i < m.rows(); ++i) {
    Json row = Json::array();
    for (Eigen::Index j = 0; j < m.cols(); ++j) row.push_back(m(i, j));
    rows.push_back(std::move(row));
  }
  return rows;
}

Json ToJson(const Vector3& v) { return Json::array({v.x(), v.y(), v.z()}); }
Json ToJson(const Quaternion& q) { return Json::array({q.w(), q.x(), q.y(), q.z()}); }

std::string ToText(const Json& json, int indent) {
  return json.dump(indent, ' ', false, Json::error_handler_t::replace);
}

Json NotesJson(const ImportReport& report) {
  Json notes = Json::array();
  for (const ImportNote& n : report.notes) notes.push_back(n.Text());
  return notes;
}

void PrintNotes(const ImportReport& report) {
  for (const ImportNote& n : report.notes) PrintText(stderr, "note: {}\n", n.Text());
}

// A name or a number of a file can be as long as the file.
std::string Abridged(const std::string& text) {
  constexpr std::size_t kBegin = 1000, kEnd = 500;
  if (text.size() <= kBegin + kEnd) return text;
  const auto whole_letter = [&](std::size_t at) {  // in UTF-8
    while (at < text.size() && (text[at] & 0xC0) == 0x80) ++at;
    return at;
  };
  const std::size_t first = whole_letter(kBegin), last = whole_letter(text.size() - kEnd);
  return fmt::format("{} [{} bytes left out] {}", text.substr(0, first), last - first, text.substr(last));
}

int Report(const Error& error, bool json) {
  PrintText(stderr, "fork1s: {}\n", Abridged(error.Text()));
  int code = kRefused;
  if (error.code == ErrorCode::kUsage) code = kBadUsage;
  if (error.code == ErrorCode::kNumerics) code = kNumericsFailed;
  if (json) {
    const Json object = {
        {"error", {{"where", error.where}, {"message", error.message}, {"exit_code", code}}}};
    PrintText("{}\n", ToText(object, 2));
  }
  return code;
}

}  // namespace fork1s::app
