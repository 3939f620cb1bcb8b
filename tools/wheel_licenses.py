"""Adds to a wheel the licenses of the Debian packages that are in it, and those packages to its SBOM:

    wheel_licenses.py WHEEL [BUILD]

Of each shared library in NAME.libs, which auditwheel has put there, the package that has the file; of what is compiled
from headers, the packages in HEADERS. Their licenses, those that Debian installs with them, become
NAME.dist-info/licenses/PACKAGE.txt, and lines of RECORD. What auditwheel's list of components (CycloneDX) lacks is
added to it. Fails where a library has no package or a package no license, and, where the folder of the build is given,
where a header that was compiled into it belongs to what the wheel has no license of.
"""

import base64
import hashlib
import json
import os
import re
import subprocess
import sys
import sysconfig
import zipfile
from pathlib import Path

HEADERS = [
    "libeigen3-dev",
    "libboost1.74-dev",
    "nlohmann-json3-dev",
    "libcli11-dev",
    "libexpected-dev",
    "libspectra-dev",
]
# The system's own libraries, which no wheel carries.
SYSTEM = {"gcc-12", "glibc", "linux", "zlib"}
# What the build fetches, by its folder there: where the wheel has its license.
FETCHED = {
    "nanobind": "fork1s/lib/licenses/nanobind.txt",
    "robin_map": "fork1s/lib/licenses/robin_map.txt",
    "mujoco": "fork1s/lib/LICENSE",
}


def ask(*command: str) -> str:
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def package_of(library: str) -> str:
    # libz-1a2b3c4d.so.1 is a copy of libz.so.1.
    file = re.sub(r"-[0-9a-f]{8}(?=\.)", "", library, count=1)
    try:
        owners = ask("dpkg", "-S", f"*/{file}")
    except subprocess.CalledProcessError:
        sys.exit(
            f"wheel: no Debian package has {file}, so that its license is unknown; the wheel carries it as {library}"
        )
    return owners.partition(":")[0].partition(",")[0]


def compiled_headers(build: Path) -> set[str]:
    """Absolute paths of the files that objects of the wheel were compiled from."""
    files, is_shipped = set(), False
    for line in ask("ninja", "-C", str(build), "-t", "deps").splitlines():
        if line.startswith("    "):
            if is_shipped:
                files.add(os.path.normpath(build / line.strip()))
        elif line:
            is_shipped = line.startswith(("src/", "apps/", "bindings/"))
    return files


def source_packages(packages: set[str]) -> dict[str, str]:
    lines = ask("dpkg-query", "-W", "-f", "${source:Package} ${Package}\n", *sorted(packages)).splitlines()
    return {package: source for source, package in map(str.split, lines)}


def check_headers(build: Path, packages: set[str], names: set[str]) -> None:
    """packages: whose licenses the wheel has; names: of its files."""
    ours, python = Path.cwd(), Path(sysconfig.get_paths()["include"])
    foreign = set()
    for file in map(Path, compiled_headers(build)):
        if file.is_relative_to(build):
            folder = file.relative_to(build).parts[0].partition("-")[0]
            if folder in FETCHED:
                foreign.add("robin_map" if "robin_map" in file.parts else folder)
        elif not file.is_relative_to(ours) and not file.is_relative_to(python):
            foreign.add(str(file))
    for name in sorted(foreign & FETCHED.keys()):
        if FETCHED[name] not in names:
            sys.exit(f"wheel: {FETCHED[name]} is missing, the license of {name}, which is compiled into it")
    owners = {}
    for line in ask("dpkg", "-S", *sorted(foreign - FETCHED.keys())).splitlines():
        package, _, file = line.rpartition(": ")
        owners.setdefault(package.partition(":")[0], file)
    sources = source_packages({*owners, *packages})
    licensed = SYSTEM | {sources[package] for package in packages}
    for package, file in sorted(owners.items()):
        if sources[package] not in licensed:
            sys.exit(f"wheel: {file} is compiled into it without a license; add {package} to HEADERS")


def main(wheel: Path, build: Path | None) -> None:
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
        record = next(name for name in names if name.endswith(".dist-info/RECORD"))
        content = {name: archive.read(name) for name in names if not name.endswith("/")}
        modes = {name: archive.getinfo(name) for name in content}
    info = record.rpartition("/")[0]
    libraries = [name.rpartition("/")[2] for name in content if name.partition("/")[0].endswith(".libs")]
    sbom = f"{info}/sboms/auditwheel.cdx.json"
    components = json.loads(content[sbom])
    added = set()
    packages = {*map(package_of, libraries), *HEADERS}
    if build:
        check_headers(build, packages, set(names))
    for package in sorted(packages):
        notice = Path("/usr/share/doc") / package / "copyright"
        if not notice.is_file():
            sys.exit(
                f"wheel: {notice} is missing, the license of what the wheel carries; reinstall {package}"
            )
        content[f"{info}/licenses/{package}.txt"] = notice.read_bytes()
        added.add(f"{info}/licenses/{package}.txt")
        if package not in {c["name"] for c in components["components"]}:
            version = ask("dpkg-query", "-W", "-f", "${Version}", package)
            purl = f"pkg:deb/debian/{package}@{version.replace('+', '%2B')}"
            component = {
                "type": "library",
                "bom-ref": purl,
                "name": package,
                "version": version,
                "purl": purl,
            }
            components["components"].append(component)
    content[sbom] = json.dumps(components).encode()
    written = {*added, sbom}
    lines = [
        line for line in content.pop(record).decode().splitlines() if line.rsplit(",", 2)[0] not in written
    ]
    for name in sorted(written):
        digest = base64.urlsafe_b64encode(hashlib.sha256(content[name]).digest()).rstrip(b"=").decode()
        lines.append(f"{name},sha256={digest},{len(content[name])}")
    content[record] = ("\n".join(lines) + "\n").encode()
    with zipfile.ZipFile(wheel, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in content.items():
            archive.writestr(modes.get(name, name), data, zipfile.ZIP_DEFLATED)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]).resolve() if sys.argv[2:] else None)
