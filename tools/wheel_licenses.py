"""Adds to a wheel the licenses of the Debian libraries that auditwheel has put into it: wheel_licenses.py WHEEL

Their packages are those of auditwheel's list of components, and their licenses those that Debian installs with them. They
become NAME.dist-info/licenses/PACKAGE.txt, and lines of RECORD.
"""

import base64
import hashlib
import json
import sys
import zipfile
from pathlib import Path


def main(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
        record = next(name for name in names if name.endswith(".dist-info/RECORD"))
        info = record.rpartition("/")[0]
        components = json.loads(archive.read(f"{info}/sboms/auditwheel.cdx.json"))["components"]
        content = {name: archive.read(name) for name in names if not name.endswith("/")}
        modes = {name: archive.getinfo(name) for name in content}
    lines = content.pop(record).decode()
    for package in sorted({c["name"] for c in components if c.get("purl", "").startswith("pkg:deb/")}):
        notice = Path("/usr/share/doc") / package / "copyright"
        if not notice.is_file():
            sys.exit(f"wheel: {notice} is missing, the license of a library that the wheel carries; reinstall {package}")
        name = f"{info}/licenses/{package}.txt"
        content[name] = notice.read_bytes()
        digest = base64.urlsafe_b64encode(hashlib.sha256(content[name]).digest()).rstrip(b"=").decode()
        lines += f"{name},sha256={digest},{len(content[name])}\n"
    content[record] = lines.encode()
    with zipfile.ZipFile(wheel, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in content.items():
            archive.writestr(modes.get(name, name), data, zipfile.ZIP_DEFLATED)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
