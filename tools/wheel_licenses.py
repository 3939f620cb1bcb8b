"""Adds to a wheel the licenses of the Debian packages that are in it, and those packages to its SBOM: wheel_licenses.py WHEEL

Of each shared library in NAME.libs, which auditwheel has put there, the package that has the file; of what is compiled
from headers, the packages in HEADERS. Their licenses, those that Debian installs with them, become
NAME.dist-info/licenses/PACKAGE.txt, and lines of RECORD. What auditwheel's list of components (CycloneDX) lacks is
added to it. Fails where a library has no package or a package no license.
"""

import base64
import hashlib
import json
import re
import subprocess
import sys
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


def main(wheel: Path) -> None:
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
    for package in sorted({*map(package_of, libraries), *HEADERS}):
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
    main(Path(sys.argv[1]))
