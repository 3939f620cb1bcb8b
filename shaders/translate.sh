#!/usr/bin/env bash
# Makes of the four compute shaders what other interfaces take: SPIR-V for Vulkan, HLSL for Direct3D, MSL for Metal; each is
# checked by its own compiler where Debian has one, which is for SPIR-V and HLSL.
#
#     translate.sh [FOLDER]     default: ./translated
#
# Needs glslangValidator, spirv-val and spirv-cross (Debian: glslang-tools, spirv-tools, spirv-cross); 77 where one is missing.
set -euo pipefail
shaders=$(cd "$(dirname "$0")" && pwd)
out=${1:-translated}
for program in glslangValidator spirv-val spirv-cross; do
  if ! command -v "$program" >/dev/null; then
    echo "translate: skipped, there is no $program; Debian's glslang-tools, spirv-tools and spirv-cross have all three" >&2
    exit 77
  fi
done
mkdir -p "$out"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
for source in "$shaders"/*.comp.glsl; do
  name=$(basename "$source" .comp.glsl)
  glslangValidator -V -S comp "$source" -o "$out/$name.spv" >"$work/log" || { cat "$work/log" >&2; exit 1; }
  spirv-val "$out/$name.spv"
  spirv-cross "$out/$name.spv" --hlsl --shader-model 50 --output "$out/$name.hlsl"
  spirv-cross "$out/$name.spv" --msl --output "$out/$name.metal"
  glslangValidator -D -V -S comp -e main "$out/$name.hlsl" -o "$work/again.spv" >"$work/log" || { cat "$work/log" >&2; exit 1; }
done
echo "translate: $(find "$out" -type f | wc -l) files in $out"
