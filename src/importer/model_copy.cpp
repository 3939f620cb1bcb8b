// Numbers of an MJCF text changed in place: nothing else of the text moves.
#include "importer/model_copy.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <map>
#include <numbers>
#include <optional>

#include "names.hpp"
#include "xml_checks.hpp"
#include "xml_tags.hpp"

namespace fork1s {
namespace {

using Of = ModelChange::Of;
using Quantity = ModelChange::Quantity;

using internal::FindTags;
using internal::XmlTag;

std::string Number(double x) { return fmt::format("{:.10g}", x); }

class ModelEditor {
 public:
  explicit ModelEditor(const std::string& text) : text_(text), tags_(FindTags(text)) {
    for (const XmlTag& tag : tags_)
      if (tag.name == "compiler")
        if (const auto angle = Value(tag, "angle"); angle == "radian") degrees_ = false;
  }

  void Make(const ModelChange& change) {
    if (change.of == Of::kActuator) return MakeActuator(change);
    const bool shape = change.of == Of::kShape;
    const int at = Find(change, "worldbody", change.of == Of::kJoint ? "joint" : shape ? "geom" : "body");
    if (at < 0) return;
    const XmlTag& tag = tags_[static_cast<std::size_t>(at)];
    switch (change.quantity) {
      case Quantity::kStiffness:
        return Set(tag, "stiffness", Number(change.value));
      case Quantity::kDamping:
        return Set(tag, "damping", Number(change.value));
      case Quantity::kDryFriction:
        return Set(tag, "frictionloss", Number(change.value));
      case Quantity::kRange: {
        const bool turns = Value(tag, "type") != "slide";
        const double unit = degrees_ && turns ? 180 / std::numbers::pi : 1;
        if (!Value(tag, "margin").empty()) Set(tag, "margin", "0");  // the range has it inside
        return SetRange(tag, change, "range", unit);
      }
      case Quantity::kInertia:
        return SetInertia(at, change);
      case Quantity::kFriction:
        if (shape) return SetFriction(tag, change.value);
        for (const XmlTag& child : tags_)
          if (child.parent == at && child.name == "geom") SetFriction(child, change.value);
        return;
      case Quantity::kForceRange:
        return;
    }
  }

  void Add(const std::string& moment) {
    if (moment.empty()) return;
    const XmlTag& root = tags_[0];
    Replace(root.close, 0, fmt::format("  <keyframe>\n    {}\n  </keyframe>\n", moment));
  }

  ChangedText Release() {
    for (const auto& [tag, g] : general_) WriteGeneral(tags_[tag], g);
    // From the end on, so that places before stay what they are.
    std::stable_sort(edits_.begin(), edits_.end(), [](const Edit& a, const Edit& b) { return a.at > b.at; });
    ChangedText out{text_, std::move(notes_)};
    for (const Edit& e : edits_) out.text.replace(e.at, e.length, e.by);
    return out;
  }

 private:
  struct Edit {
    std::size_t at, length;
    std::string by;
  };
  struct General {
    std::optional<double> stiffness, damping;
  };

  std::string Value(const XmlTag& tag, const std::string& attribute) const {
    const auto at = tag.attributes.find(attribute);
    if (at == tag.attributes.end()) return "";
    return text_.substr(at->second.value_begin, at->second.value_end - at->second.value_begin);
  }

  bool StandsIn(const XmlTag& tag, const std::string& section) const {
    for (int p = tag.parent; p >= 0; p = tags_[static_cast<std::size_t>(p)].parent)
      if (tags_[static_cast<std::size_t>(p)].name == section) return true;
    return false;
  }

  // The element of that name; -1, with a note, where there is none or several.
  int Find(const ModelChange& change, const std::string& section, const std::string& element) {
    std::vector<int> found;
    for (std::size_t i = 0; i < tags_.size(); ++i) {
      const bool fits =
          element.empty() || tags_[i].name == element || (element == "joint" && tags_[i].name == "freejoint");
      if (fits && Value(tags_[i], "name") == change.name && StandsIn(tags_[i], section))
        found.push_back(static_cast<int>(i));
    }
    if (found.size() == 1) return found[0];
    const char* what = element.empty() ? "actuator" : element == "geom" ? "shape" : element.c_str();
    notes_.push_back(fmt::format(
        "{} '{}' was not written: {}", what, change.name,
        found.empty()
            ? "the file itself has no element of that name (it may stand in an included file, or have none)"
            : "several elements of the file have that name"));
    return -1;
  }

  void Replace(std::size_t at, std::size_t length, std::string by) {
    edits_.push_back({at, length, std::move(by)});
  }

  void Set(const XmlTag& tag, const std::string& attribute, const std::string& value) {
    if (const auto at = tag.attributes.find(attribute); at != tag.attributes.end())
      return Replace(at->second.value_begin, at->second.value_end - at->second.value_begin, value);
    Replace(tag.end - (tag.closes_itself ? 2 : 1), 0, fmt::format(" {}=\"{}\"", attribute, value));
  }

  void SetRange(const XmlTag& tag, const ModelChange& change, const char* attribute, double unit) {
    if (!std::isfinite(change.value) || !std::isfinite(change.upper)) {
      notes_.push_back(fmt::format("'{}' was not written into {} '{}': a file has both bounds or none",
                                   attribute, tag.name, change.name));
      return;
    }
    Set(tag, attribute, Number(unit * change.value) + " " + Number(unit * change.upper));
  }

