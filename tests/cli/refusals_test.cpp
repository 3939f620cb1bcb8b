// Bad input: exit code 3 (or 2 for usage), one sentence that names the place, no crash.
#include <string>
#include <utility>
#include <vector>

#include "command.hpp"

namespace fork1s::test {
namespace {

std::string Replaced(std::string text, const std::string& from, const std::string& to) {
  const auto at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

struct Bad {
  const char* name;
  const char* from;
  const char* to;
  const char* named;  // must appear in the message
};

class BadModel : public testing::TestWithParam<Bad> {};

TEST_P(BadModel, IsRefusedByName) {
  const Bad& bad = GetParam();
  const std::string model = Write("bad.xml", Replaced(FingerModel(), bad.from, bad.to));
  for (const char* command : {"inspect ", "reduce ", "run --time 0.1 "}) {
    const Outcome o = Fork1s(command + model);
    EXPECT_EQ(o.code, 3) << command << o.err;
    EXPECT_NE(o.err.find("bad.xml"), std::string::npos) << o.err;
    EXPECT_NE(o.err.find(bad.named), std::string::npos) << o.err;
  }
}

INSTANTIATE_TEST_SUITE_P(
    Inputs, BadModel,
    testing::Values(Bad{"nan_mass", "mass=\".05\"", "mass=\"nan\"", "nan"},
                    Bad{"negative_mass", "mass=\".05\"", "mass=\"-1\"", "mass"},
                    Bad{"negative_stiffness", "stiffness=\"2\"", "stiffness=\"-2\"", "knuckle"},
                    Bad{"infinite_stiffness", "stiffness=\"2\"", "stiffness=\"inf\"", "inf"},
                    Bad{"unknown_interface", "data=\"tip\"", "data=\"tipp\"", "tipp"},
                    Bad{"empty_interface", "data=\"tip\"", "data=\" \"", "fork1s_interface"},
                    Bad{"unknown_attribute", "stiffness=\"2\"", "stiffnes=\"2\"", "stiffnes"},
                    Bad{"missing_mesh", "<worldbody>",
                        "<asset><mesh name=\"m\" file=\"none.stl\"/></asset><worldbody>"
                        "<geom type=\"mesh\" mesh=\"m\"/>",
                        "none.stl"},
                    Bad{"cut_off", "</worldbody>", "", "line"},
                    Bad{"negative_modes", "data=\"2\"/></custom>", "data=\"-1\"/></custom>", "fork1s_modes"}),
    [](const auto& parameter) { return parameter.param.name; });

TEST(Hidden, UnsprungJointIsNamed) {
  // A second finger that no interface sees, with a hinge that nothing holds.
  const std::string model = Write("hidden.xml", Replaced(FingerModel(), "<body name=\"ball\"", R"(
    <body name="other" pos="0 .1 .3"><joint name="base2" type="hinge" axis="0 1 0" stiffness="1"/>
      <geom type="sphere" size=".01" mass=".1"/>
      <body name="loose" pos="0 0 -.1"><joint name="limp" type="hinge" axis="0 1 0"/>
        <geom type="sphere" size=".01" mass=".1" pos="0 0 -.05"/></body></body>
    <body name="ball")"));
  const std::string one = Replaced(Slurp(model), "<body name=\"proximal\" pos=\"0 0 .3\">",
                                   "<body name=\"palm\"><body name=\"proximal\" pos=\"0 0 .3\">");
  const std::string joined =
      Write("hidden.xml", Replaced(one, "<body name=\"ball\"", "</body><body name=\"ball\""));
  const Outcome o = Fork1s("reduce " + joined);
  EXPECT_EQ(o.code, 3) << o.err << o.out;
  EXPECT_NE(o.err.find("'limp'"), std::string::npos) << o.err;
  EXPECT_EQ(Fork1s("reduce --pd 1,0.1 " + joined).code, 0);
  EXPECT_EQ(Fork1s("reduce --interface tip,loose " + joined).code, 0);
}

// Two springs of 10 N·m/rad in series about one axis, and no mass between them, turn 0.004 kg·m² at 5.627 Hz.
TEST(Hidden, CoincidentSprungJointsActInSeries) {
  const std::string model = Write(
      "coincident.xml",
      "<mujoco><worldbody><body name=\"a\"><joint name=\"j1\" axis=\"0 0 1\" stiffness=\"10\"/><joint name=\"j2\" "
      "axis=\"0 0 1\" stiffness=\"10\"/><geom size=\".1\" mass=\"1\"/></body></worldbody></mujoco>");
  const Outcome reduced = Fork1s("reduce --json " + model);
  ASSERT_EQ(reduced.code, 0) << reduced.err;
  EXPECT_NEAR(reduced.Json()["frequencies_hz"]["reduced"][0].get<double>(), 5.626976975981913, 1e-9);
  EXPECT_EQ(Fork1s("run --time 0.1 " + model).code, 0);
}

// Three springs of 100 N·m/rad in series between links of 100, 1e-9 and 100 kg.
TEST(Hidden, MasslessLinksBetweenHeavyOnesAreSimulated) {
  const auto link = [](const std::string& name, const std::string& at, const char* mass, const char* inertia,
                       const std::string& inner) {
    return "<body name=\"" + name + "\" pos=\"" + at + "\"><inertial pos=\"0 0 0\" mass=\"" + mass +
           "\" diaginertia=\"" + inertia + "\"/><joint name=\"j_" + name +
           "\" axis=\"0 1 0\" stiffness=\"100\" damping=\"1\"/><geom size=\".02\"/>" + inner + "</body>";
  };
  const std::string model = Write("massless.xml", "<mujoco><option gravity=\"0 0 0\"/><worldbody>" +
                                                      link("a", "0 0 1", "100", "1 1 1",
                                                           link("mid", ".5 0 0", "1e-9", "1e-12 1e-12 1e-12",
                                                                link("b", ".1 0 0", "100", "1 1 1", ""))) +
                                                      "</worldbody></mujoco>");
  const Outcome reduced = Fork1s("reduce --interface b --json " + model);
  ASSERT_EQ(reduced.code, 0) << reduced.err;
  EXPECT_NEAR(reduced.Json()["compliance_world"][1][1].get<double>(), 3 / 100.0, 1e-9);
  EXPECT_EQ(Fork1s("run --time 0.1 " + model).code, 0);
  const Outcome compared = Fork1s("compare --json --time 0.1 " + model);
  EXPECT_EQ(compared.code, 0) << compared.err;
}

TEST(Usage, ExitCodeTwo) {
  const std::string model = Write("finger.xml", FingerModel());
  for (const std::string& arguments :
       {std::string(), std::string("run"), "fly " + model, "run --dt -1 " + model,
        "run --recovery half " + model, "reduce --pd 1 " + model, "statics --force 1,2 --body tip " + model,
        "run --modes x " + model})
    EXPECT_EQ(Fork1s(arguments).code, 2) << arguments;
  EXPECT_EQ(Fork1s("--help").code, 0);
  EXPECT_EQ(Fork1s("--version").code, 0);
}

TEST(Usage, TimesAreNumbersOrQuotients) {
  const std::string model = Write("finger.xml", FingerModel());
  const auto printed = [&](const std::string& arguments) {
    const Outcome o = Fork1s("run --json " + arguments + " " + model);
    EXPECT_EQ(o.code, 0) << arguments << "\n" << o.err;
    return o.code == 0 ? o.Json() : nlohmann::json();
  };
  const auto quotients = printed("--dt 1/240 --time 1/8"),
             numbers = printed("--dt 4.1666666666666666e-3 --time .125");
  EXPECT_EQ(quotients["steps"], 30);
  EXPECT_EQ(quotients["dt_s"], 1.0 / 240);
  EXPECT_EQ(numbers["dt_s"], 1.0 / 240);
  for (const char* words :
       {"compare --dt 1/100 --time 1/10 --refinements 0", "view --no-open --port 0 --dt 1/60 --time 1/60"})
    EXPECT_EQ(Fork1s(std::string(words) + " " + model).code, 0) << words;
  for (const char* time : {"1/0", "1/", "/60", "1/60/2", "-1/60", "1/x", "0/60", "nan/2"})
    for (const char* option : {"run --dt ", "view --time "}) {
      const Outcome o = Fork1s(option + std::string(time) + " " + model);
      EXPECT_EQ(o.code, 2) << option << time;
      EXPECT_NE(o.err.find("1/60"), std::string::npos) << o.err;
    }
}

TEST(Usage, NearCommandsAndOptionsAreNamed) {
  const std::string model = Write("finger.xml", FingerModel());
  const std::pair<std::string, std::string> cases[] = {{"rnu " + model, "'run'"},
                                                       {"run --tiem 3 " + model, "'--time'"},
                                                       {"run --tiem=3", "'--time'"},
                                                       {"run --integrator twostage " + model, "'two-stage'"},
                                                       {"compare --against mujco " + model, "'mujoco'"}};
  for (const auto& [arguments, near] : cases) {
    const Outcome o = Fork1s(arguments);
    EXPECT_EQ(o.code, 2) << arguments;
    EXPECT_NE(o.err.find(near), std::string::npos) << arguments << "\n" << o.err;
  }
}

// Options of the command come first; types, ranges and numbers of enumerators stand nowhere.
TEST(Usage, HelpHasOwnOptionsFirst) {
  for (const char* command :
       {"inspect", "reduce", "statics", "run", "compare", "view", "bench", "export", "replay"}) {
    const Outcome o = Fork1s(std::string(command) + " --help");
    ASSERT_EQ(o.code, 0);
    for (const char* raw : {"->", "ENUM", "2147483647", "FLOAT", "INT", ":{", " OR "})
      EXPECT_EQ(o.out.find(raw), std::string::npos) << command << ": " << raw << "\n" << o.out;
  }
  const std::string help = Fork1s("run --help").out;
  EXPECT_LT(help.find("--time"), help.find("Options of the model"));
  EXPECT_GT(help.find("--interface"), help.find("Options of the model"));
}

TEST(Names, UnknownOnesListWhatThereIs) {
  const std::string model = Write("finger.xml", FingerModel());
  const Outcome body = Fork1s("statics --force 0,0,1 --body thumb " + model);
  EXPECT_EQ(body.code, 2);  // the word on the command line is at fault
  EXPECT_NE(body.err.find("tip"), std::string::npos) << body.err;
  const Outcome control = Fork1s("run --controls " + Write("c.csv", "time,twist\n0,1\n") + " " + model);
  EXPECT_EQ(control.code, 3);
  EXPECT_NE(control.err.find("bend"), std::string::npos) << control.err;
  EXPECT_EQ(Fork1s("run --keyframe home " + model).code, 2);
}

// A wrong name is refused by every command behind the option as it was typed, and no line of ours is in it.
TEST(Names, AreRefusedInTheUsersWords) {
  const std::string model = Write("finger.xml", FingerModel());
  const std::string file = (ScratchFolder() / "named.h5").string();
  ASSERT_EQ(Fork1s("run --time 0.1 --record " + file + " " + model).code, 0);
  std::vector<std::pair<std::string, std::string>> lines;  // command, option
  for (const char* command :
       {"inspect", "reduce", "statics --body tip", "run", "compare", "view --no-open --port 0"})
    for (const char* option : {"--interface", "--keyframe", "--q", "--pd"}) {
      const std::string value = std::string(option) == "--q"    ? "nobody=1"
                                : std::string(option) == "--pd" ? "nobody=1,1"
                                                                : "nobody";
      lines.emplace_back(std::string(command) + " " + option + " " + value + " " + model, option);
    }
  for (const char* command : {"run", "compare"})
    lines.emplace_back(std::string(command) + " --push nobody:1,0,0 " + model, "--push");
  lines.emplace_back("statics --body nobody --force 0,0,1 " + model, "--body");
  lines.emplace_back("export --look-at nobody --at 0 " + file + " " + (ScratchFolder() / "n.png").string(),
                     "--look-at");
  for (const auto& [line, option] : lines) {
    const Outcome o = Fork1s(line);
    EXPECT_EQ(o.code, 2) << line << "\n" << o.err;
    EXPECT_NE(o.err.find(option), std::string::npos) << line << "\n" << o.err;
    EXPECT_NE(o.err.find("'nobody'"), std::string::npos) << line << "\n" << o.err;
    for (const char* ours : {".cpp", ".hpp", "requirement"})
      EXPECT_EQ(o.err.find(ours), std::string::npos) << line << "\n" << o.err;
  }
}

TEST(Files, MissingEmptyAndForeign) {
  EXPECT_EQ(Fork1s("run /no/such/file.xml").code, 3);
  EXPECT_EQ(Fork1s("run " + Write("empty.xml", "")).code, 3);
  EXPECT_EQ(Fork1s("run " + Write("text.xml", "hello")).code, 3);
  EXPECT_EQ(Fork1s("run " + Write("other.xml", "<html></html>")).code, 3);
  EXPECT_EQ(Fork1s("replay /no/such/file.h5").code, 3);
  EXPECT_EQ(Fork1s("replay " + Write("text.h5", "hello")).code, 3);
  const std::string model = Write("finger.xml", FingerModel());
  const std::string bad = Write("bad.csv", "time,bend\n0,0\n1,nan\n");
  const Outcome csv = Fork1s("run --controls " + bad + " " + model);
  EXPECT_EQ(csv.code, 3);
  EXPECT_NE(csv.err.find("bad.csv"), std::string::npos) << csv.err;
  EXPECT_EQ(Fork1s("run --record /no/such/folder/run.h5 " + model).code, 3);
}

TEST(Exports, UnknownExtensionsListTheKnown) {
  const std::string model = Write("finger.xml", FingerModel());
  const std::string file = (ScratchFolder() / "short.h5").string();
  ASSERT_EQ(Fork1s("run --time 0.1 --record " + file + " " + model).code, 0);
  const std::string out = (ScratchFolder() / "run.fbx").string();
  const Outcome o = Fork1s("export " + file + " " + out);
  EXPECT_EQ(o.code, 2);
  for (const char* known : {"'.fbx'", ".html", ".glb", ".gltf", ".mp4", ".png", "run.fbx/"})
    EXPECT_NE(o.err.find(known), std::string::npos) << o.err;
  EXPECT_FALSE(std::filesystem::exists(out));
  EXPECT_EQ(Fork1s("export " + file + " " + out + "/").code, 0);  // a folder of that name, if it must be
  EXPECT_EQ(Fork1s("export " + file + " " + out).code, 0);        // now it is one
  EXPECT_TRUE(std::filesystem::exists(out + "/poses.csv"));
  EXPECT_EQ(Fork1s("export --fps 30 " + file + " " + out).code, 2);  // tables have no keys
  for (const std::string log : {"run.mcap", "run.rrd"}) {
    const Outcome other = Fork1s("export " + file + " " + log);
    EXPECT_EQ(other.code, 2);
    EXPECT_NE(other.err.find("python -m fork1s.logs " + file + " " + log), std::string::npos) << other.err;
    EXPECT_NE(other.err.find("pip install 'fork1s[logs]'"), std::string::npos) << other.err;
  }
  EXPECT_EQ(Fork1s("export --fps -1 " + file + " run.glb").code, 2);
  EXPECT_EQ(Fork1s("export " + file + " /no/such/folder/run.glb").code, 3);
}

TEST(Files, TruncatedRecordings) {
  const std::string model = Write("finger.xml", FingerModel());
  const std::string file = (ScratchFolder() / "whole.h5").string();
  ASSERT_EQ(Fork1s("run --time 0.5 --record " + file + " " + model).code, 0);
  const std::string whole = Slurp(file);
  for (double share : {0.0, 0.01, 0.3, 0.7, 0.999}) {
    const std::string cut =
        Write("cut.h5", whole.substr(0, static_cast<std::size_t>(share * static_cast<double>(whole.size()))));
    const Outcome o = Fork1s("replay " + cut);
    EXPECT_EQ(o.code, 3) << share << o.err;
    EXPECT_NE(o.err.find("cut.h5"), std::string::npos);
  }
}

}  // namespace
}  // namespace fork1s::test
