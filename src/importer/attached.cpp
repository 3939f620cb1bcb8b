#include "attached.hpp"

#include <fmt/format.h>
#include <tinyxml2.h>

#include <filesystem>
#include <map>
#include <set>

#include "xml_checks.hpp"

namespace fork1s::internal {
namespace {

constexpr double kMostReads = 1000;
constexpr int kDeepest = 50;  // models in models

class AttachedModels {
 public:
  // How many files the reader reads below this one, each as often as it is read.
  double Count(const std::filesystem::path& path, const std::string& text, int depth) {
    std::error_code unresolved;
    const std::string key = std::filesystem::weakly_canonical(path, unresolved).string();
    if (const auto known = counts_.find(key); known != counts_.end()) return known->second;
    open_.insert(key);
    double count = 0;
    VisitOneModel(path.string(), text, [&](const tinyxml2::XMLElement& element, const std::string& file) {
      const char* other = element.Attribute("file");
      if (std::string(element.Name()) != "model" || other == nullptr) return false;
      const std::filesystem::path named = path.parent_path() / other;
      if (open_.count(std::filesystem::weakly_canonical(named, unresolved).string()) > 0)
        return Refuse(file, element,
                      fmt::format("attaches '{}', which attaches this file again; remove one", other));
      if (depth == kDeepest)
        return Refuse(file, element,
                      fmt::format("is the {}th model within a model; attach them side by side", depth));
      count += 1 + Count(named, "", depth + 1);
      if (!error_ && count > kMostReads)
        Refuse(file, element,
               fmt::format(
                   "and what it attaches are {:.6g} files to read, and {:.6g} is the most; make one model of "
                   "what is attached many times, and use <replicate>",
                   count, kMostReads));
      return error_.has_value();
    });
    open_.erase(key);
    return counts_[key] = count;
  }
  const std::optional<Error>& error() const { return error_; }

 private:
  bool Refuse(const std::string& file, const tinyxml2::XMLElement& element, const std::string& what) {
    error_ =
        Error{ErrorCode::kModel, fmt::format("{}, line {}", file, element.GetLineNum()), "<model> " + what};
    return true;
  }

  std::map<std::string, double> counts_;
  std::set<std::string> open_;  // from the first file down to the present one
  std::optional<Error> error_;
};

}  // namespace

std::optional<Error> CheckAttached(const std::string& path, const std::string& text) {
  AttachedModels models;
  models.Count(path, text, 0);
  return models.error();
}

}  // namespace fork1s::internal
