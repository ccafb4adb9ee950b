"""The software bill of materials, in CycloneDX's form."""
import datetime
import json
import urllib.parse
import uuid

from make.context import OLDEST_GLIBC, Failed
from make.licenses import parts_of_the_page, version_of


def component_of(name, version, license_name, purl, url=None, description=None):
    component = {"type": "library", "bom-ref": purl, "name": name, "version": version}
    if description:
        component["description"] = description
    component["licenses"] = [{"expression": license_name}]
    component["purl"] = purl
    if url:
        component["externalReferences"] = [{"type": "website", "url": url}]
    return component


def components(context):
    for name, component in sorted(context.components.items()):
        version = version_of(context, component)
        if "ziglang" in component:
            purl = f"pkg:pypi/ziglang@{version}#{component['ziglang']}"
            where = "part of the compiler's package, linked statically"
        else:
            package = component.get("source", {}).get("package") or component["debian"]
            purl = f"pkg:deb/debian/{package}@{urllib.parse.quote(version, safe='')}?distro=debian-12"
            where = "compiled into the program and the library"
        yield component_of(name, version, component["license"], purl, component["url"], where)
    for name, entry in parts_of_the_page():
        purl = f"pkg:npm/{urllib.parse.quote(name, safe='/')}@{entry['version']}"
        yield component_of(name, entry["version"], entry["license"], purl, description="in the web page")


def sbom(context):
    """Writes the SBOM and checks it against CycloneDX's schema."""
    parts = list(components(context))
    own = f"pkg:generic/servodrome@{urllib.parse.quote(context.version, safe='')}"
    time = datetime.datetime.fromtimestamp(int(context.epoch), datetime.timezone.utc).strftime("%Y-%m-%dT%H:%M:%SZ")
    document = {
        "bomFormat": "CycloneDX",
        "specVersion": "1.6",
        # The same content has the same number.
        "serialNumber": f"urn:uuid:{uuid.uuid5(uuid.NAMESPACE_URL, own + json.dumps(parts))}",
        "version": 1,
        "metadata": {
            "timestamp": time,
            "component": {"type": "application", "bom-ref": own, "name": "servodrome", "version": context.version, "purl": own,
                          "licenses": [{"expression": "Apache-2.0"}],
                          "description": f"Software servo drives on real field buses; needs glibc {OLDEST_GLIBC} or newer"},
        },
        "components": parts,
        "dependencies": [{"ref": own, "dependsOn": [part["bom-ref"] for part in parts]}],
    }
    for old in context.dist.glob("servodrome-*.cdx.json"):
        old.unlink()
    path = context.dist / f"servodrome-{context.version}.cdx.json"
    path.write_text(json.dumps(document, indent=2) + "\n")
    check = ("import sys; from cyclonedx.schema import SchemaVersion; from cyclonedx.validation.json import JsonStrictValidator; "
             "error = JsonStrictValidator(SchemaVersion.V1_6).validate_str(open(sys.argv[1]).read()); sys.exit(str(error) if error else 0)")
    context.run(context.python, "-c", check, path)
    if len({part["bom-ref"] for part in parts}) != len(parts):
        raise Failed(f"{path}: two components have the same reference")
    return path
