#include "output.hpp"

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

namespace {

const char* KindName(ImportNote::Kind kind) {
  switch (kind) {
    case ImportNote::Kind::kDropped:
      return "dropped";
    case ImportNote::Kind::kChanged:
      return "changed";
    case ImportNote::Kind::kChosen:
      return "chosen";
  }
  return "";
}

}  // namespace

Json NotesJson(const ImportReport& report) {
  Json notes = Json::array();
  for (const ImportNote& n : report.notes)
    notes.push_back(fmt::format("{}: {}: {}", KindName(n.kind), n.where, n.message));
  return notes;
}

void PrintNotes(const ImportReport& report) {
  for (const ImportNote& n : report.notes)
    fmt::print(stderr, "note: {}: {}: {}\n", KindName(n.kind), n.where, n.message);
}

int Report(const Error& error, bool json) {
  fmt::print(stderr, "fork1s: {}\n", error.Text());
  int code = kRefused;
  if (error.code == ErrorCode::kUsage) code = kBadUsage;
  if (error.code == ErrorCode::kNumerics) code = kNumericsFailed;
  if (json) {
    const Json object = {
        {"error", {{"where", error.where}, {"message", error.message}, {"exit_code", code}}}};
    fmt::print("{}\n", ToText(object, 2));
  }
  return code;
}

}  // namespace fork1s::app
