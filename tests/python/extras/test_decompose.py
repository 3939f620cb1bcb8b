"""Colliding meshes in convex pieces: what falls into a cup, masses, files, the cache, what is refused."""

import shutil
import struct
import subprocess
import sys
import zlib
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

import fork1s
import fork1s.decompose
from fork1s._mesh_pieces import read_stl, volume

pytest.importorskip("coacd")
mujoco = pytest.importorskip("mujoco")

SIDE, WALL, HEIGHT, RADIUS = 0.1, 0.01, 0.08, 0.02  # m
CUP_VOLUME = SIDE**2 * HEIGHT - (SIDE - 2 * WALL) ** 2 * (HEIGHT - WALL)


def cup():
    """A square cup that stands on z = 0: vertices in m, triangles outwards."""
    square = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) / 2
    rings = [(SIDE, 0), (SIDE, HEIGHT), (SIDE - 2 * WALL, HEIGHT), (SIDE - 2 * WALL, WALL)]
    vertices = np.vstack([np.c_[side * square, np.full(4, z)] for side, z in rings])
    faces = [(0, 2, 1), (0, 3, 2), (12, 13, 14), (12, 14, 15)]
    for ring in range(3):
        for i in range(4):
            a, b = 4 * ring + i, 4 * ring + (i + 1) % 4
            faces += [(a, b, b + 4), (a, b + 4, a + 4)]
    return vertices, np.array(faces)


def write_obj(path, vertices, faces):
    path.parent.mkdir(parents=True, exist_ok=True)
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in vertices]
    lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in faces]
    path.write_text("\n".join(lines) + "\n")


# The mesh is in millimetres, turned and moved, its class has the friction, and a frame and the body turn it back.
MODEL = """<mujoco><compiler meshdir="parts" angle="degree"/>
  <default><default class="pottery"><geom type="mesh" friction=".7 .01 .001" condim="4" density="2500" solref=".01 1"/></default>
    <default class="wood"><geom friction=".2" density="600" condim="1" mass=".3"/></default></default>
  <asset><mesh name="cup" file="cup.obj" scale=".001 .001 .001" refpos="300 -200 100" refquat=".5 .5 .5 .5"/>
    <mesh name="fitted" file="cup.obj" scale=".001 .001 .001"/></asset>
  <include file="rest.xml"/>
</mujoco>"""
REST = """<mujoco><worldbody>
  <geom name="ground" type="plane" size="0 0 1"/>
  <body name="cup" childclass="wood">
    <freejoint/>
    <frame euler="90 0 90"><frame pos="-.2 .1 .3">
      <geom name="wall" class="pottery" mesh="cup" POSE/>
    </frame></frame>
    <geom name="core" type="box" mesh="fitted" contype="0" conaffinity="0" mass=".01"/>
  </body>
  <body name="ball" pos=".01 .005 .11"><freejoint/><geom name="ball" size=".02" mass=".05"/></body>
</worldbody></mujoco>"""


def write_model(tmp_path):
    """MODEL with the cup's geom placed so that the cup stands on the ground."""
    vertices, faces = cup()
    write_obj(tmp_path / "parts" / "cup.obj", 1000 * vertices, faces)
    path = tmp_path / "model.xml"
    path.write_text(MODEL)
    (tmp_path / "rest.xml").write_text(REST.replace("POSE", ""))
    # The pose of the asset's file in the body, R and p, by MuJoCo; the geom undoes it.
    m = mujoco.MjModel.from_xml_path(str(path))
    geom, mesh = m.geom("wall").id, m.mesh("cup").id
    quats = [np.zeros(9), np.zeros(9)]
    mujoco.mju_quat2Mat(quats[0], m.geom_quat[geom])
    mujoco.mju_quat2Mat(quats[1], m.mesh_quat[mesh])
    R_BM, R_AM = (q.reshape(3, 3) for q in quats)
    R_BA = R_BM @ R_AM.T
    p_BA = m.geom_pos[geom] - R_BA @ m.mesh_pos[mesh]
    # refquat .5 .5 .5 .5 and refpos (in numbers of the file): an asset's vertex is R_ref^T (v - refpos).
    R_ref = np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0]])
    ref = np.array([0.3, -0.2, 0.1])
    # v_B = R_BA (R_g R_ref^T (v - ref) + p_g) + p_BA = v
    R_g = R_BA.T @ R_ref
    p_g = R_BA.T @ (ref - p_BA)
    quat = np.zeros(4)
    mujoco.mju_mat2Quat(quat, R_g.ravel())
    pose = f'pos="{" ".join(map(repr, map(float, p_g)))}" quat="{" ".join(map(repr, map(float, quat)))}"'
    (tmp_path / "rest.xml").write_text(REST.replace("POSE", pose))
    return path


@pytest.fixture(scope="session")
def pieces(tmp_path_factory):
    """The folder of pieces, so that CoACD's 5 s are spent once."""
    folder = tmp_path_factory.mktemp("pieces")
    done = fork1s.decompose.decompose_meshes(write_model(folder), folder / "out.xml")
    assert done.computed == ("cup",)
    return folder / "out_pieces"


