#include "server/command.hpp"

#include <cmath>
#include <map>
#include <nlohmann/json.hpp>

namespace fork1s {
namespace {

using Json = nlohmann::json;

// Thrown inside this file only.
struct Malformed {
  std::string message;
};

const Json& Member(const Json& object, const char* name) {
  const auto at = object.find(name);
  if (at == object.end()) throw Malformed{std::string("the message lacks '") + name + "'"};
  return *at;
}

double Number(const Json& value, const char* name) {
  if (!value.is_number() || !std::isfinite(value.get<double>()))
    throw Malformed{std::string("'") + name + "' must be a finite number"};
  const double v = value.get<double>();
  if (std::abs(v) > 1e9) throw Malformed{std::string("'") + name + "' is out of any range"};
  return v;
}

int Whole(const Json& value, const char* name) {
  const double v = Number(value, name);
  if (v != std::floor(v)) throw Malformed{std::string("'") + name + "' must be a whole number"};
  return static_cast<int>(v);
}

Vector3 Vector(const Json& value, const char* name) {
  if (!value.is_array() || value.size() != 3)
    throw Malformed{std::string("'") + name + "' must be three numbers"};
  Vector3 v;
  for (int i = 0; i < 3; ++i) v(i) = Number(value[static_cast<std::size_t>(i)], name);
  return v;
}

bool Flag(const Json& value, const char* name) {
  if (!value.is_boolean()) throw Malformed{std::string("'") + name + "' must be true or false"};
  return value.get<bool>();
}

Command Read(const Json& message) {
  if (!message.is_object()) throw Malformed{"a message must be a JSON object"};
  const Json& type = Member(message, "type");
  static const std::map<std::string, Command::Kind> kinds = {
      {"pull", Command::Kind::kPull},   {"release", Command::Kind::kRelease},
      {"push", Command::Kind::kPush},   {"pause", Command::Kind::kPause},
      {"step", Command::Kind::kStep},   {"reset", Command::Kind::kReset},
      {"set", Command::Kind::kSet},     {"interfaces", Command::Kind::kInterfaces},
      {"ghost", Command::Kind::kGhost}, {"resume", Command::Kind::kResume},
      {"write", Command::Kind::kWrite}, {"shape", Command::Kind::kShape},
      {"hold", Command::Kind::kHold}};
  const auto kind = type.is_string() ? kinds.find(type.get<std::string>()) : kinds.end();
  if (kind == kinds.end()) throw Malformed{"the message's 'type' is not one that this program knows"};
  Command c;
  c.kind = kind->second;
  switch (c.kind) {
    case Command::Kind::kPull:
    case Command::Kind::kPush:
      c.body = Whole(Member(message, "body"), "body");
      c.point = Vector(Member(message, "point"), "point");
      c.target = Vector(Member(message, "target"), "target");
      break;
    case Command::Kind::kPause:
    case Command::Kind::kGhost:
      c.on = Flag(Member(message, "on"), "on");
      break;
    case Command::Kind::kSet: {
      const Json& setting = Member(message, "setting");
      if (!setting.is_string()) throw Malformed{"'setting' must be a name"};
      c.setting = setting.get<std::string>();
      if (const auto at = message.find("index"); at != message.end()) c.index = Whole(*at, "index");
      c.value = Number(Member(message, "value"), "value");
      break;
    }
    case Command::Kind::kInterfaces: {
      c.index = Whole(Member(message, "mechanism"), "mechanism");
      const Json& bodies = Member(message, "bodies");
      if (!bodies.is_array() || bodies.size() > 4096)
        throw Malformed{"'bodies' must be a list of body numbers"};
      for (const Json& b : bodies) c.bodies.push_back(Whole(b, "bodies"));
      break;
    }
    case Command::Kind::kShape: {
      c.body = Whole(Member(message, "body"), "body");
      const Json& C = Member(message, "compliance");
      if (!C.is_array() || C.size() != 6) throw Malformed{"'compliance' must be six numbers"};
      const auto at = [&](std::size_t i) { return Number(C[i], "compliance"); };
      c.compliance << at(0), at(3), at(4), at(3), at(1), at(5), at(4), at(5), at(2);
      c.factor = Number(Member(message, "factor"), "factor");
      break;
    }
    case Command::Kind::kResume:
      c.index = Whole(Member(message, "sequence"), "sequence");
      break;
    case Command::Kind::kWrite:
      c.tuned = Flag(Member(message, "tuned"), "tuned");
      c.moment = Whole(Member(message, "moment"), "moment");
      c.text_only = Flag(Member(message, "text_only"), "text_only");
      break;
    default:
      break;
  }
  return c;
}

}  // namespace

Expected<Command> ParseCommand(std::string_view text) {
  // Hostile nesting would exhaust the stack of a recursive reader's destructor; ours needs three levels.
  const Json::parser_callback_t shallow = [](int depth, Json::parse_event_t, Json&) {
    if (depth > 4) throw Malformed{"the message is nested too deeply"};
    return true;
  };
  try {
    return Read(Json::parse(text, shallow));
  } catch (const Malformed& e) {
    return Fail(ErrorCode::kFormat, "message", e.message);
  } catch (const Json::exception&) {
    return Fail(ErrorCode::kFormat, "message", "is no JSON with finite numbers");
  }
}

}  // namespace fork1s
