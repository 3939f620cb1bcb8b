// Files that ask for all memory, all time, or more than they hold: refused with a sentence, no crash, no
// hang.
#include <algorithm>
#include <cstdint>
#include <string>
#include <vector>

#include <sys/stat.h>

#include "command.hpp"
#include "hostile_models.hpp"

namespace fork1s::test {
namespace {

namespace fs = std::filesystem;

const std::string kBody =
    "<worldbody><body pos=\"0 0 1\"><joint name=\"j\" type=\"slide\" stiffness=\"10\"/><geom "
    "size=\".1\"/></body>"
    "</worldbody>";

std::string Model(const std::string& before) { return "<mujoco>" + before + kBody + "</mujoco>"; }

// A program that waits for ever is ended and fails the test.
Outcome Try(const std::string& arguments) { return Fork1s(arguments, "timeout -s KILL 60"); }

std::string Png(std::uint32_t width, std::uint32_t height) {
  std::string png("\211PNG\r\n\032\n\0\0\0\rIHDR", 16);
  for (const std::uint32_t n : {width, height})
    for (int shift = 24; shift >= 0; shift -= 8) png += static_cast<char>(n >> shift);
  return png + std::string(64, '\0');
}

TEST(Hostile, ModelsThatAskForTooMuch) {
  Write("large.png", Png(30000, 30000));
  Write("large.hfield", Bits<std::int32_t>({20000, 20000}) + std::string(64, '\0'));
  const struct {
    const char* text;
    const char* named;
  } cases[] = {
      {"<size nkey=\"2000000000\"/>", "nkey"},
      {"<size nuser_body=\"2000000000\"/>", "nuser_body"},
      {"<asset><hfield name=\"h\" nrow=\"20000\" ncol=\"20000\" size=\"1 1 1 1\"/></asset>", "cells"},
      {"<asset><hfield name=\"h\" file=\"large.png\" size=\"1 1 1 1\"/></asset>", "large.png"},
      {"<asset><hfield name=\"h\" file=\"large.hfield\" size=\"1 1 1 1\"/></asset>", "large.hfield"},
      {"<asset><texture name=\"t\" type=\"2d\" file=\"large.png\"/></asset>", "large.png"},
      {"<asset><texture name=\"t\" type=\"2d\" builtin=\"flat\" width=\"30000\" height=\"30000\"/></asset>",
       "pixels"},
      {"<worldbody><replicate count=\"1000\"><replicate count=\"1000\"><geom "
       "size=\".1\"/></replicate></replicate>"
       "</worldbody>",
       "copies"},
  };
  for (const auto& c : cases) {
    const Outcome o = Try("inspect " + Write("large.xml", Model(c.text)));
    EXPECT_EQ(o.code, 3) << c.text << o.err;
    EXPECT_NE(o.err.find("large.xml, line 1"), std::string::npos) << o.err;
    EXPECT_NE(o.err.find(c.named), std::string::npos) << o.err;
  }
}

TEST(Hostile, IncludesThatMultiply) {
  const std::string four = [] {
    std::string text;
    for (int i = 0; i < 4; ++i) text += "<include file=\"NEXT\"/>";
    return text;
  }();
  const auto including = [&](const std::string& next) {
    std::string text = four;
    for (std::size_t at = 0; (at = text.find("NEXT")) != std::string::npos;) text.replace(at, 4, next);
    return text;
  };
  EXPECT_EQ(Try("inspect " + Write("itself.xml", Model(including("itself.xml")))).code, 3);
  for (int i = 0; i < 16; ++i)
    Write("level" + std::to_string(i) + ".xml",
          "<mujocoinclude>" + including("level" + std::to_string(i + 1) + ".xml") + "</mujocoinclude>");
  Write("level16.xml", "<mujocoinclude><option/></mujocoinclude>");
  EXPECT_EQ(Try("inspect " + Write("levels.xml", Model(including("level0.xml")))).code, 3);
}

std::string Attaching(const std::vector<std::string>& files) {
  std::string models, attached;
  for (std::size_t i = 0; i < files.size(); ++i) {
    const std::string n = std::to_string(i);
    models += "<model name=\"m" + n + "\" file=\"" + files[i] + "\"/>";
    attached += "<attach model=\"m" + n + "\" body=\"b\" prefix=\"p" + n + "\"/>";
  }
  return "<mujoco><asset>" + models +
         "</asset><worldbody><body name=\"b\"><joint stiffness=\"1\"/><geom "
         "size=\".1\"/>" +
         attached + "</body></worldbody></mujoco>";
}

// The reader follows models that attach others until its stack ends, and reads each as often as it is named.
TEST(Hostile, ModelsThatAttachThemselves) {
  fs::create_directories(ScratchFolder() / "sub");
  Write("sub/leaf.xml", Attaching({}));
  Write("sub/inner.xml", Attaching({"leaf.xml"}));  // from where it lies
  EXPECT_EQ(Try("inspect " + Write("outer.xml", Attaching({"sub/inner.xml"}))).code, 0);
  Write("other.xml", Attaching({"first.xml"}));
  for (const std::string& model :
       {Write("itself.xml", Attaching({"itself.xml"})), Write("first.xml", Attaching({"other.xml"}))}) {
    const Outcome o = Try("inspect " + model);
    EXPECT_EQ(o.code, 3) << o.err;
    EXPECT_NE(o.err.find("attaches this file again"), std::string::npos) << o.err;
  }
  for (int i = 0; i < 20; ++i) {
    const std::string next = "twice" + std::to_string(i + 1) + ".xml";
    Write("twice" + std::to_string(i) + ".xml", Attaching({next, next}));
  }
  Write("twice20.xml", Attaching({}));
  const Outcome o = Try("inspect " + (ScratchFolder() / "twice0.xml").string());
  EXPECT_EQ(o.code, 3) << o.err;
  EXPECT_NE(o.err.find("files to read"), std::string::npos) << o.err;
  // What an attached one names is looked at, too.
  mkfifo((ScratchFolder() / "sub/pipe.stl").c_str(), 0600);
  Write("sub/inner.xml", Model("<asset><mesh name=\"m\" file=\"pipe.stl\"/></asset>"));
  EXPECT_EQ(Try("inspect " + (ScratchFolder() / "outer.xml").string()).code, 3);
  EXPECT_EQ(Shell("cd " + ScratchFolder().parent_path().string() +
                  " && timeout -s KILL 60 " FORK1S_BINARY " inspect " +
                  (ScratchFolder().filename() / "outer.xml").string())
                .code,
            3);
}

TEST(Hostile, PipesAndDevicesInPlaceOfFiles) {
  const fs::path pipe = ScratchFolder() / "pipe.stl";
  mkfifo(pipe.c_str(), 0600);
  fs::create_symlink("/dev/zero", ScratchFolder() / "zero.stl");
  const std::string model = Write("finger.xml", FingerModel());
  for (const std::string& path : {pipe.string(), std::string("/dev/zero")})
    for (const char* command : {"inspect ", "replay ", "run --time 0.1 --controls "}) {
      const bool table = std::string(command).find("controls") != std::string::npos;
      const Outcome o = Try(command + path + (table ? " " + model : ""));
      EXPECT_EQ(o.code, 3) << command << path << o.err;
    }
  for (const char* name : {"pipe.stl", "zero.stl"}) {
    const std::string file(name);
    for (const std::string& before :
         {"<include file=\"" + file + "\"/>", "<asset><mesh name=\"m\" file=\"" + file + "\"/></asset>",
          "<asset><hfield name=\"h\" size=\"1 1 1 1\" file=\"" + file + "\"/></asset>"}) {
      const Outcome o = Try("inspect " + Write("pipes.xml", Model(before)));
      EXPECT_EQ(o.code, 3) << before << o.err;
      EXPECT_NE(o.err.find(file), std::string::npos) << o.err;
    }
    const Outcome o = Try("inspect " + Write("pipes.urdf",
                                             "<robot name=\"r\"><link name=\"a\"><visual><geometry><mesh "
                                             "filename=\"" +
                                                 file +
                                                 "\"/></geometry></visual><collision><geometry><mesh "
                                                 "filename=\"" +
                                                 file + "\"/></geometry></collision></link></robot>"));
    EXPECT_EQ(o.code, 3) << o.err;
  }
}

// A thousand links: whoever looks at them all at once looks at 6000 by 1000 numbers, and did for minutes.
TEST(Hostile, ChainsOfAThousandLinks) {
  std::string text = "<robot name=\"chain\"><link name=\"l0\"/>";
  for (int i = 1; i < 1000; ++i) {
    const std::string n = std::to_string(i);
    text += "<link name=\"l" + n +
            "\"><inertial><mass value=\"0.1\"/><inertia ixx=\"1e-3\" iyy=\"1e-3\" izz=\"1e-3\" ixy=\"0\" "
            "ixz=\"0\" "
            "iyz=\"0\"/></inertial></link><joint name=\"j" +
            n + "\" type=\"revolute\"><parent link=\"l" + std::to_string(i - 1) + "\"/><child link=\"l" + n +
            "\"/><origin xyz=\"0.01 0 0\"/><axis xyz=\"0 1 0\"/><limit lower=\"-1\" upper=\"1\" effort=\"1\" "
            "velocity=\"1\"/></joint>";
  }
  const std::string model = Write("chain.urdf", text + "</robot>");
  EXPECT_EQ(Try("inspect --pd 100,1 " + model).code, 0);
  const Outcome o = Try("run --time 0.1 " + model);  // nothing holds them
  EXPECT_EQ(o.code, 3);
  EXPECT_NE(o.err.find("PD gains"), std::string::npos) << o.err;
}

// A table of a single line, 100,000 columns or one name that long: told in time, and in a sentence.
TEST(Hostile, TablesOfControlsThatAreOneLine) {
  const std::string model = Write("finger.xml", FingerModel());
  std::string many = "time", row = "0";
  for (int i = 0; i < 100000; ++i) many += ",c" + std::to_string(i), row += ",0";
  const std::string digits(100000, '1'), name(100000, 'x');
  for (const std::string& table :
       {many + "\n" + row + "\n", "time,bend\n0," + digits + "x\n", "time," + name + "\n0,0\n"}) {
    const Outcome o = Try("run --time 0.1 --controls " + Write("line.csv", table) + " " + model);
    EXPECT_EQ(o.code, 3) << table.substr(0, 20) << o.err;
    EXPECT_LT(o.err.size(), 2500u) << table.substr(0, 20);
    EXPECT_NE(o.err.find("line.csv"), std::string::npos) << o.err;
  }
}

// Larger than contacts can be computed for: it fell through the floor.
TEST(Hostile, ShapesBeyondAllMeasure) {
  Write("far.obj", "v 1e30 0 0\nv 1 0 0\nv 0 1e30 0\nv 0 0 1e30\nf 1 2 3\nf 1 2 4\nf 1 3 4\nf 2 3 4\n");
  for (const char* geom : {"type=\"sphere\" size=\"1e30\"", "type=\"mesh\" mesh=\"m\""}) {
    const Outcome o = Try("run --time 0.1 " +
                          Write("far.xml",
                                "<mujoco><asset><mesh name=\"m\" file=\"far.obj\"/></asset><worldbody><geom "
                                "type=\"plane\" size=\"1 1 .1\"/><body pos=\"0 0 1\"><freejoint/><inertial "
                                "pos=\"0 0 0\" mass=\"1\" diaginertia=\".1 .1 .1\"/><geom " +
                                    std::string(geom) + "/></body></worldbody></mujoco>"));
    EXPECT_EQ(o.code, 3) << geom << o.out;
    EXPECT_NE(o.err.find("m from its middle"), std::string::npos) << o.err;
  }
}

// A model whose only shape is a mesh, as MJCF and as URDF.
std::vector<std::string> ModelsWith(const std::string& mesh) {
  return {Write("mesh.xml", MjcfOfMesh(mesh)), Write("mesh.urdf", UrdfOfMesh(mesh))};
}

// Qhull explains on fifty lines why it cannot wrap this one.
TEST(Hostile, MeshesThatCannotBeWrapped) {
  Write("long.obj", "v 0 0 0\nv .1 0 0\nv 0 .1 1e8\nv 0 0 .1\nf 1 2 3\nf 1 2 4\nf 1 3 4\nf 2 3 4\n");
  for (const std::string& model : ModelsWith("long.obj")) {
    const Outcome o = Try("inspect --pd 10,1 " + model);
    EXPECT_EQ(o.code, 3) << o.out;
    EXPECT_EQ(std::count(o.err.begin(), o.err.end(), '\n'), 1) << o.err;
    EXPECT_NE(o.err.find("long.obj"), std::string::npos) << o.err;
  }
}

struct BadMesh {
  std::string name, bytes;
};

std::vector<BadMesh> BadMeshes() {
  const std::string corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n";
  const std::string places = Bits<float>({0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1});
  const std::string four = Bits<std::int32_t>({4, 0, 0, 4});
  return {{"face_alone.obj", "f 1 2 3\n"},
          {"past_the_end.obj", corners + "f 1 2 3\nf 1 2 999999999\n"},
          {"before_the_start.obj", corners + "f -1 -2 -300000\n"},
          {"digits.obj", "v " + std::string(200000, '1') + " 0 0\n" + corners + "f 1 2 3\n"},
          {"nothing.obj", ""},
          {"wild.msh", four + places + Bits<std::int32_t>({0, 1, 2, 0, 1, 3, 0, 2, 3, 1, 2, 123456789})},
          {"below_zero.msh", four + places + Bits<std::int32_t>({0, 1, 2, 0, 1, 3, 0, 2, 3, 1, 2, -5})},
          {"cut_off.msh", four + places},
          {"huge.msh", Bits<std::int32_t>({2147483647, 0, 0, 2147483647}) + places},
          {"many.stl", std::string(80, ' ') + Bits<std::uint32_t>({4294967295u}) + std::string(50, '\0')}};
}

TEST(Hostile, MeshesThatNameWhatIsNotThere) {
  for (const BadMesh& bad : BadMeshes()) {
    Write(bad.name, bad.bytes);
    for (const std::string& model : ModelsWith(bad.name)) {
      const Outcome o = Try("run --time 0.1 " + model);
      EXPECT_EQ(o.code, 3) << bad.name << ' ' << model << o.err;
      EXPECT_NE(o.err.find(bad.name), std::string::npos) << o.err.substr(0, 500);
      EXPECT_LT(o.err.size(), 2000u);  // one sentence, not the file
    }
  }
}

// MuJoCo's compiler aborts, and Assimp follows a null pointer.
TEST(Hostile, ModelsThatCrashTheirReader) {
  const std::string sphere = Write("sphere.xml", BuiltinMesh("supersphere", "20000 1 1"));
  Write("skin.glb", SkinnedGlb());
  const std::string skin = ModelsWith("skin.glb")[1];
  const std::string out = (ScratchFolder() / "crashed").string();
  for (const std::string& command :
       {"inspect " + sphere, "run --time 0.1 " + sphere, "reduce " + sphere,
        "statics " + sphere + " --body m", "bench " + sphere + " --peers none",
        "view --no-open --port 0 --time 1 " + sphere, "compare " + sphere,
        "export " + sphere + " " + out + ".xml", "inspect " + skin, "run --time 0.1 " + skin}) {
    const Outcome o = Try(command);
    if (o.err.find("page") != std::string::npos) continue;  // this program was built without its page
    EXPECT_EQ(o.code, 3) << command << o.err;
    EXPECT_NE(o.err.find("brought its reader down"), std::string::npos) << command << o.err;
    EXPECT_TRUE(o.err.find("sphere.xml: ") != std::string::npos ||
                o.err.find("mesh.urdf: ") != std::string::npos)
        << o.err;
    EXPECT_LE(std::count(o.err.begin(), o.err.end(), '\n'), 2) << command << o.err;  // bench has a note, too
  }
}

TEST(Hostile, ReadersThatCrashAreToldWhereTheCallerIgnoresItsChildren) {
  Write("skin.glb", SkinnedGlb());
  const Outcome o =
      Shell("trap '' CHLD; timeout -s KILL 60 " FORK1S_BINARY " inspect " + ModelsWith("skin.glb")[1]);
  EXPECT_EQ(o.code, 3) << o.err;
  EXPECT_NE(o.err.find("brought its reader down"), std::string::npos) << o.err;
}

TEST(Hostile, ReadersThatTakeTooLongAreEnded) {
  const Outcome o = Try("inspect --read-time 0.5 " + Write("slow.urdf", SlowModel()));
  EXPECT_EQ(o.code, 3) << o.err;
  EXPECT_NE(o.err.find("slow.urdf: was not read within 0.5 s"), std::string::npos) << o.err;
}

TEST(Hostile, ModelsThatNeedMoreMemoryThanThereIs) {
#ifdef __SANITIZE_ADDRESS__
  GTEST_SKIP() << "the sanitizer takes terabytes of addresses";
#endif
  std::string fields;
  for (int i = 0; i < 20; ++i)
    fields += "<hfield name=\"h" + std::to_string(i) + "\" nrow=\"4000\" ncol=\"4000\" size=\"1 1 1 1\"/>";
  const std::string model = Write("fields.xml", Model("<asset>" + fields + "</asset>"));
  const Outcome o = Shell("ulimit -v 1000000; timeout -s KILL 60 " FORK1S_BINARY " inspect " + model);
  EXPECT_EQ(o.code, 3) << o.err;
  EXPECT_NE(o.err.find("fields.xml"), std::string::npos) << o.err;
  EXPECT_NE(o.err.find("memory"), std::string::npos) << o.err;
}

}  // namespace
}  // namespace fork1s::test