@pytest.fixture
def model(tmp_path, pieces):
    shutil.copytree(pieces, tmp_path / "out_pieces")
    return write_model(tmp_path)


def rest_height(path):
    sim = fork1s.Simulation(fork1s.load(path), dt=1 / 240)
    sim.step(480)
    return sim.pose("ball")[2, 3] - sim.pose("cup")[2, 3]


def test_a_ball_falls_into_the_cup(model, tmp_path):
    """It rests on the floor; on the convex hull it rests on the rim. The compliance of contact is below 0.1 mm."""
    shutil.copytree(tmp_path / "out_pieces", tmp_path / "elsewhere" / "out_pieces")
    out = tmp_path / "elsewhere" / "out.xml"
    done = fork1s.decompose.decompose_meshes(model, out)
    assert list(done.meshes) == ["cup"] and done.notes == ()
    assert rest_height(model) == pytest.approx(HEIGHT + RADIUS, abs=2e-4)
    # CoACD cuts within its tolerance of the floor
    assert rest_height(out) == pytest.approx(WALL + RADIUS, abs=1e-3)
    # MuJoCo's own simulation of the written file, which shares no code with ours
    m = mujoco.MjModel.from_xml_path(str(out))
    data = mujoco.MjData(m)
    for _ in range(1000):
        mujoco.mj_step(m, data)
    height = data.body("ball").xpos[2] - data.body("cup").xpos[2]
    assert height == pytest.approx(WALL + RADIUS, abs=1e-3)


def test_sides_of_a_cube_texture_are_found_from_the_written_file(model, tmp_path):
    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header, pixel = struct.pack(">IIBBBBB", 1, 1, 8, 2, 0, 0, 0), zlib.compress(b"\0\x20\x40\x60")
    png = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", pixel) + chunk(b"IEND", b"")
    (tmp_path / "side.png").write_bytes(png)
    texture = (
        '<texture name="faces" type="cube" fileright="side.png"/><material name="faces" texture="faces"/>'
    )
    model.write_text(model.read_text().replace("<asset>", "<asset>" + texture))
    shutil.copytree(tmp_path / "out_pieces", tmp_path / "elsewhere" / "out_pieces")
    fork1s.decompose.decompose_meshes(model, tmp_path / "elsewhere" / "out.xml")
    m = mujoco.MjModel.from_xml_path(str(tmp_path / "elsewhere" / "out.xml"))
    assert list(m.tex_data[:3]) == [0x20, 0x40, 0x60]


def test_pieces_have_the_volume_place_and_settings_of_the_mesh(model, tmp_path):
    out = tmp_path / "out.xml"
    done = fork1s.decompose.decompose_meshes(model, out)
    pieces = [read_stl(path) for path in done.meshes["cup"]]
    # pieces are hulls of parts that are concave by a twentieth of the half size at most
    assert sum(volume(*piece) for piece in pieces) == pytest.approx(CUP_VOLUME, rel=0.05)
    before, after = (mujoco.MjModel.from_xml_path(str(path)) for path in (model, out))
    for name in ("body_mass", "body_inertia", "body_ipos", "body_iquat", "dof_armature", "qpos0"):
        assert_allclose(getattr(after, name), getattr(before, name), rtol=1e-9, atol=1e-12)
    assert before.geom("wall").contype[0] == 1
    assert after.geom("wall").contype[0] == after.geom("wall").conaffinity[0] == 0
    data = mujoco.MjData(after)
    mujoco.mj_forward(after, data)
    corners = []
    for i in range(len(pieces)):
        geom = after.geom(f"wall_piece{i}")
        for name in ("contype", "conaffinity", "condim", "friction", "solref", "solimp", "priority"):
            assert_allclose(getattr(geom, name), getattr(before.geom("wall"), name))
        assert after.mesh(geom.dataid[0]).name == f"cup_piece{i}"
        first, count = after.mesh_vertadr[geom.dataid[0]], after.mesh_vertnum[geom.dataid[0]]
        vertices = after.mesh_vert[first : first + count]
        corners.append(vertices @ data.geom_xmat[geom.id].reshape(3, 3).T + data.geom_xpos[geom.id])
    corners = np.vstack(corners)
    assert_allclose(corners.min(axis=0), [-SIDE / 2, -SIDE / 2, 0], atol=1e-3)
    assert_allclose(corners.max(axis=0), [SIDE / 2, SIDE / 2, HEIGHT], atol=1e-3)


