"""Write the program's bill of materials, docs/sbom.cdx.json: every locked package that it needs when it runs.

CycloneDX, made by cyclonedx-py from what the images hold (deploy/requirements.txt) and the torch that pyproject.toml
pins. The same packages give the same bytes: there is no time in it and no serial number. Hashes are in the lock.

    python .ci/sbom.py [--check]
"""

import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
TARGET = ROOT / "docs/sbom.cdx.json"
# What cyclonedx-py says about the file it read and the index that it would ask, which is no property of a package.
_LEFT_OUT = ("description", "externalReferences")


def main() -> int:
    """Write the file, or with `--check` tell by the exit status whether it is up to date."""
    text = bill_of_materials()
    if "--check" in sys.argv[1:]:
        if TARGET.is_file() and TARGET.read_text(encoding="utf-8") == text:
            return 0
        print(f"{TARGET.relative_to(ROOT)} is not what the lock says; run `make sbom`", file=sys.stderr)
        return 1
    TARGET.write_text(text, encoding="utf-8")
    return 0


def bill_of_materials() -> str:
    """Return the bill of materials as CycloneDX 1.6 in JSON."""
    program = str(Path(sys.executable).with_name("cyclonedx-py"))
    options = ["--output-reproducible", "--spec-version", "1.6", "--short-PURLs", "--pyproject", "pyproject.toml"]
    done = subprocess.run(
        [program, "requirements", *options, "-"],
        cwd=ROOT,
        input="\n".join(packages()),
        capture_output=True,
        text=True,
        check=True,
    )
    bill: dict[str, Any] = json.loads(done.stdout)
    bill["components"] = sorted(map(_without_traces, bill["components"]), key=lambda component: component["purl"])
    for made_with in bill["metadata"]["tools"]["components"]:
        del made_with["externalReferences"]
    bill["dependencies"] = [{"ref": component["purl"]} for component in bill["components"]]
    return json.dumps(bill, indent=1, sort_keys=True) + "\n"


def packages() -> list[str]:
    """Return each package that the program needs as `name==version`, torch included."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    lock = (ROOT / "deploy/requirements.txt").read_text(encoding="utf-8")
    locked = re.findall(r"^([a-z0-9-]+)(?:\[[a-z,]+\])?==([^ ;\\]+)", lock, re.MULTILINE)
    return sorted(
        [*(f"{name}=={version}" for name, version in locked), settings["tool"]["uv"]["constraint-dependencies"][0]]
    )


def _without_traces(component: dict[str, Any]) -> dict[str, Any]:
    kept = {name: value for name, value in component.items() if name not in _LEFT_OUT}
    return kept | {"bom-ref": component["purl"]}


if __name__ == "__main__":
    sys.exit(main())
