// Mesh files beside a model. The first byte says which kind, the second whether an MJCF or a URDF file names
// it.
#include <fork1s/importer/importer.hpp>

#include "files.hpp"
#include "fuzz.hpp"

FORK1S_FUZZ_TARGET(mesh, 500) {
  using namespace fork1s;
  fuzz::Source source(input);
  const int kind = source.Below(5);
  const bool in_urdf = source.Flag();
  static constexpr const char* kKinds[] = {"obj", "stl", "msh", "dae", "glb"};
  const std::string name = std::string("mesh.") + kKinds[kind];
  const std::string path = fuzz::WriteScratch(name, fuzz::Text(source.Rest()));
  const std::string text =
      in_urdf ? "<robot name=\"r\"><link name=\"a\"/><link name=\"b\"><inertial><mass value=\"1\"/><inertia "
                "ixx=\"1\" "
                "iyy=\"1\" izz=\"1\" ixy=\"0\" ixz=\"0\" iyz=\"0\"/></inertial><collision><geometry><mesh "
                "filename=\"" +
                    path +
                    "\"/></geometry></collision></link><joint name=\"j\" type=\"revolute\"><parent "
                    "link=\"a\"/><child "
                    "link=\"b\"/><axis xyz=\"0 0 1\"/><limit lower=\"-1\" upper=\"1\" effort=\"1\" "
                    "velocity=\"1\"/></joint></robot>"
              : "<mujoco><asset><mesh name=\"m\" file=\"" + path +
                    "\"/></asset><worldbody><geom type=\"plane\" size=\"1 1 1\"/><body pos=\"0 0 1\"><joint "
                    "type=\"slide\" "
                    "axis=\"0 0 1\" stiffness=\"10\" damping=\"1\"/><geom type=\"mesh\" "
                    "mesh=\"m\"/></body></worldbody>"
                    "</mujoco>";
  const auto model = LoadMechanismFromString(text, in_urdf ? "fuzz.urdf" : "fuzz.xml");
  if (!model) return fuzz::DemandNamed(model.error());
  fuzz::Run(model->scene, {}, 2);
}