def test_a_second_call_decomposes_nothing(model, tmp_path, monkeypatch):
    import coacd

    calls = []

    def one_piece(mesh, **options):
        """In place of CoACD: a tetrahedron."""
        calls.append(options)
        return [
            (
                np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]) / 100,
                [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]],
            )
        ]

    monkeypatch.setattr(coacd, "run_coacd", one_piece)
    out = tmp_path / "out.xml"
    first = fork1s.decompose.decompose_meshes(model, out)
    text = out.read_bytes()
    again = fork1s.decompose.decompose_meshes(model, out)
    assert again == first and again.computed == () and out.read_bytes() == text and not calls
    # other options, a folder that lost a piece, another mesh
    fewer = fork1s.decompose.decompose_meshes(model, out, max_pieces=5)
    assert fewer.computed == ("cup",) and len(fewer.meshes["cup"]) == 1
    assert calls[-1]["max_convex_hull"] == 5
    Path(first.meshes["cup"][0]).unlink()
    assert fork1s.decompose.decompose_meshes(model, out).computed == ("cup",)
    vertices, faces = cup()
    write_obj(tmp_path / "parts" / "cup.obj", 1001 * vertices, faces)
    assert fork1s.decompose.decompose_meshes(model, out).computed == ("cup",)
    assert fork1s.decompose.decompose_meshes(model, out).computed == () and len(calls) == 3


def test_pairs_name_the_pieces(model, tmp_path):
    """A geom that collides by <pair> alone."""
    rest = tmp_path / "rest.xml"
    rest.write_text(
        rest.read_text().replace('name="wall"', 'name="wall" contype="0" conaffinity="0"')
        .replace("</worldbody>", "</worldbody><contact>"
                 '<pair geom1="ball" geom2="wall" friction=".3 .3 .01 .001 .001"/>'
                 '<pair geom1="wall" geom2="ground"/></contact>')
    )  # fmt: skip
    out = tmp_path / "out.xml"
    done = fork1s.decompose.decompose_meshes(model, out)
    m = mujoco.MjModel.from_xml_path(str(out))
    count = len(done.meshes["cup"])
    assert m.npair == 2 * count
    names = [{m.geom(int(g)).name for g in ends} for ends in zip(m.pair_geom1, m.pair_geom2)]
    for other, friction in (("ball", 0.3), ("ground", 1)):
        for i in range(count):
            k = names.index({other, f"wall_piece{i}"})
            assert m.pair_friction[k, 0] == friction
    assert rest_height(out) == pytest.approx(WALL + RADIUS, abs=1e-3)


def command(*arguments):
    return subprocess.run(
        [sys.executable, "-m", "fork1s.decompose", *map(str, arguments)], capture_output=True, text=True
    )


def test_command(model, tmp_path):
    out = tmp_path / "out.xml"
    done = command(model, out, "--mesh", "cup")
    assert done.returncode == 0 and f"wrote {out}" in done.stdout, done.stderr
    assert "mesh 'cup': " in done.stdout and "pieces of an earlier call" in done.stdout


@pytest.fixture
def refusal(capsys):
    def refuse(*arguments, code=3):
        assert fork1s.decompose.main([*map(str, arguments)]) == code
        return capsys.readouterr().err

    return refuse


def test_what_cannot_be_is_a_sentence(model, tmp_path, refusal):
    out = tmp_path / "out.xml"
    assert "gone.xml" in refusal(tmp_path / "gone.xml", out)
    noise = tmp_path / "noise.xml"
    noise.write_bytes(bytes(range(256)))
    assert "noise.xml" in refusal(noise, out)
    robot = tmp_path / "arm.urdf"
    robot.write_text("<robot name='arm'><link name='base'/></robot>")
    assert f"fork1s export {robot} arm.xml" in refusal(robot, out)
    plain = tmp_path / "plain.xml"
    plain.write_text("<mujoco><worldbody><body><freejoint/><geom size='.1'/></body></worldbody></mujoco>")
    assert "no mesh that collides" in refusal(plain, out)
    assert "use the model as it is" in refusal(model, out, "--max-fill", 0.1)
    assert "those that do are: cup" in refusal(model, out, "--mesh", "fitted")
    assert "no share" in refusal(model, out, "--max-fill", 0, code=2)
    assert "between 0.01 and 1" in refusal(model, out, "--threshold", 5, code=2)
    assert "above 0" in refusal(model, out, "--max-pieces", 0, code=2)
    assert "is the model itself" in refusal(model, model, code=2)
    out.write_text("<mujoco/>")
    assert "out.xml" in refusal(model, out) and out.read_text() == "<mujoco/>"
    assert "nowhere" in refusal(model, tmp_path / "nowhere" / "out.xml")
    broken = tmp_path / "parts" / "cup.obj"
    broken.write_text("no mesh\n")
    assert "cup" in refusal(model, tmp_path / "other.xml")


def test_missing_packages_are_named(model, tmp_path):
    program = f"""
import sys
sys.modules["coacd"] = None
import fork1s.decompose
sys.exit(fork1s.decompose.main([{str(model)!r}, {str(tmp_path / "out.xml")!r}]))
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.returncode == 3 and "pip install 'fork1s[decompose]'" in done.stderr, done.stderr
    assert "Traceback" not in done.stderr


def test_an_open_mesh_is_named_and_left(model, tmp_path, refusal):
    vertices, faces = cup()
    write_obj(tmp_path / "parts" / "cup.obj", 1000 * vertices, faces[1:])
    assert "'cup' is not closed" in refusal(model, tmp_path / "out.xml")
