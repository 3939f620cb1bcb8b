// Runs the command line as a user types it.
#pragma once

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>

namespace fork1s::test {

struct Outcome {
  int code = -1;
  std::string out, err;
  nlohmann::json Json() const { return nlohmann::json::parse(out); }
};

inline std::filesystem::path ScratchFolder() {
  static const std::filesystem::path folder = [] {
    auto path = std::filesystem::path(testing::TempDir()) / ("fork1s_cli_" + std::to_string(getpid()));
    std::filesystem::create_directories(path);
    return path;
  }();
  return folder;
}

inline std::string Slurp(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::stringstream text;
  text << file.rdbuf();
  return text.str();
}

inline std::string Write(const std::string& name, const std::string& text) {
  const auto path = ScratchFolder() / name;
  std::ofstream(path, std::ios::binary) << text;
  return path.string();
}

inline Outcome Shell(const std::string& command) {
  const auto out = ScratchFolder() / "stdout", err = ScratchFolder() / "stderr";
  const int status = std::system(("(" + command + ") >" + out.string() + " 2>" + err.string()).c_str());
  Outcome outcome;
  outcome.code = WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
  outcome.out = Slurp(out);
  outcome.err = Slurp(err);
  return outcome;
}

inline Outcome Fork1s(const std::string& arguments, const std::string& before = "") {
  return Shell(before + " " + FORK1S_BINARY + " " + arguments);
}

// A finger of two hinges over a floor, with a servo and a ball to touch.
inline std::string FingerModel(const std::string& extra = "") {
  return R"(<mujoco model="finger">
  <option gravity="0 0 -9.81"/>
  <custom><text name="fork1s_interface" data="tip"/><numeric name="fork1s_modes" data="2"/></custom>
  <worldbody>
    <geom name="floor" type="plane" size="1 1 .1"/>
    <body name="proximal" pos="0 0 .3">
      <joint name="knuckle" type="hinge" axis="0 1 0" stiffness="2" damping=".05" springref="0"/>
      <geom type="capsule" fromto="0 0 0 .05 0 0" size=".008" mass=".05"/>
      <body name="tip" pos=".05 0 0">
        <joint name="end" type="hinge" axis="0 1 0" damping=".02"/>
        <geom type="capsule" fromto="0 0 0 .03 0 0" size=".007" mass=".03"/>
      </body>
    </body>
    <body name="ball" pos=".5 0 .1"><freejoint/><geom type="sphere" size=".02" mass=".1"/></body>
  </worldbody>
  <actuator><position name="bend" joint="end" kp="1" ctrllimited="true" ctrlrange="-1 1"/></actuator>
)" + extra +
         "</mujoco>\n";
}

// A chain whose reader takes more than ten seconds.
inline std::string SlowModel() {
  std::string text = "<robot name=\"slow\"><link name=\"l0\"/>";
  for (int i = 1; i < 3000; ++i) {
    const std::string n = std::to_string(i), before = std::to_string(i - 1);
    text += "<link name=\"l" + n +
            "\"><inertial><mass value=\"0.1\"/><inertia ixx=\"1e-3\" iyy=\"1e-3\" izz=\"1e-3\" "
            "ixy=\"0\" ixz=\"0\" iyz=\"0\"/></inertial></link><joint name=\"j" +
            n +
            "\" type=\"revolute\"><parent "
            "link=\"l" +
            before + "\"/><child link=\"l" + n +
            "\"/><origin xyz=\"0.01 0 0\"/><axis xyz=\"0 1 0\"/>"
            "<limit lower=\"-1\" upper=\"1\" effort=\"1\" velocity=\"1\"/></joint>\n";
  }
  return text + "</robot>";
}

}  // namespace fork1s::test