  void SetFriction(const XmlTag& tag, double value) {
    std::vector<std::string> words = internal::SplitWords(Value(tag, "friction"));
    if (words.empty()) words.emplace_back();
    words[0] = Number(value);
    Set(tag, "friction", Joined(words));
  }

  // Given whole: what shapes would have brought no longer counts.
  void SetInertia(int body, const ModelChange& change) {
    const Matrix3& I = change.inertia.rotational;
    const Vector3& p = change.inertia.center;
    const std::string text =
        fmt::format("<inertial pos=\"{} {} {}\" mass=\"{}\" fullinertia=\"{} {} {} {} {} {}\"/>",
                    Number(p.x()), Number(p.y()), Number(p.z()), Number(change.inertia.mass), Number(I(0, 0)),
                    Number(I(1, 1)), Number(I(2, 2)), Number(I(0, 1)), Number(I(0, 2)), Number(I(1, 2)));
    for (const XmlTag& tag : tags_)
      if (tag.parent == body && tag.name == "inertial") {
        const std::size_t end = tag.closes_itself ? tag.end : text_.find('>', tag.close) + 1;
        return Replace(tag.begin, end - tag.begin, text);
      }
    const XmlTag& tag = tags_[static_cast<std::size_t>(body)];
    if (tag.closes_itself) {
      notes_.push_back(
          fmt::format("the mass of body '{}' was not written: its element is empty", change.name));
      return;
    }
    Replace(tag.end, 0, "\n" + std::string(Indent(tag.begin) + 2, ' ') + text);
  }

  std::size_t Indent(std::size_t at) const {
    const std::size_t line = text_.rfind('\n', at);
    return at - (line == std::string::npos ? 0 : line + 1);
  }

  void MakeActuator(const ModelChange& change) {
    const int at = Find(change, "actuator", "");
    if (at < 0) return;
    const XmlTag& tag = tags_[static_cast<std::size_t>(at)];
    if (change.quantity == Quantity::kForceRange) return SetRange(tag, change, "forcerange", 1);
    const bool stiffness = change.quantity == Quantity::kStiffness;
    if (tag.name == "position" || tag.name == "intvelocity" || tag.name == "velocity") {
      Set(tag, stiffness ? "kp" : "kv", Number(change.value));
      if (!stiffness && tag.attributes.count("dampratio") > 0) Set(tag, "dampratio", "0");
      return;
    }
    if (tag.name == "general") {
      General& g = general_[static_cast<std::size_t>(at)];
      (stiffness ? g.stiffness : g.damping) = change.value;
      return;
    }
    notes_.push_back(fmt::format("the {} of actuator '{}' was not written: a <{}> has no such number",
                                 stiffness ? "stiffness" : "damping", change.name, tag.name));
  }

  // All changes of one element are written at once.
  void WriteGeneral(const XmlTag& tag, const General& g) {
    for (const char* parameters : {"biasprm", "gainprm"})
      if (tag.attributes.count(parameters) == 0 && (g.stiffness || parameters[0] == 'b')) {
        notes_.push_back(fmt::format(
            "the changes of actuator '{}' were not written: its {} is that of a class or the default; write it into the "
            "element",
            Value(tag, "name"), parameters));
        return;
      }
    std::vector<std::string> gain = internal::SplitWords(Value(tag, "gainprm")),
                             bias = internal::SplitWords(Value(tag, "biasprm"));
    gain.resize(std::max<std::size_t>(gain.size(), 1), "1");
    bias.resize(std::max<std::size_t>(bias.size(), 3), "0");
    if (g.stiffness) {
      // The input goes on meaning the same set-point.
      const double before = -std::strtod(bias[1].c_str(), nullptr);
      const double per_unit = before > 0 ? std::strtod(gain[0].c_str(), nullptr) / before : 1;
      gain[0] = Number(per_unit * *g.stiffness);
      bias[1] = Number(-*g.stiffness);
      Set(tag, "gainprm", Joined(gain));
    }
    if (g.damping) bias[2] = Number(-*g.damping);
    Set(tag, "biasprm", Joined(bias));
  }

  static std::string Joined(const std::vector<std::string>& words) {
    std::string all;
    for (const std::string& word : words) all += (all.empty() ? "" : " ") + word;
    return all;
  }

  const std::string& text_;
  std::vector<XmlTag> tags_;
  std::vector<Edit> edits_;
  std::vector<std::string> notes_;
  std::map<std::size_t, General> general_;  // by tag
  bool degrees_ = true;
};

}  // namespace

Expected<std::string> ReadModelText(const std::string& path) { return internal::ReadFile(path); }

Expected<ChangedText> ChangeModelText(const std::string& path, const std::string& text,
                                      const std::vector<ModelChange>& changes, const std::string& moment) {
  const auto root = internal::RootElement(path, text);
  if (!root) return tl::unexpected(root.error());
  if (*root != "mujoco")
    return Fail(ErrorCode::kFormat, path,
                "is no MJCF; numbers are written into MJCF only, so convert it first and tune that file");
  ModelEditor editor(text);
  for (const ModelChange& change : changes) editor.Make(change);
  editor.Add(moment);
  return editor.Release();
}

}  // namespace fork1s
