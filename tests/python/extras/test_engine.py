"""The shaders on another interface than OpenGL: as SPIR-V through WebGPU and Vulkan, by two programs that are installed."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("wgpu")
ROOT = Path(__file__).resolve().parents[3]
CHROMIUM = Path("/usr/lib/chromium")  # brings a Vulkan that needs no graphics card


def test_poses_by_webgpu(tmp_path):
    translated = subprocess.run(
        ["bash", ROOT / "shaders" / "translate.sh", tmp_path / "spirv"], capture_output=True, text=True
    )
    if translated.returncode == 77:
        pytest.skip(translated.stderr)
    assert translated.returncode == 0, translated.stderr
    folders = []
    for recovery in ("curved", "twist"):
        folders.append(tmp_path / recovery)
        program = [Path(sys.executable).parent / "fork1s", "reduce", ROOT / "scenes" / "firemen.xml"]
        subprocess.run(
            [*program, "--buffers", folders[-1], "--recovery", recovery], check=True, capture_output=True
        )
    environment = dict(os.environ)
    if (CHROMIUM / "vk_swiftshader_icd.json").exists():
        environment |= {
            "VK_ICD_FILENAMES": str(CHROMIUM / "vk_swiftshader_icd.json"),
            "LD_LIBRARY_PATH": str(CHROMIUM),
        }
    host = ROOT / "examples" / "engine_poses" / "webgpu_host.py"
    done = subprocess.run(
        [sys.executable, host, tmp_path / "spirv", *folders], env=environment, capture_output=True, text=True
    )
    if done.returncode != 0 and "adapter failed" in done.stderr:
        pytest.skip("there is no adapter of WebGPU: " + done.stderr.splitlines()[-1])
    assert done.returncode == 0, done.stderr
    errors = [float(e) for e in re.findall(r"34 bodies on .* off by at most ([0-9.e-]+)", done.stdout)]
    assert len(errors) == 3 and max(errors) < 5e-7, done.stdout
