"""A host of the shaders that knows nothing of fork1s but two files, on WebGPU (wgpu, as SPIR-V).

    fork1s reduce MODEL --buffers BUFFERS
    shaders/translate.sh SPIRV
    python webgpu_host.py SPIRV BUFFERS...

Poses the trial frame of the files and says how far that is from the poses that stand in them.
"""

import json
import sys
from pathlib import Path

import numpy as np
import wgpu

# Which bindings each pass has: docs/engines.md.
BOUND = {
    "recover_twist": [0, 1, 2, 5],
    "recover_joints": [0, 1, 2, 3],
    "recover_scan": [0, 3, 4],
    "recover_exact": [0, 1, 3, 5],
}


class Host:
    def __init__(self, device, spirv, tables, numbers):
        """tables int32, numbers float32: when the model is new, and whenever its reference has moved."""
        self.device = device
        self.links, self.bodies = int(tables[2]), int(tables[3])
        usage = wgpu.BufferUsage
        self.buffers = [
            device.create_buffer_with_data(data=tables, usage=usage.STORAGE),
            device.create_buffer_with_data(data=numbers, usage=usage.STORAGE),
            device.create_buffer(size=4 * int(tables[8]), usage=usage.STORAGE | usage.COPY_DST),
            device.create_buffer(size=32 * self.links, usage=usage.STORAGE),
            device.create_buffer(size=32 * self.links, usage=usage.STORAGE),
            device.create_buffer(size=32 * self.bodies, usage=usage.STORAGE | usage.COPY_SRC),
        ]
        self.pipelines = {}
        for name in BOUND:
            module = device.create_shader_module(code=(Path(spirv) / f"{name}.spv").read_bytes())
            self.pipelines[name] = device.create_compute_pipeline(
                layout="auto", compute={"module": module, "entry_point": "main"}
            )

    def _dispatch(self, compute, name, invocations):
        pipeline = self.pipelines[name]
        entries = [{"binding": i, "resource": {"buffer": self.buffers[i]}} for i in BOUND[name]]
        group = self.device.create_bind_group(layout=pipeline.get_bind_group_layout(0), entries=entries)
        compute.set_pipeline(pipeline)
        compute.set_bind_group(0, group)
        compute.dispatch_workgroups((invocations + 63) // 64)

    def pose(self, frame, twist, scans=0):
        """In every frame: float32 in; quaternion, position and 1 of every body out, (bodies, 8)."""
        self.device.queue.write_buffer(self.buffers[2], 0, frame)
        encoder = self.device.create_command_encoder()
        compute = encoder.begin_compute_pass()
        if twist:
            self._dispatch(compute, "recover_twist", self.bodies)
        else:
            self._dispatch(compute, "recover_joints", self.links)
            for _ in range(scans):
                self._dispatch(compute, "recover_scan", self.links)
                self.buffers[3], self.buffers[4] = self.buffers[4], self.buffers[3]
            self._dispatch(compute, "recover_exact", self.bodies)
        compute.end()
        self.device.queue.submit([encoder.finish()])
        return np.frombuffer(self.device.queue.read_buffer(self.buffers[5]), np.float32).reshape(-1, 8)


def try_files(adapter, device, spirv, folder):
    description = json.loads((Path(folder) / "recovery.json").read_text())
    raw = (Path(folder) / description["file"]).read_bytes()

    def section(name):
        s = description["sections"][name]
        return np.frombuffer(raw, s["type"], s["count"], s["offset"])

    host = Host(device, spirv, section("tables"), section("numbers"))
    twist, scans = description["recovery"] == "twist", description["sizes"]["scan_passes"]
    wanted = section("trial_poses").reshape(-1, 8)
    for passes in [0] if twist else [0, scans]:
        poses = host.pose(section("trial_frame"), twist, passes)
        same = np.sign(
            (poses[:, :4] * wanted[:, :4]).sum(axis=1, keepdims=True)
        )  # a quaternion and its negative are one turn
        off = max(
            np.abs(same * poses[:, :4] - wanted[:, :4]).max(), np.abs(poses[:, 4:] - wanted[:, 4:]).max()
        )
        print(f"{len(poses)} bodies on {adapter.info['device']}, {passes} scans, off by at most {off:.1e}")


def main(spirv, *folders):
    adapter = wgpu.gpu.request_adapter_sync()
    device = adapter.request_device_sync()
    for folder in folders:
        try_files(adapter, device, spirv, folder)


if __name__ == "__main__":
    main(*sys.argv[1:])
